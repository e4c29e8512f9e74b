"""baselines/controller.py: what environments ask of a controller, and what it is by default."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poise
from poise.baselines import (
    BaseController,
    CompiledController,
    Controller,
    MomentumQP,
    ResidualBalanceEnv,
    ResidualStepEnv,
    SteppingController,
    Targets,
    load_controller,
)
from poise.baselines.controller import WrappedController, as_base_controller
from poise.baselines.registry import kind_classes
from poise.configs.files import packaged
from poise.envs import RobotState, Simulation, replicate
from tests.support.refused import invalid
from tests.support.shared import robot

FOLDERS = (
    "baselines/environments",
    "training/benchmarking/trials",
    "training/benchmarking/evaluation",
)


class Plain:
    """Has the three that a controller needs, and nothing else."""

    period = 0.004

    def reset(self, state: RobotState) -> None:
        """Nothing is remembered."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        return np.zeros(21)


class Telling(BaseController):
    """Tells of itself, and derives from nothing compiled."""

    def __init__(self) -> None:
        self.robot, self.period, self.com_offset = robot(), 0.004, 0.01

    @property
    def failures(self) -> int:
        return 7

    @property
    def root_wrench(self) -> np.ndarray:
        return np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        return np.zeros(21)


class Changed(MomentumQP):
    """Its torques are not those of the tick that it inherits."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        targets.com[0] += 0.01
        return super().torques(state, targets)


class Renamed(MomentumQP):
    """A momentum QP, tick and all."""


class Lagging(MomentumQP):
    """Made from more than a robot and a configuration."""

    def __init__(self, robot: Any, config: Any = None, lag: float = 0.1):
        super().__init__(robot, config)
        self.lag = lag


def env_of(controller: Any, **arguments: Any) -> ResidualBalanceEnv:
    return ResidualBalanceEnv(robot(), controller=controller, pushes=None, **arguments)


@pytest.mark.parametrize("name", packaged("controllers"))
def test_packaged_controllers_declare_what_is_asked(name: str) -> None:
    controller = load_controller(name, robot())
    assert isinstance(controller, BaseController) and isinstance(controller, Controller)
    assert controller.unwrapped is controller and controller.failures == 0
    assert controller.root_wrench.shape == (6,) and not controller.root_wrench.any()
    assert controller.robot is robot()
    assert type(controller.config) is kind_classes(controller.config.kind)[0]
    other = controller.another()
    assert type(other) is type(controller) and other is not controller
    assert other.config == controller.config


def test_three_members_are_enough() -> None:
    """Outside of any base class the rest has its default; two are too few."""
    given = Plain()
    told = as_base_controller(given, robot())
    assert (told.failures, told.com_offset, told.robot) == (0, 0.0, robot())
    assert told.unwrapped is given and not told.root_wrench.any()
    env = env_of(given)
    env.reset(seed=0)
    info = env.step(np.zeros(4))[4]
    assert env.controller is given
    assert info["solver_failures"] == 0 and not info["root_wrench"].any()
    with pytest.raises(poise.ConfigError, match="must be a name.*or a controller"):
        env_of(type("Two", (), {"period": 0.004, "reset": None})())


def test_what_a_controller_tells_reaches_the_environment() -> None:
    """From the base class, also through a wrapper."""
    for controller in (Telling(), WrappedController(Telling(), robot())):
        env = env_of(controller)
        env.reset(seed=0, options={"noise": 0.0})
        reference = env_of(Plain())
        reference.reset(seed=0, options={"noise": 0.0})
        assert np.linalg.norm(env.targets.com - reference.targets.com) == pytest.approx(0.01)
        info = env.step(np.zeros(4))[4]
        assert info["solver_failures"] == 7 and info["root_wrench"][2] == 1.0


def test_a_subclass_runs_compiled_unless_its_torques_are_its_own() -> None:
    """The compiled tick would not know of them."""
    assert Renamed(robot()).compiled and MomentumQP(robot()).compiled
    assert not Changed(robot()).compiled and isinstance(Changed(robot()), CompiledController)
    expected, found = env_of(Renamed(robot())), env_of(Changed(robot()))
    assert expected.compiled_step() is not None and found.compiled_step() is None
    ends = []
    for env in (env_of(MomentumQP(robot())), expected, found):
        env.reset(seed=3)
        for _ in range(10):
            env.step(np.zeros(4))
        ends.append(env.data.qpos.copy())
    assert np.array_equal(ends[0], ends[1]) and not np.array_equal(ends[0], ends[2])


def test_another_solver_is_called_from_python() -> None:
    """By the momentum QP; controllers that step refuse it."""
    controller = load_controller({"solver": "daqp"}, robot())
    assert isinstance(controller, CompiledController) and not controller.compiled
    with invalid("qp.solver", "'active-set'"):
        load_controller({"kind": "capture-step", "qp": {"solver": "daqp"}}, robot())


def test_an_environment_is_replicated_with_a_controller_of_the_same_class() -> None:
    """A subclass stays one; what is made from more than robot and configuration is refused."""
    envs = replicate(env_of(Renamed(robot())), 2)
    assert type(envs[1].controller) is Renamed and envs[1].controller is not envs[0].controller
    for controller in (Lagging(robot()), Plain(), WrappedController(MomentumQP(robot()), robot())):
        with invalid("controller"):
            replicate(env_of(controller), 2)


def test_steps_are_moved_through_a_wrapper() -> None:
    """It is not compiled, and the shift is that of the controller inside."""
    inner = load_controller("capture-step", robot())
    assert isinstance(inner, SteppingController)
    assert inner.step_limits == inner.config.limits
    ends = []
    for controller in (inner, WrappedController(load_controller("capture-step", robot()), robot())):
        env = ResidualStepEnv(robot(), controller=controller, pushes=None)
        push = {"impulse": 22.0, "direction": 0.0, "body": "torso", "start": 0.1}
        env.reset(seed=0, options={"push": push})
        action = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
        for _ in range(40):
            info = env.step(action)[4]
        ends.append((env.data.qpos.copy(), info["steps"], env.stepper.offsets.foothold[0]))
    assert ends[0][1] == ends[1][1] >= 1 and ends[0][2] == ends[1][2] > 0.0
    assert np.array_equal(ends[0][0], ends[1][0])
    with invalid("controller"):
        ResidualStepEnv(robot(), controller=WrappedController(MomentumQP(robot()), robot()))


def test_a_base_class_alone_controls_nothing() -> None:
    state = Simulation(robot()).state
    with pytest.raises(NotImplementedError):
        BaseController().torques(state, Targets.standing(robot(), state))


def test_nobody_asks_a_controller_for_what_it_does_not_declare() -> None:
    """No `getattr` with a default and no `hasattr` of a controller in what plays one."""
    root = Path(__file__).parents[2]
    probes = {
        f"{path.name}: {ast.unparse(node)}"
        for folder in FOLDERS
        for path in (root / folder).glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("getattr", "hasattr")
        and "controller" in ast.unparse(node)
    }
    assert probes == set()
