"""The joints of a robot that a policy moves, and the gains of all joints."""

from dataclasses import dataclass

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.description import match_names
from poise.envs.robots.mirror import mirror_robot
from poise.envs.robots.robot import Robot

from .config import Held, PerJoint, PolicyFileConfig

OUTSIDE = 1.0  # [rad] from a joint's range: none of the known policies is near
IMAGE = np.array([1.0, 1.0, -1.0, -1.0])  # of θ, ω_y, φ, ω_x when left and right are exchanged


@dataclass(frozen=True, eq=False)
class JointServos:
    """PD control of all joints of a robot (nj), of which n are the policy's and it moves na."""

    index: np.ndarray  # (n,) int: the robot's joint of each of the policy's
    moved: np.ndarray  # (na,) int: the robot's joint that each action moves
    default: np.ndarray  # (n,) [rad]
    offset: np.ndarray  # (na,) target of action zero [rad]
    scale: np.ndarray  # (na,) [rad]
    clip: np.ndarray  # (na, 2)
    stiffness: np.ndarray  # (nj,) [N·m/rad]
    damping: np.ndarray  # (nj,) [N·m·s/rad]
    target: np.ndarray  # (nj,) before the first action [rad]
    law: np.ndarray  # (na, 4) of `attitude`

    def targets(self, action: np.ndarray, attitude: np.ndarray) -> np.ndarray:
        """(na,) targets [rad] of an action, at `attitude` (4,): θ, ω_y, φ, ω_x."""
        asked = self.scale * np.clip(action, self.clip[:, 0], self.clip[:, 1])
        return self.offset + asked + self.law @ attitude


def joint_servos(robot: Robot, config: PolicyFileConfig) -> JointServos:
    """The joints of `config` on `robot`. Others hold the standing posture, or what `held` says.

    These are held with K = ω² M_jj and D = 2 ω M_jj, M the inertia of the standing robot and ω
    `hold`, unless `held` says otherwise.

    Raises ConfigError for joints that the robot lacks, and lists of other sizes.
    """
    index = _index(robot, config)
    n, names = len(index), [robot.joint_names[i] for i in index]
    places = list(config.action_joints or range(n))
    if max(places, default=0) >= n or len(set(places)) < len(places):
        raise _wrong(config, "action_joints", f"must be different places in {n} joints")
    default = _spread(config.default, names, "default", config)
    _check_posture(default, index, robot, config)
    na, moved, offset = len(places), index[places], default[places]
    if config.action_offset is not None:
        offset = _spread(config.action_offset, [names[i] for i in places], "action_offset", config)
    bounds = np.tile([-np.inf, np.inf], (na, 1))
    if config.action_clip:
        if len(config.action_clip) not in (1, na):
            raise _wrong(config, "action_clip", f"has {len(config.action_clip)} pairs for {na}")
        bounds = np.broadcast_to(np.array(config.action_clip), (na, 2))
    inertia = np.diag(Simulation(robot).state.M)[6:]
    stiffness, damping = config.hold**2 * inertia, 2.0 * config.hold * inertia
    stiffness[index] = _spread(config.stiffness, names, "stiffness", config)
    damping[index] = _spread(config.damping, names, "damping", config)
    target = robot.standing_qpos[7:].copy()
    target[index] = default
    target[moved] = offset
    servos = JointServos(
        index, moved, default, offset,
        _spread(config.action_scale, names[:na], "action_scale", config), bounds, stiffness,
        damping, target, np.zeros((na, 4)),
    )  # fmt: skip
    _hold(servos, robot, config)
    _obey(servos, robot, config)
    return servos


def _check_posture(
    default: np.ndarray, index: np.ndarray, robot: Robot, config: PolicyFileConfig
) -> None:
    """Raise ConfigError for a default position far outside of its joint's range."""
    low, high = robot.joint_range[index].T
    outside = np.maximum(low - default, default - high)
    if np.any(outside > OUTSIDE):
        worst = int(np.argmax(outside))
        raise _wrong(config, "default", f"{default[worst]:g} rad is far outside of the range of "
                     f"{robot.joint_names[index[worst]]}, {low[worst]:.2f} to {high[worst]:.2f} "
                     "rad: degrees, or another order of joints")  # fmt: skip


