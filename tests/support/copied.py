"""What tests/envs/compiled/test_copies.py copies, each in the midst of an episode, and how it goes
on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.registry import load_controller
from poise.configs.files import packaged
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import EnvBatch, replicate
from poise.envs.balance.vector.vector_env import BalanceVectorEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState
from poise.envs.sensing.estimator import EstimatedState
from tests.support.limits import described as limits_described
from tests.support.sensing import estimated
from tests.support.shared import robot
from tests.support.tasks import described

PUSH = {"impulse": 14.0, "direction": 60.0, "duration": 0.2, "start": 0.04}  # still acts at BEFORE
PUSHES = {"magnitude": [0.1, 0.5], "unit": "specific_impulse", "start": [0.0, 0.1]}
BEFORE, AFTER = 6, 20  # policy steps until the copy, and from then on
KEEPS_TO_ITSELF = ("lip-mpc", "momentum-qp-osqp")  # controllers with a solver of another library


def _drive(env: Any, steps: int, seed: int) -> list[Any]:
    """Random actions, as long as the episode goes on; what `step` says."""
    rng, seen, bare = np.random.default_rng(seed), [], env.unwrapped
    for _ in range(steps):
        if not bare.episode.running:
            break
        action = 0.3 * rng.uniform(-1.0, 1.0, env.action_space.shape)
        seen += list(env.step(action.astype(np.float32)))
    return [*seen, bare.simulation.data.qpos.copy(), bare.simulation.time]


#: servos take over in the first step
AT_ONCE = {"opens": 1e-3, "closes": 1e-4}


def _begin(env: Any) -> Any:
    env.reset(seed=1, options={"push": PUSH})
    _drive(env, BEFORE, 7)
    return env


def play_env(env: Any) -> list[Any]:
    """The rest of the episode, then the next one, which the generator draws."""
    return [_drive(env, AFTER, 8), env.reset(), _drive(env, 3, 9)]


def _begin_many(many: Any, reset: Callable[[], Any]) -> Any:
    reset()
    _drive_many(many, BEFORE, 7)
    return many


def _drive_many(many: Any, steps: int, seed: int) -> list[Any]:
    rng, seen = np.random.default_rng(seed), []
    envs = (many if isinstance(many, EnvBatch) else many.batch).envs
    for _ in range(steps):
        actions = 0.3 * rng.uniform(-1.0, 1.0, (len(envs), *envs[0].action_space.shape))
        seen.append(many.step(actions.astype(np.float32)))
    return [seen, [env.simulation.data.qpos.copy() for env in envs]]


def play_many(many: Any) -> list[Any]:
    """Further steps of all; episodes of 0.3 s end and begin among them."""
    return _drive_many(many, AFTER, 8)


def play_simulation(simulation: Any) -> list[Any]:
    """Torques for a while."""
    rng = np.random.default_rng(8)
    for _ in range(AFTER):
        simulation.step(rng.uniform(-0.2, 0.2, robot().model.nu) * robot().torque_limit, 5)
    return [simulation.data.qpos.copy(), simulation.time, *play_state(simulation.state)]


def play_source(source: Any) -> list[Any]:
    """Torques for a while, and what is believed then."""
    seen = play_simulation(source.simulation)
    source.update()
    return [*seen, *play_state(source.state)]


def play_state(state: Any) -> list[Any]:
    """All that it says."""
    return [*(array.copy() for array in state.arrays.members()), state.support_polygon, state.time]


def play_robot(body: Any) -> list[Any]:
    """A simulation of it."""
    return [play_simulation(Simulation(body)), body.fingerprint, body.standing_qpos.flags.writeable]


def play_policy(policy: Any) -> list[Any]:
    """Its actions."""
    observations = np.random.default_rng(8).normal(size=(5, policy.layers[0][0].shape[0]))
    return [policy.act(observations), policy.content()]


def play_loop(loop: Any) -> list[Any]:
    """A controller that is called from outside of environments."""
    simulation, controller, targets = loop["simulation"], loop["controller"], loop["targets"]
    torques = []
    for _ in range(AFTER):
        torques.append(controller.torques(simulation.state, targets).copy())
        simulation.step(torques[-1], round(controller.period / robot().model.opt.timestep))
    return [torques, simulation.data.qpos.copy()]


def make_loop(name: Any) -> dict[str, Any]:
    """Some ticks after the start."""
    simulation = Simulation(robot())
    state = simulation.reset(pushes=())
    loop = {
        "simulation": simulation,
        "controller": load_controller(name, robot()),
        "targets": Targets.standing(robot(), state),
    }
    loop["controller"].reset(state)
    play_loop(loop)
    return loop


def env_of(kind: type[BalanceEnv], **arguments: Any) -> BalanceEnv:
    """An environment of the tests' robot."""
    return kind(robot(), pushes=PUSHES, **arguments)


