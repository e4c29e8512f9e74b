"""How real a simulated robot is: what its sensors, motors, body and ground may be like.

A level is data, `configs/realism/*.yaml`. A field is a number, or a range [low, high] from which
each episode draws. `ideal` is the default of every field.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.schema import build, on_base, overlay, read_yaml, to_dict

Spread = float | tuple[float, float]  # a number, or a range that an episode draws from
IDEAL = "ideal"


@dataclass(frozen=True)
class RealismPart:
    """Base of the parts of a level: ranges must not decrease."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, tuple) and value[0] > value[1]:
                raise ValueError(
                    f"{item.name}: the range [{value[0]:g}, {value[1]:g}] must not decrease"
                )


@dataclass(frozen=True)
class Latency(RealismPart):
    """Time that passes [s], in whole physics steps: the nearest number of them is taken."""

    sense: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.05}
    )  # from a measurement until it is known
    command: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.05}
    )  # from a torque that is asked for until the motor has it
    #: by which the estimator takes both together for longer than they are
    misjudged: Spread = field(default=0.0, metadata={"min": -0.05, "max": 0.05})


@dataclass(frozen=True)
class Motors(RealismPart):
    """What comes of a torque that a motor is asked for."""

    lag: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.1}
    )  # time constant of its first-order response [s]
    gain_error: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.9}
    )  # each motor's gain is 1 ± this, uniformly
    friction: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 1.0}
    )  # Coulomb's, of each joint, over the motor's limit
    #: at which a motor has no torque left [rad/s]; it falls linearly from half of it on; 0: never
    no_load_speed: Spread = field(default=0.0, metadata={"min": 0.0})
    backlash: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.2}
    )  # play between joint and encoder [rad]


@dataclass(frozen=True)
class Sensors(RealismPart):
    """Errors of measurements, one each physics step; a noise is the deviation of a normal one.

    A bias is drawn for an episode, each entry uniformly in ± the number.
    """

    encoder_noise: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.1}
    )  # of joint positions [rad]
    encoder_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})  # [rad]
    velocity_noise: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 100.0}
    )  # of joint velocities [rad/s]
    gyro_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0})  # [rad/s]
    gyro_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 1.0})  # [rad/s]
    accelerometer_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 100.0})  # [m/s²]
    accelerometer_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0})  # [m/s²]
    tilt_bias: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.5}
    )  # of the IMU's mount about each axis [rad]
    tilt_drift: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.5}
    )  # deviation of the attitude, correlated over 1 s [rad]
    force_noise: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 1.0}
    )  # of the ground's force over the weight
    cop_noise: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.5}
    )  # of the centre of pressure at full load [m]


@dataclass(frozen=True)
class Body(RealismPart):
    """By what the robot differs from its model."""

    com: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.5}
    )  # shift of the pushed body's centre of mass [m], any direction
    mass: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 0.9}
    )  # each body's mass is 1 ± this of the model's, uniformly
    scale: Spread = field(
        default=0.0, metadata={"min": -0.9, "max": 10.0}
    )  # by which all masses are larger
    payload: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 10.0}
    )  # carried on the pushed body, over the robot's mass


@dataclass(frozen=True)
class Ground(RealismPart):
    """By what the ground differs from the model's; None: by nothing."""

    friction: Spread | None = field(default=None, metadata={"above": 0.0, "max": 10.0})
    #: time constant of contacts, MuJoCo's first number of `solref` [s]
    softness: Spread | None = field(default=None, metadata={"above": 0.0, "max": 1.0})
    slope: Spread = field(
        default=0.0, metadata={"min": 0.0, "max": 30.0}
    )  # of all ground, in any direction, thought level [deg]


@dataclass(frozen=True)
class Realism:
    """A level: what an episode's robot is drawn from, see `draw_robot`."""

    name: str = IDEAL
    latency: Latency = field(default_factory=Latency)
    motors: Motors = field(default_factory=Motors)
    sensors: Sensors = field(default_factory=Sensors)
    body: Body = field(default_factory=Body)
    ground: Ground = field(default_factory=Ground)

    @property
    def ideal(self) -> bool:
        """True where nothing differs from the model: the state is known exactly and at once."""
        return replace(self, name=IDEAL) == Realism()

    def scaled(self, factor: float) -> Realism:
        """The level on the way from `ideal` (0) to this one (1) and beyond, for a curriculum.

        A number x becomes `factor` · x. Friction and softness, whose ideal is the robot's own, are
        drawn alike at every factor above 0.
        """
        if factor <= 0.0:
            return Realism(self.name)
        parts = {part.name: _scaled(getattr(self, part.name), factor) for part in fields(self)[1:]}
        return replace(self, **parts)


def _scaled(part: RealismPart, factor: float) -> RealismPart:
    def value(spread: Spread | None, name: str) -> Spread | None:
        if spread is None or (name in ("friction", "softness") and isinstance(part, Ground)):
            return spread
        if isinstance(spread, tuple):
            return (factor * spread[0], factor * spread[1])
        return factor * spread

    return replace(part, **{f.name: value(getattr(part, f.name), f.name) for f in fields(part)})


PARTS = tuple(item.name for item in fields(Realism))


def overlaid(level: Realism, given: object, source: str) -> Realism:
    """The level with the fields of a mapping in place of its own.

    Raises ConfigError naming the field and the choices.
    """
    if not isinstance(given, Mapping):
        raise ConfigError(f"must be a mapping, not {shown(given)}", source=source, choices=PARTS)
    return build(Realism, overlay(to_dict(level), to_dict(dict(given))), source)


def load_realism(given: str | Path | Mapping | Realism | None, source: str = "realism") -> Realism:
    """A level by a packaged name, a .yaml file, or a mapping of its fields.

    A file or a mapping may be on another level, which its `base` names.

    Raises ConfigError naming the file, the field and the choices.
    """
    if given is None:
        return Realism()
    if isinstance(given, Realism):
        return given
    if isinstance(given, (str, Path)):
        path = resolve("realism", given)
        data, source = read_yaml(path), str(path)
        data = {"name": path.stem, **data}
    elif isinstance(given, Mapping):
        data = {str(key): to_dict(value) for key, value in given.items()}
        if "base" in data and "name" not in data:
            data["name"] = f"{data['base']}, changed"
        data.setdefault("name", "custom")
    else:
        raise ConfigError(
            f"must be the name of a level, a file or a mapping, not {shown(given)}",
            field=source, choices=PARTS,
        )  # fmt: skip
    return build(Realism, on_base(data, "realism", source), source)
