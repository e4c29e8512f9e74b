"""Configurations of other projects that say how a policy is deployed, as fields of Poise's own."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from poise.configs.errors import ConfigError
from poise.configs.schema import build

from .bounds import pair, pairs

ACTIONS = ("JointPositionAction", "joint_pos")
GYM_TERMS = ("base_ang_vel", "projected_gravity", "command", "dof_pos", "dof_vel", "actions")


@dataclass(frozen=True)
class LabAction:
    """An action of unitree_rl_lab: targets of joint positions [rad], scale · action + offset.

    Attributes:
        scale: a number, or one for each action [rad].
        offset: target of action zero [rad]; None: the default posture.
        clip: least and largest value of each action.
        joint_ids: places of the moved joints in the policy's order; None, as which a slice of all
            is read, stands for all.
    """

    scale: float | tuple[float, ...] = 1.0
    offset: float | tuple[float, ...] | None = None
    clip: tuple[tuple[float, float], ...] | None = None
    joint_ids: tuple[int, ...] | None = None


@dataclass(frozen=True)
class LabTerm:
    """A term of unitree_rl_lab's observation, see `ObservationTerm`."""

    params: dict[str, Any] = field(default_factory=dict)
    clip: tuple[float, float] | None = None
    scale: float | tuple[float, ...] | None = None
    history_length: int = field(default=1, metadata={"min": 0})


@dataclass(frozen=True)
class LabDeploy:
    """``deploy.yaml`` of unitree_rl_lab and unitree_rl_mjlab.

    `joint_ids_map` has the number of the motor of each joint of the policy; gains are in the order
    of motors, the posture in that of the policy.
    """

    joint_ids_map: tuple[int, ...] = field(metadata={"min": 0})
    step_dt: float
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    default_joint_pos: tuple[float, ...]
    actions: dict[str, Any]
    observations: dict[str, Any]


@dataclass(frozen=True)
class GymDeploy:
    """A configuration of unitree_rl_gym's deploy_mujoco; its command is left to Poise's."""

    kps: tuple[float, ...]
    kds: tuple[float, ...]
    default_angles: tuple[float, ...]
    ang_vel_scale: float
    dof_pos_scale: float
    dof_vel_scale: float
    action_scale: float
    cmd_scale: tuple[float, float, float]
    num_actions: int
    num_obs: int
    simulation_dt: float
    control_decimation: int
    policy_path: str = ""


T = TypeVar("T", LabAction, LabTerm, LabDeploy, GymDeploy)


def is_deploy(data: dict[str, object]) -> bool:
    """Return whether the content of a YAML file is a configuration of another project.

    Such a file has no `kind`, and either `joint_ids_map` or `num_obs`.
    """
    return "kind" not in data and ("joint_ids_map" in data or "num_obs" in data)


def deploy_fields(data: dict[str, object], source: Path) -> dict[str, object]:
    """Return fields of a `PolicyFileConfig` from such a file; other entries are ignored.

    Raises ConfigError for a missing field, a wrong type, and sizes that do not add up.
    """
    if "joint_ids_map" in data:
        return _lab_fields(_known(LabDeploy, data, source), source)
    if "num_obs" in data:
        return _gym_fields(_known(GymDeploy, data, source), source)
    raise ConfigError(
        "is no configuration of unitree_rl_lab or unitree_rl_mjlab (joint_ids_map), nor of "
        "unitree_rl_gym (num_obs)",
        source=source,
    )


def _known(kind: type[T], data: dict[str, object], source: Path, name: str = "") -> T:
    """The dataclass from what it has of the mapping."""
    known = {key: value for key, value in data.items() if key in kind.__dataclass_fields__}
    return build(kind, known, f"{source}: {name}" if name else source)