def _several(kind: type[BalanceEnv], **arguments: Any) -> list[BalanceEnv]:
    return replicate(env_of(kind, duration=0.3, **arguments), 3)


def _vector(kind: type[BalanceEnv]) -> Any:
    many = BalanceVectorEnv(_several(kind), 2)
    return _begin_many(many, lambda: many.reset(seed=3))


def _threaded() -> Any:
    from poise.training.learning.vec_env import ThreadedVecEnv  # it loads torch

    many = ThreadedVecEnv(_several(ResidualBalanceEnv), 2)
    many.seed(3)
    return _begin_many(many, many.reset)


def _policy() -> Any:
    from poise.training.learning.policy import load_policy  # it loads torch

    return load_policy()


def _batch() -> Any:
    many = EnvBatch(_several(ResidualStepEnv, smoothing=0.05), 2)
    return _begin_many(many, lambda: many.reset(list(range(3))))


def _wrapped() -> Any:
    env = env_of(ResidualBalanceEnv)
    return _begin(gymnasium.wrappers.TimeLimit(gymnasium.wrappers.OrderEnforcing(env), 500))


def _state() -> RobotState:
    return _begin(env_of(TorqueBalanceEnv)).simulation.state


def _source() -> EstimatedState:
    source = estimated("field")
    play_source(source)
    return source


def _running() -> Simulation:
    env = _begin(env_of(TorqueBalanceEnv))
    return env.simulation


#: name → what makes one in the midst of its work, what goes on with it
KINDS: dict[str, tuple[Callable[[], Any], Callable[[Any], list[Any]]]] = {
    "torque": (lambda: _begin(env_of(TorqueBalanceEnv)), play_env),
    "residual": (lambda: _begin(env_of(ResidualBalanceEnv, smoothing=0.1, gate=0.02)), play_env),
    "step": (lambda: _begin(env_of(ResidualStepEnv, smoothing=0.1)), play_env),
    "whole": (lambda: _begin(env_of(ResidualWholeEnv, hand_over=AT_ONCE)), play_env),
    "position": (lambda: _begin(env_of(PositionBalanceEnv)), play_env),
    "velocity": (lambda: _begin(env_of(VelocityEnv)), play_env),
    "real torque": (lambda: _begin(env_of(TorqueBalanceEnv, realism="field")), play_env),
    "real residual": (lambda: _begin(env_of(ResidualBalanceEnv, realism="field")), play_env),
    "real step": (lambda: _begin(env_of(ResidualStepEnv, realism="field")), play_env),
    "wrapped": (_wrapped, play_env),
    "one of many": (lambda: _vector(ResidualBalanceEnv).envs[2], play_env),
    "vector": (lambda: _vector(ResidualBalanceEnv), play_many),
    "vector of torque": (lambda: _vector(TorqueBalanceEnv), play_many),
    "SB3": (_threaded, play_many),
    "batch": (_batch, play_many),
    "simulation": (_running, play_simulation),
    "state source": (_source, play_source),
    "robot": (robot, play_robot),
    "state": (_state, play_state),
    "policy": (_policy, play_policy),
}


def _with(name: Any) -> tuple[Callable[[], Any], Callable[[Any], list[Any]]]:
    return lambda: _begin(env_of(ResidualBalanceEnv, controller=name)), play_env


for _name in packaged("controllers"):
    if _name not in KEEPS_TO_ITSELF:
        KINDS[f"env of {_name}"] = _with(_name)
for _name in ("momentum-qp", "capture-step", "feedback-step", "ipm-step", "kudoh02", "lqr-lip"):
    KINDS[_name] = partial(make_loop, _name), play_loop
_HAND = {"kind": "point", "body": "left_lower_arm", "normal": [0, 0, 1], "largest_force": 0.01}
_ROWS = {"tasks": described(), "contacts": {"hand": _HAND}, "limits": limits_described()}
_TASKS = {"base": "momentum-qp", **_ROWS}
KINDS["env of tasks"], KINDS["tasks"] = _with(_TASKS), (partial(make_loop, _TASKS), play_loop)


def digest(seen: Any) -> str:
    """Of all numbers in it, to the last bit."""
    found = hashlib.sha256()
    _feed(found, seen)
    return found.hexdigest()


def _feed(found: Any, seen: Any) -> None:
    if isinstance(seen, dict):
        seen = list(seen.items())
    if isinstance(seen, np.ndarray) and not seen.dtype.hasobject:
        found.update(repr((seen.shape, seen.dtype.str)).encode() + seen.tobytes())
    elif isinstance(seen, (list, tuple, np.ndarray)):
        for each in seen:
            _feed(found, each)
    else:
        found.update(repr(seen).encode())


def outcome(name: str, it: Any) -> str:
    """How `it` goes on, or what it raises."""
    try:
        return digest(KINDS[name][1](it))
    except Exception as error:
        return repr(error)
