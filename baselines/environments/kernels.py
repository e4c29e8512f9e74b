"""The kernels that an environment's step needs, as `compiled/warmup.py` compiles them."""

import numpy as np

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.ipm_step import energy_foothold
from poise.baselines.balance.stepping.planning.blocks import CaptureTick
from poise.baselines.balance.stepping.planning.swing import time_left
from poise.baselines.balance.stepping.tick import capture_tick
from poise.baselines.controller import Targets
from poise.baselines.walking.tick import walk_tick
from poise.baselines.walking.walk import Walk
from poise.baselines.whole_body.momentum_qp import (
    MomentumQP,
    MomentumQPConfig,
    Tick,
    accept,
    momentum_tick,
    solve,
)
from poise.baselines.whole_body.tick import contact_tick
from poise.configs.schema import build
from poise.envs.balance.vector.scheduler import StepSchedule
from poise.envs.balance.vector.threads import ThreadTeam
from poise.envs.compiled.calls import NO_KERNEL, CompiledStep, Program, address_of, run
from poise.envs.physics.kinematics import allocate_state
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import load_robot

from .hand_over import whole_tick
from .policy_step import policy_tick
from .residual import ResidualBalanceEnv
from .stepping import ResidualStepEnv
from .walking import ResidualWalkEnv
from .whole import ResidualWholeEnv


def _standing() -> tuple[MomentumQP, RobotState, Targets]:
    """The baseline, in a state that is all zeros."""
    robot = load_robot("humanoid")
    qp = MomentumQP(robot)
    model = robot.model
    state = RobotState(qp.arrays, allocate_state(model.nv, len(robot.soles), model.nbody))
    return qp, state, Targets.standing(robot, state)


def assembly() -> None:
    """The momentum QP's problem."""
    qp, state, targets = _standing()
    qp.problem(state, targets)


#: one of each packaged kind, on bodies that the humanoid has
EXAMPLES = {
    "tasks": {
        "trunk": {"kind": "orientation", "body": "torso"},
        "hand": {"kind": "position", "body": "left_lower_arm"},
    },
    "contacts": {"hand": {"kind": "point", "body": "left_lower_arm", "normal": [0.0, 0.0, 1.0]}},
    "limits": {"speed": {"kind": "joint-speed", "largest": 5.0}, "torque": {"kind": "torque"}},
}


def rows() -> None:
    """The rows of tasks, of contacts other than the feet and of limits."""
    config = build(MomentumQPConfig, EXAMPLES, "the packaged kinds")
    qp = MomentumQP(load_robot("humanoid"), config)
    env = ResidualBalanceEnv(controller=config, duration=0.1)
    env.reset(seed=0)
    qp.problem(env.simulation.state, env.targets)


def solver() -> None:
    """The active-set method."""
    qp, _, _ = _standing()
    solve(qp.workspace)


def steps() -> None:
    """Physics, state and episode, and the policy step from which everything is called."""
    env = ResidualBalanceEnv(duration=0.1)
    env.reset(seed=0, options={"push": {"impulse": 1.0, "start": 0.0}})
    env.set_action(np.zeros(len(env.action_names)))
    env.simulation.step(np.zeros(env.robot.model.nu))
    env.simulation.state.support_distance(np.zeros(2))
    tick = _tick(env)
    address_of(policy_tick, env.bind(tick, NO_KERNEL))
    address_of(momentum_tick, tick)
    problem = tick.problem
    accept(problem.state, problem.parameters, problem.workspace, tick.memory)
    nothing = Program.of(())
    CompiledStep(address_of(run, nothing), nothing).play()
    helpers = ThreadTeam()
    StepSchedule(np.zeros((2, 3), dtype=np.int64), 2).play_all(helpers)
    helpers.close()


def _tick(env: ResidualBalanceEnv) -> Tick:
    """The tick of the baseline in `env`, for its type: other processes compile its kernels."""
    qp = env.controller
    assert isinstance(qp, MomentumQP)  # by default
    problem = qp.assembly(env.simulation.state, env.targets)
    compensation = qp.compensation(env.simulation.state, env.targets)
    return Tick(problem, qp.memory, compensation, NO_KERNEL, NO_KERNEL)


def whole() -> None:
    """The policy step with servos that take over from the controller."""
    env = ResidualWholeEnv(duration=0.1)
    env.reset(seed=0)
    address_of(whole_tick, env.whole_step(env.bind(_tick(env), NO_KERNEL)))


def _stepping() -> tuple[ResidualStepEnv, CaptureTick]:
    """A stepping controller's environment, and its tick but for the kernels that it calls."""
    env = ResidualStepEnv(duration=0.1)
    env.reset(seed=0)
    controller = env.controller
    assert isinstance(controller, CaptureStep)  # by default
    return env, controller.blocks(env.simulation.state, env.targets)


def contacts() -> None:
    """The momentum QP with contacts that change. What a reset needs, `planner` compiles as well."""
    address_of(contact_tick, _stepping()[1].on_both)


def planner() -> None:
    """Compile the step planner, the swing, and their observation terms."""
    env, tick = _stepping()
    address_of(capture_tick, tick)
    address_of(energy_foothold, tick.search)
    time_left(tick.swing)
    env.bind(tick, NO_KERNEL)


def walking() -> None:
    """The gait of a controller that walks."""
    env = ResidualWalkEnv(duration=0.1)
    env.reset(seed=0)
    walk = env.controller
    assert isinstance(walk, Walk)
    tick = walk.around(walk.blocks(env.simulation.state, env.targets))
    address_of(walk_tick, tick)
    env.bind(tick, NO_KERNEL)


def sensing() -> None:
    """Compile sensors, motors and estimators of realism levels."""
    ResidualBalanceEnv(realism="lab", duration=0.1).reset(seed=0)
