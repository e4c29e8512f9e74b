"""Pushes from what a caller wrote: dictionaries, lists, and magnitudes in several units."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build, to_dict
from poise.envs.compiled.maths.pendulum import Profile, ankle_limit
from poise.envs.robots.robot import Robot

from .push import Kick, Push

SupportMargin = Callable[[float], float]  # direction [deg] → support margin δ(θ) [m]


@dataclass(frozen=True)
class _Magnitude:
    """The ways to say how large a push is; one of them is given."""

    impulse: float = field(default=0.0, metadata={"min": 0.0})
    force: float = field(default=0.0, metadata={"min": 0.0})
    specific_impulse: float = field(default=0.0, metadata={"min": 0.0})
    specific_force: float = field(default=0.0, metadata={"min": 0.0})
    ankle_fraction: float = field(default=0.0, metadata={"min": 0.0})


MAGNITUDES = tuple(f.name for f in fields(_Magnitude))
PUSH_KEYS = (*(f.name for f in fields(Push) if f.name != "impulse"), *MAGNITUDES)
KICK_KEYS = tuple(f.name for f in fields(Kick))
DEFAULTS = {"start": 0.0, "duration": 0.1, "direction": 0.0}


def body_names(robot: Robot) -> tuple[str, ...]:
    """Bodies of the robot's own tree, the ones that can be pushed."""
    model, root = robot.model, robot.root_body_id
    return tuple(
        model.body(i).name for i in range(root, model.nbody) if model.body_rootid[i] == root
    )


def to_impulse(
    unit: str,
    value: float,
    robot: Robot,
    direction: float,
    duration: float,
    profile: Profile,
    margin: SupportMargin | None = None,
) -> float:
    """Impulse J [N·s] of a push whose magnitude is given in `unit`.

    impulse           J [N·s]
    force             peak force F [N]: J = F T (square) or 2/π F T (half-sine)
    specific_impulse  J/m [N·s/kg]
    specific_force    peak F/m [N/kg]
    ankle_fraction    J/m over `ankle_limit` in that direction, for that duration and profile

    Raises ConfigError for another unit, or when ankle_fraction has no `margin`.
    """
    if unit == "impulse":
        return value
    if unit in ("force", "specific_force"):
        value *= 1.0 if unit == "force" else robot.mass
        return value * duration * (1.0 if profile == "square" else 2.0 / np.pi)
    if unit == "specific_impulse":
        return value * robot.mass
    if unit != "ankle_fraction":
        raise ConfigError(f"unknown unit {shown(unit)}", field="unit", choices=MAGNITUDES)
    if margin is None:
        raise ConfigError("needs a support margin, unknown here", field=unit)
    limit = ankle_limit(robot.omega, margin(direction), duration, profile)
    return value * robot.mass * limit


def parse_pushes(
    value: object, robot: Robot, margin: SupportMargin | None = None, source: str = "push"
) -> tuple[Push | Kick, ...]:
    """Pushes from one dictionary, one Push or Kick, or a list of them; [] means none.

    A push dictionary has the keys of `Push`, with exactly one magnitude among impulse [N·s],
    force [N], specific_impulse [N·s/kg], specific_force [N/kg] and ankle_fraction; a dictionary
    with `delta_v` [m/s] is a kick. Left out, body is the root body, start 0 s, duration 0.1 s,
    direction 0°. `margin(direction)` gives δ(θ) [m] for ankle_fraction.

    Raises ConfigError naming `source`, the field and the choices for an unknown key or body,
    a wrong type, a value out of range or not finite, and no or several magnitudes.
    """
    if isinstance(value, (Mapping, Push, Kick)):
        return (_parse_one(value, robot, margin, source),)
    if isinstance(value, (list, tuple)):
        return tuple(
            _parse_one(item, robot, margin, f"{source}[{i}]") for i, item in enumerate(value)
        )
    raise ConfigError(
        f"must be a mapping or a list of mappings, not {type(value).__name__}", source=source
    )


def _parse_one(
    item: object, robot: Robot, margin: SupportMargin | None, source: str
) -> Push | Kick:
    if isinstance(item, (Push, Kick)):
        item = asdict(item)
    if not isinstance(item, Mapping):
        raise ConfigError(f"must be a mapping, not {type(item).__name__}", source=source)
    data = {key: to_dict(entry) for key, entry in item.items()}
    if "delta_v" in data:
        _check_keys(data, KICK_KEYS, source)
        return build(Kick, {"start": 0.0, "direction": 0.0, **data}, source)

    _check_keys(data, PUSH_KEYS, source)
    units = [unit for unit in MAGNITUDES if unit in data]
    if len(units) != 1:
        problem = f"has {' and '.join(units)}" if units else "has no magnitude"
        raise ConfigError(
            f"{problem}; give exactly one",
            source=source,
            field="magnitude",
            choices=(*MAGNITUDES, "delta_v"),
        )
    unit = units[0]
    magnitude = data.pop(unit)
    root = robot.model.body(robot.root_body_id).name
    data = {"body": root, **DEFAULTS, **data, "impulse": 0.0}
    push = build(Push, data, source)  # checks everything but the magnitude
    check_body(push.body, robot, source)
    value = getattr(build(_Magnitude, {unit: magnitude}, source), unit)
    if unit == "ankle_fraction" and margin is None:
        raise ConfigError("needs a support margin, unknown here", source=source, field=unit)
    impulse = to_impulse(unit, value, robot, push.direction, push.duration, push.profile, margin)
    return build(Push, {**data, "impulse": impulse}, source)


def _check_keys(data: Mapping, known: tuple[str, ...], source: str) -> None:
    for key in data:
        if key not in known:
            raise ConfigError("unknown key", source=source, field=str(key), choices=known)


def check_body(body: str, robot: Robot, source: str | None, field: str = "body") -> None:
    """Raise ConfigError, listing the robot's bodies, unless `body` is one of them."""
    if body not in body_names(robot):
        raise ConfigError(
            f"no body {shown(body)} in robot {robot.name!r}",
            source=source,
            field=field,
            choices=body_names(robot),
        )
