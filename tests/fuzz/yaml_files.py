"""YAML of all kinds: the packaged files, changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.environments.guard.config import guard_config
from poise.baselines.registry import load_controller
from poise.configs.files import packaged_folder
from poise.configs.schema import to_yaml
from poise.envs.balance.config import EnvConfig, env_config
from poise.envs.robots.robot import load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.learning.config import train_config
from poise.training.learning.tuning.gains import Gains
from poise.training.learning.tuning.search import tune_config
from tests.support.shared import robot

from .texts import Draw, changed
from .values import Json, decode, packed


def _suite(path: Path) -> None:
    suite = load_suite(path).resized(2)
    grid = suite.grid
    if grid is None or grid.directions * len(grid.magnitudes) <= 100:
        if suite.envelope is None or suite.envelope.directions <= 100:
            TrialPlan(suite, load_limits(robot()), 0, ["zero"])


def _tuning(path: Path) -> None:
    config = tune_config(path)
    Gains(config.controller, config.gains, config.robot)


LOADERS: dict[str, Callable[[Path], Any]] = {
    "robots": load_robot,
    "controllers": lambda path: load_controller(path, robot()),
    "rivals": lambda path: load_controller(path, robot()),
    "guards": guard_config,
    "policies": lambda path: train_config(path).make_env(robot()),
    "training": lambda path: train_config(path).make_env(robot()),
    "suites": _suite,
    "motions": lambda path: load_motion(path, robot()),
    "tuning": _tuning,
    "limits": lambda path: load_limits(robot(), path),
    "envs": env_config,
    "realism": load_realism,
}


HEAVY = ("apptronik_apollo.yaml",)  # one of its meshes takes MuJoCo 1.4 GiB, whatever the file says


def contents(kind: str) -> list[bytes]:
    """The packaged files of a kind."""
    if kind == "envs":  # of which none is packaged
        return [to_yaml(EnvConfig()).encode()]
    folder = packaged_folder(kind)
    found = sorted([*folder.glob("*.yaml"), *folder.glob("*/config.yaml")])
    return [path.read_bytes() for path in found if path.name not in HEAVY]


@st.composite
def cases(draw: Draw) -> Json:
    """A kind of configuration and the file."""
    kind = draw(st.sampled_from(sorted(LOADERS)))
    return {"of": kind, "file": packed(changed(draw, draw(st.sampled_from(contents(kind)))))}


def play(case: Json, folder: Path) -> None:
    """Load it."""
    path = folder / "case.yaml"
    path.write_bytes(decode(case["file"]))
    LOADERS[case["of"]](path)