def _obey(servos: JointServos, robot: Robot, config: PolicyFileConfig) -> None:
    """Take what `law` says of the joints that the action moves."""
    if not config.law:
        return
    moved = [int(joint) for joint in servos.moved]
    names = [robot.joint_names[joint] for joint in moved]
    left = Simulation(robot).data.xanchor[1:, 1] > -1e-6  # or in the middle, standing
    for name, law in match_names(config.law, names, config.described_in, "law").items():
        i = names.index(name)
        joint = moved[i]
        servos.scale[i] *= law.action
        servos.stiffness[joint] *= law.stiffness
        servos.damping[joint] *= law.damping
        servos.law[i] = law.pitch, law.pitch_rate, law.roll, law.roll_rate
    if np.any(servos.law):
        sign, right = mirror_robot(robot)["joints"].sign[moved], ~left[moved]
        servos.law[right] *= sign[right, None] * IMAGE


def _hold(servos: JointServos, robot: Robot, config: PolicyFileConfig) -> None:
    """Hold the joints that the action does not move where `held` says, with its gains."""
    if config.held is None:
        return
    still = [i for i in range(len(robot.joint_names)) if i not in servos.moved]
    if isinstance(config.held, tuple):
        if len(config.held) != len(servos.index):
            raise _wrong(config, "held", f"has {len(config.held)} numbers for "
                         f"{len(servos.index)} joints")  # fmt: skip
        pairs = zip(servos.index, config.held, strict=True)
        said: dict[int, float | Held] = {int(i): q for i, q in pairs if i in still}
    else:
        names = [robot.joint_names[i] for i in still]
        found = match_names(config.held, names, config.described_in, "held")
        said = {still[names.index(name)]: held for name, held in found.items()}
    for i, each in said.items():
        held = each if isinstance(each, Held) else Held(each)
        for array, value in ((servos.target, held.position), (servos.stiffness, held.stiffness),
                             (servos.damping, held.damping)):  # fmt: skip
            if value is not None:
                array[i] = value


def _index(robot: Robot, config: PolicyFileConfig) -> np.ndarray:
    """(n,) the robot's joint of each of the policy's."""
    names = list(robot.joint_names)
    if config.joints:
        lost = [name for name in config.joints if name not in names]
        if lost:
            raise _wrong(config, "joints", f"{robot.name!r} lacks {', '.join(lost)}", names)
        found = [names.index(name) for name in config.joints]
    else:
        found = list(config.motors or range(_count(config) or len(names)))
        if max(found, default=0) >= len(names):
            raise _wrong(config, "motors", f"number {max(found)} of the policy's is beyond the "
                         f"{len(names)} joints of {robot.name!r}")  # fmt: skip
    if len(set(found)) < len(found):
        raise _wrong(config, "joints" if config.joints else "motors", "must be different")
    return np.array(found, dtype=np.int64)


def _count(config: PolicyFileConfig) -> int:
    """Joints of a policy that names none: as many as a list has numbers; 0 without a list."""
    lists = (config.default, config.stiffness, config.damping, config.action_scale)
    return max(len(values) for values in (*lists, ()) if isinstance(values, tuple))


def _spread(values: PerJoint, names: list[str], field: str, config: PolicyFileConfig) -> np.ndarray:
    """A number for each name."""
    if isinstance(values, dict):
        found = match_names(values, names, config.described_in, field)
        lost = [name for name in names if name not in found]
        if lost:
            raise _wrong(config, field, f"has nothing for {', '.join(lost)}")
        return np.array([found[name] for name in names], dtype=float)
    array = np.atleast_1d(np.asarray(values, dtype=float))
    if len(array) not in (1, len(names)) or (isinstance(values, tuple) and len(array) == 0):
        raise _wrong(config, field, f"has {len(array)} numbers for {len(names)} joints")
    return np.broadcast_to(array, len(names)).copy()


def _wrong(
    config: PolicyFileConfig, field: str, problem: str, choices: list[str] | None = None
) -> ConfigError:
    return ConfigError(problem, source=config.described_in, field=field, choices=choices)