def _lab_fields(lab: LabDeploy, source: Path) -> dict[str, object]:
    motors = lab.joint_ids_map
    if not motors:
        raise ConfigError("names no motor: one for each joint of the policy is needed",
                          source=source, field="joint_ids_map")  # fmt: skip
    _check_size("default_joint_pos", lab.default_joint_pos, len(motors), source)
    for name in ("stiffness", "damping"):
        if len(getattr(lab, name)) <= max(motors):
            raise ConfigError(
                f"has {len(getattr(lab, name))} numbers, joint_ids_map goes up to {max(motors)}",
                source=source,
                field=name,
            )
    action = _lab_action(lab, source)
    terms, history, phase = _lab_terms(lab, source)
    return {
        "motors": motors,
        "default": lab.default_joint_pos,
        "stiffness": tuple(lab.stiffness[i] for i in motors),
        "damping": tuple(lab.damping[i] for i in motors),
        "action_joints": action.joint_ids or (),
        "action_scale": action.scale,
        "action_offset": action.offset,
        "action_clip": action.clip or (),
        "observations": terms,
        "history": history,
        "policy_period": lab.step_dt,
        **phase,
    }


def _lab_action(lab: LabDeploy, source: Path) -> LabAction:
    """The only action, of joint positions."""
    if len(lab.actions) != 1 or next(iter(lab.actions)) not in ACTIONS:
        raise ConfigError(f"must be one of joint positions, not {', '.join(lab.actions)}",
                          source=source, field="actions", choices=ACTIONS)  # fmt: skip
    name, described = next(iter(lab.actions.items()))
    said = _mapping(described, f"actions.{name}", source)
    said = {**said, "clip": pairs(said.get("clip"))}
    return _known(LabAction, said, source, name)


def _lab_terms(
    lab: LabDeploy, source: Path
) -> tuple[list[dict[str, object]], str, dict[str, float]]:
    """The terms, how their histories lie, and the clock's period where one of them shows it."""
    described = dict(lab.observations)
    history = "frame" if described.pop("use_gym_history", False) else "term"
    terms: list[dict[str, object]] = []
    phase: dict[str, float] = {}
    for name, entry in described.items():
        said = _mapping(entry, f"observations.{name}", source)
        term = _known(LabTerm, {**said, "clip": pair(said.get("clip"))}, source, name)
        terms.append({"term": name, "clip": term.clip, "history": max(1, term.history_length),
                      "scale": 1.0 if term.scale is None else term.scale})  # fmt: skip
        if "period" in term.params:
            phase = {"phase": term.params["period"]}
    return terms, history, phase


def _gym_fields(gym: GymDeploy, source: Path) -> dict[str, object]:
    n = gym.num_actions
    for name in ("kps", "kds", "default_angles"):
        _check_size(name, getattr(gym, name), n, source)
    scales = (gym.ang_vel_scale, 1.0, gym.cmd_scale, gym.dof_pos_scale, gym.dof_vel_scale, 1.0)
    terms = [{"term": t, "scale": s} for t, s in zip(GYM_TERMS, scales, strict=True)]
    if gym.num_obs not in (9 + 3 * n, 11 + 3 * n):
        raise ConfigError(
            f"{gym.num_obs} is neither 9 + 3 × {n} (num_actions) nor, with a phase, 2 more",
            source=source,
            field="num_obs",
        )
    if gym.num_obs == 11 + 3 * n:
        terms.append({"term": "phase", "scale": 1.0})
    return {
        "policy": Path(gym.policy_path).name,
        "default": gym.default_angles,
        "stiffness": gym.kps,
        "damping": gym.kds,
        "action_scale": gym.action_scale,
        "observations": terms,
        "policy_period": gym.simulation_dt * gym.control_decimation,
    }


def _mapping(value: object, name: str, source: Path) -> dict[str, object]:
    if not isinstance(value, dict):
        raise ConfigError("must be a mapping of fields", source=source, field=name)
    return value


def _check_size(name: str, values: tuple[float, ...], size: int, source: Path) -> None:
    if len(values) != size:
        raise ConfigError(f"has {len(values)} numbers for {size} joints of the policy",
                          source=source, field=name)  # fmt: skip
