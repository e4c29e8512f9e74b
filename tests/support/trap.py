"""Files that name code from outside in every way there is; the code leaves a mark when it runs."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from poise.baselines.allowance import check_allowed
from poise.configs.errors import ConfigError
from poise.configs.files import packaged_folder
from poise.configs.schema import to_dict, to_yaml
from poise.envs.balance.config import StartNoise
from poise.training.benchmark.case import COLUMNS as CASE_COLUMNS
from poise.training.benchmark.case import case_row, failed
from poise.training.benchmark.cases import Cases
from poise.training.benchmark.folder import FORMAT, BenchmarkSettings
from poise.training.benchmark.suite import load_benchmark
from poise.training.evaluation.folder import Settings
from poise.training.running.files import csv_text
from poise.training.running.provenance import versions
from poise.training.suites.registry import load_suite
from poise.training.trials.stage import Stage
from poise.training.trials.trial import COLUMNS, Trial, row
from tests.support.benchmarks_small import write_small
from tests.support.shared import robot

CODE = """
import pathlib
pathlib.Path({mark!r}).write_text("ran")
class Trap:
    def __init__(self, robot):
        raise RuntimeError("sprung")
"""


class Ground:
    """A folder, the current one of a test, where a trap lies.

    Attributes:
        here: the folder.
        code: ``file.py:Trap``, by its whole path.
    """

    def __init__(self, here: Path):
        self.here, self._mark = here, here.parent / f"{here.name}.ran"
        self.module = f"trap_{here.name.replace('-', '_')}"
        text = CODE.format(mark=str(self._mark))
        (here / f"{self.module}.py").write_text(text)
        (here / f"{self.module}_package").mkdir()
        (here / f"{self.module}_package/inner.py").write_text(text)
        (here / "link.py").symlink_to(f"{self.module}.py")
        self.code = f"{here}/{self.module}.py:Trap"

    def sprung(self) -> bool:
        """Whether the code has run."""
        return self._mark.exists()

    def forget(self) -> None:
        """As if the code had never run."""
        self._mark.unlink(missing_ok=True)
        for name in list(sys.modules):
            if name.startswith((self.module, "_poise_outside_")):
                del sys.modules[name]

    def yaml(self, file: str, /, **fields: Any) -> str:
        """A file of these fields; returns its path."""
        (self.here / file).write_text(yaml.safe_dump(fields))
        return str(self.here / file)

    def policy(self, controller: str, folder: str = "policy", **changes: Any) -> Path:
        """The shipped policy, on another controller."""
        path = self.here / folder
        shutil.copytree(packaged_folder("policies") / "residual", path)
        config = yaml.safe_load((path / "config.yaml").read_text())
        self.yaml(f"{folder}/config.yaml", **{**config, "controller": controller, **changes})
        return path

    def seeds(self, controller: str) -> Path:
        """A folder of `poise train --seeds` with one finished run."""
        (self.here / "seeds").mkdir()
        self.policy(controller, "seeds/seed-0")
        runs = [{"seed": 0, "folder": "seed-0", "finished": True}]
        (self.here / "seeds/seeds.json").write_text(json.dumps({"runs": runs}))
        return self.here / "seeds"

    def evaluation(self, controller: str) -> Path:
        """A finished evaluation of one trial."""
        out = self.here / "evaluation"
        out.mkdir()
        settings = Settings(
            "quiet", to_dict(load_suite("quiet")), "humanoid", robot().fingerprint,
            {controller: "0"}, 0, None, {},
        )  # fmt: skip
        line = row(Trial(0, seed=1), controller, failed(ValueError()).outcome)
        entry = {"trials": 1, "recovered": 0, "recovered_rate": 0.0, "falls": 0}
        summary = {"suite": "quiet", "robot": "humanoid", "controllers": {controller: entry}}
        (out / "settings.yaml").write_text(to_yaml(settings))
        (out / "trials.csv").write_text(csv_text([line], COLUMNS))
        (out / "summary.json").write_text(json.dumps(summary))
        return out

    def benchmark(self, controller: str) -> Path:
        """A benchmark of the suite in `suite()` with one finished trial."""
        out, suite = self.here / "benchmark", load_benchmark(self.suite())
        out.mkdir()
        settings = BenchmarkSettings(
            FORMAT, self.suite(), to_dict(suite), "humanoid", robot().fingerprint, 0,
            versions(("mujoco", "numpy", "numba")), {controller: "0"},
        )  # fmt: skip
        line = case_row(Cases(suite, robot(), 0).first[0], controller, failed(ValueError()))
        entry = {"trials": 1, "errors": 0, "j50_bounded": 0, "directions": [], "factors": []}
        numbers = ("root_force_max", "j50_mean", "eta_mean", "eta_min")
        intervals = {"j50_mean_ci95": [0.0, 0.0], "eta_mean_ci95": [0.0, 0.0]}
        summary = {
            "benchmark": FORMAT, "suite": self.suite(), "seed": 0, "robot": {"name": "humanoid"},
            "controllers": {controller: {**entry, **dict.fromkeys(numbers, 0.0), **intervals,
                                         "tick_us": None}},
            "reference": controller, "ranking": [controller], "pairs": [], "seeds": [],
            "versions": {}, "machine": {"processor": "", "cores": 1}, "commit": None,
        }  # fmt: skip
        (out / "settings.yaml").write_text(to_yaml(settings))
        (out / "trials.csv").write_text(csv_text([line], CASE_COLUMNS))
        (out / "trials.jsonl").touch()
        (out / "summary.json").write_text(json.dumps(summary))
        return out

    def suite(self) -> str:
        """A small benchmark's suite."""
        return str(write_small(self.here))


def allowed_there(name: str) -> bool:
    """Whether the process that is asked may run it."""
    try:
        check_allowed(name)
    except ConfigError:
        return False
    return True


def loaded_there(name: str) -> str:
    """The name of a player that the process that is asked has loaded."""
    return Stage("humanoid", 6.0, StartNoise()).load(name).name


#: ways to say a controller in a file: description → what is written there
NAMES: dict[str, Callable[[Ground], str]] = {
    "a file": lambda g: g.code,
    "a file, relative": lambda g: f"{g.module}.py:Trap",
    "a file, roundabout": lambda g: f"./{g.module}_package/../{g.module}.py:Trap",
    "a file, by a link": lambda g: "link.py:Trap",
    "a module": lambda g: f"{g.module}:Trap",
    "a module of a package": lambda g: f"{g.module}_package.inner:Trap",
    "YAML": lambda g: g.yaml("own.yaml", kind="outside", name=g.code),
    "YAML on YAML": lambda g: g.yaml("top.yaml", base=NAMES["YAML"](g)),
    "YAML on YAML on YAML": lambda g: g.yaml("above.yaml", base=NAMES["YAML on YAML"](g)),
    "YAML with a hash": lambda g: g.yaml("own.yaml", kind="outside", name=g.code, source="0" * 64),
}
