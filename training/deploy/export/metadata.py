"""What an exported file says of the policy: whose it is, what it observes, what its actions do.

Words are mjlab's where it has one, see `policy_files/onnx/metadata.py`: lists have commas between
them.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

import poise
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.walking.calibration import Calibration
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.observation import Scales, Term
from poise.envs.balance.position import PositionBalanceEnv
from poise.training.learning.policy import Policy

IDS = {
    "residual": "poise/ResidualBalance-v0",
    "step": "poise/ResidualStep-v0",
    "walk": "poise/ResidualWalk-v0",
    "whole": "poise/ResidualWhole-v0",
    "torque": "poise/TorqueBalance-v0",
    "position": "poise/PositionBalance-v0",
    "velocity": "poise/Velocity-v0",
}
UNITS = {  # of what an entry of the action moves
    **{"com": "m", "cop": "m", "lean": "rad", "momentum": "m h² ω"},
    **{"foothold": "m", "time": "s", "trigger": "m"},
}


@dataclass(frozen=True)
class Action:
    """An entry of the action: what 1 adds, and its unit."""

    name: str
    scale: float
    unit: str


def actions(env: BalanceEnv) -> list[Action]:
    """Return the entries of the environment's action, in order."""
    limits = np.array(env.robot.torque_limit)
    if isinstance(env, PositionBalanceEnv):
        return _motors(env, env.servos.reach, "rad")
    if not isinstance(env, ResidualBalanceEnv):
        return _motors(env, limits, "N·m")
    residual = [
        Action(name, scale, UNITS[name.rsplit("_", 1)[0]])
        for name, scale in env.residual.entries().items()
        if scale > 0.0
    ]
    if isinstance(env, ResidualWholeEnv):
        authority = Action("authority", 2.0, "1, within 0 and 1")
        return [*residual, *_motors(env, env.servos.reach, "rad"), authority]
    added = env.residual.torque
    return [*residual, *(_motors(env, added * limits, "N·m") if added > 0.0 else [])]


def _motors(env: BalanceEnv, scales: np.ndarray, unit: str) -> list[Action]:
    names = env.robot.motor_names
    return [Action(name, float(scale), unit) for name, scale in zip(names, scales, strict=True)]


def metadata(policy: Policy, env: BalanceEnv) -> dict[str, str]:
    """Return the metadata of a policy that acts in `env`, as texts.

    `observation_names` are terms; each has as many numbers as `observation_sizes` says, in the unit
    of `observation_units`, whose ω, h, m and g are in `units` (JSON, SI), and as a number
    `observation_terms_scale`, by which SI is multiplied (``x;y`` where it is not the same for all).
    `action_scale` is what an
    action of 1 adds, in the unit of `action_units`. `joint_names` are the motors' joints,
    `default_joint_pos` [rad] is where they stand. A policy with servos has `joint_stiffness`
    [N·m/rad], `joint_damping` [N·m·s/rad], and `joint_hold` [rad], the target at an action of 0.
    `command_calibration` (JSON) is a `Calibration`, through which a command goes before it is
    observed. `observation_history_stride` is there for a policy that runs more often than it was
    trained to: `control_period`s from frame to frame, see `poise.envs.balance.mdp.interleaving`.
    """
    robot, config, made = env.robot, policy.config, actions(env)
    dofs = np.asarray(robot.motor_dofs)
    said: dict[str, str] = {
        "joint_names": _list(robot.joint_names[dof - 6] for dof in dofs),
        "default_joint_pos": _list(robot.standing_qpos[dofs + 1]),
        "observation_names": _list(term.name for term in env.terms),
        "observation_sizes": _list(term.size for term in env.terms),
        "observation_units": _list(term.unit for term in env.terms),
        "observation_terms_scale": _list(scale_of(term, env.scales) for term in env.terms),
        "action_names": _list(action.name for action in made),
        "action_scale": _list(action.scale for action in made),
        "action_units": _list(action.unit.replace(",", ";") for action in made),
        "units": json.dumps(units(env)),
        "environment": IDS[config.action],
        "control_period": repr(env.config.policy_period),
        "robot": robot.name,
        "robot_fingerprint": robot.fingerprint,
        "timesteps": str(policy.state["timesteps"]),
        "poise_version": poise.__version__,
    }
    if (stride := env.config.observation.history_stride) > 1:
        said["observation_history_stride"] = str(stride)
    if isinstance(env, ResidualBalanceEnv):
        said |= {
            "controller": config.controller,
            "controller_fingerprint": str(policy.state.get("controller_fingerprint", "")),
            "controller_period": repr(env.controller.period),
            "smoothing": repr(env.smoothing),
            "gate": repr(env.gate),
        }
    if isinstance(env, (ResidualWholeEnv, PositionBalanceEnv)):
        servos = env.servos
        said |= {
            "joint_stiffness": _list(servos.stiffness),
            "joint_damping": _list(servos.damping),
            "joint_hold": _list(servos.hold),
        }
    if isinstance(env, VelocityEnv) and env.calibration != Calibration():
        said["command_calibration"] = json.dumps(asdict(env.calibration))
    return said


def units(env: BalanceEnv) -> dict[str, float]:
    """Return the robot's numbers that the units of observations and actions are made of [SI]."""
    scales = asdict(env.scales)
    half = {"half_support_x": scales["support_x"], "half_support_y": scales["support_y"]}
    body = {"h": scales["height"], "omega": scales["omega"]}
    return {**body, "m": env.robot.mass, "g": env.robot.units.gravity, **half}


def scale_of(term: Term, scales: Scales) -> str:
    """Return 1 over the unit of a term [1/SI]."""
    h, omega = scales.height, scales.omega
    values = {
        "1": 1.0,
        "rad": 1.0,
        "half support": scales.support_x,
        "0.1 h": 0.1 * h,
        "0.5 h": 0.5 * h,
        "0.2 ω h": scales.velocity,
        "0.1 m h² ω": scales.momentum,
        "m g": scales.weight,
        "0.1 m g": 0.1 * scales.weight,
        "0.02 m g": 0.02 * scales.weight,
        "ω": omega,
        "0.2 ω": 0.2 * omega,
        "3 ω": 3.0 * omega,
        "1/ω": 1.0 / omega,
    }
    value = repr(1.0 / values[term.unit])
    return f"{value};{1.0 / scales.support_y!r}" if term.unit == "half support" else value


def _list(values: Iterable[object]) -> str:
    """Return values with commas between them; numbers with all their digits."""
    return ",".join(
        repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)
        for value in values
    )
