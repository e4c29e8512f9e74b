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
from poise.training.benchmarking.evaluation.folder import Settings
from poise.training.benchmarking.metrics.entry import controller_entry, robot_figures
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.jobs import TrialStage
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.table import COLUMNS, trial_row
from poise.training.benchmarking.trials.trial import failed_trial
from poise.training.running.files import csv_text, plain
from poise.training.running.provenance import circumstances, versions
from poise.training.running.summary import FORMAT, Summary
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
        return self._result("evaluation", "quiet", controller)

    def benchmark(self, controller: str) -> Path:
        """A benchmark of the suite in `suite()` with one finished trial."""
        return self._result("benchmark", self.suite(), controller)

    def _result(self, name: str, suite_name: str, controller: str) -> Path:
        out, suite = self.here / name, load_suite(suite_name)
        out.mkdir()
        limits = PushLimits(robot())
        settings = Settings(
            FORMAT, suite_name, to_dict(suite), "humanoid", robot().fingerprint, 0, None,
            versions(("mujoco", "numpy", "numba")), {controller: "0"},
        )  # fmt: skip
        plan = TrialPlan(suite, limits, 0, [controller])
        played = [(plan.first[0], failed_trial(ValueError()))]
        summary: Summary = {
            "format": FORMAT, "suite": suite_name, "seed": 0, "robot": robot_figures(limits),
            "rated": None, "scale": limits.scale, "reference": controller,
            "ranking": [controller], "controllers": {controller: controller_entry(played, plan)},
            "pairs": [], "step_limits": [], "seeds": [], **circumstances(0.0, 1, "local"),
        }  # fmt: skip
        line = trial_row(plan.first[0], controller, played[0][1])
        (out / "settings.yaml").write_text(to_yaml(settings))
        (out / "trials.csv").write_text(csv_text([line], COLUMNS))
        (out / "trials.jsonl").touch()
        (out / "summary.json").write_text(json.dumps(plain(summary)))
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
    """The name of an agent that the process that is asked has loaded."""
    return TrialStage("humanoid", 6.0, StartNoise()).load(name).name


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
