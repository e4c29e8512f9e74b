"""How real a simulated robot is: what its sensors, motors, body and ground may be like.

A level is data, `configs/realism/*.yaml`. A field is a number, or a range [low, high] from which
each episode draws. `ideal` is the default of every field.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.reading import is_file
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
    """Time that passes, in whole physics steps: the nearest number of them is taken.

    Attributes:
        sense: Time from a measurement until it is known [s].
        command: Time from a torque that is asked for until the motor has it [s].
        misjudged: Time by which the estimator takes all delays for longer than they are [s].
    """

    sense: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.05})
    command: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.05})
    misjudged: Spread = field(default=0.0, metadata={"min": -0.05, "max": 0.05})


@dataclass(frozen=True)
class MotorErrors(RealismPart):
    """What comes of a torque that a motor is asked for.

    Attributes:
        lag: Time constant of a motor's first-order response [s].
        gain_error: Range ± of each motor's gain around 1.
        friction: Coulomb friction of each joint, over the motor's limit.
        no_load_speed: Speed at which a motor has no torque left, which falls from half of it on
            [rad/s]; 0: never.
        backlash: Play between a joint and its encoder [rad].
        arms: Part of the way from the standing posture to the limits of the arms' joints, within
            which external commands move them at random; the controller's commands to them are
            ignored.
    """

    lag: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.1})
    gain_error: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.9})
    friction: Spread = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    no_load_speed: Spread = field(default=0.0, metadata={"min": 0.0})
    backlash: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.2})
    arms: Spread = field(default=0.0, metadata={"min": 0.0, "max": 1.0, "omit": "default"})


@dataclass(frozen=True)
class SensorErrors(RealismPart):
    """Errors of measurements, one each physics step; a noise is the deviation of a normal one.

    A bias is drawn for an episode, each entry uniformly in ± the number.

    Attributes:
        encoder_noise: Noise of joint positions [rad].
        encoder_bias: Bias of joint positions [rad].
        velocity_noise: Noise of joint velocities [rad/s].
        gyro_noise: Noise of the gyroscope [rad/s].
        gyro_bias: Bias of the gyroscope [rad/s].
        accelerometer_noise: Noise of the accelerometer [m/s²].
        accelerometer_bias: Bias of the accelerometer [m/s²].
        tilt_bias: Bias of the IMU's mount about each axis [rad].
        tilt_drift: Deviation of the attitude's error, which is correlated over 1 s [rad].
        force_noise: Noise of the ground's force, over the weight.
        cop_noise: Noise of the centre of pressure [m].
    """

    encoder_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.1})
    encoder_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})
    velocity_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 100.0})
    gyro_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0})
    gyro_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    accelerometer_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 100.0})
    accelerometer_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0})
    tilt_bias: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})
    tilt_drift: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})
    force_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    cop_noise: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})


@dataclass(frozen=True)
class BodyErrors(RealismPart):
    """By what the robot differs from its model.

    Attributes:
        com: Shift of the pushed body's centre of mass, in any direction [m].
        mass: Range ± of each body's mass around that of the model.
        scale: Fraction by which all masses are larger.
        payload: Load on the pushed body, over the robot's mass.
        hand: Load in one hand, over the robot's mass; which one, each episode draws.
    """

    com: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.5})
    mass: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.9})
    scale: Spread = field(default=0.0, metadata={"min": -0.9, "max": 10.0})
    payload: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0})
    hand: Spread = field(default=0.0, metadata={"min": 0.0, "max": 10.0, "omit": "default"})


@dataclass(frozen=True)
class GroundErrors(RealismPart):
    """By what the ground differs from the model's.

    Attributes:
        friction: Sliding friction of all geoms; None: the model's.
        softness: Least time constant of contacts, MuJoCo's `solref` [s]; None: the model's.
        slope: Slope of all ground in any direction, which is thought level [deg].
        bumps: Height of the highest of the bumps around the start; no model has them [m].
    """

    friction: Spread | None = field(default=None, metadata={"above": 0.0, "max": 10.0})
    softness: Spread | None = field(default=None, metadata={"above": 0.0, "max": 1.0})
    slope: Spread = field(default=0.0, metadata={"min": 0.0, "max": 30.0})
    bumps: Spread = field(default=0.0, metadata={"min": 0.0, "max": 0.05, "omit": "default"})


@dataclass(frozen=True)
class Realism:
    """A level: what an episode's robot is drawn from, see `draw_robot`.

    Attributes:
        name: Name of the level, as printed.
        latency: How late measurements and torques are.
        motors: What motors do otherwise than they are asked.
        sensors: How sensors err.
        body: By what the robot differs from its model.
        ground: By what the ground differs from the model's.
    """

    name: str = IDEAL
    latency: Latency = field(default_factory=Latency)
    motors: MotorErrors = field(default_factory=MotorErrors)
    sensors: SensorErrors = field(default_factory=SensorErrors)
    body: BodyErrors = field(default_factory=BodyErrors)
    ground: GroundErrors = field(default_factory=GroundErrors)

    @staticmethod
    def named(name: str) -> Realism:
        """The level that a configuration names, see `load_realism`."""
        return load_realism(name)

    @property
    def ideal(self) -> bool:
        """True where nothing differs from the model: the state is known exactly and at once."""
        return replace(self, name=IDEAL) == Realism()

    @property
    def uncertain(self) -> bool:
        """True where sensors err or bodies are drawn: both state and robot are estimates."""
        exact = self.sensors == SensorErrors() and self.body == BodyErrors()
        return not exact or bool(np.any(self.motors.backlash))

    @property
    def misplaced(self) -> float:
        """What no filter takes out of legs' attitude: b_encoder + backlash + b_tilt at most [rad].

        Times the leg's length it is the error of a sole's estimated position.
        """
        biases = self.sensors.encoder_bias, self.motors.backlash, self.sensors.tilt_bias
        return sum(float(np.max(np.abs(bias))) for bias in biases)

    @property
    def bumpy(self) -> bool:
        """True where there may be bumps, of which the model must be built."""
        return bool(np.any(self.ground.bumps))

    def scaled(self, factor: float) -> Realism:
        """The level on the way from `ideal` (0) to this one (1) and beyond, for a curriculum.

        A number x becomes `factor` · x. Friction and softness, whose ideal is the robot's own, are
        drawn alike at every factor above 0.
        """
        if factor <= 0.0:
            return Realism(self.name)
        parts: dict[str, Any] = {
            part.name: _scaled(getattr(self, part.name), factor) for part in fields(self)[1:]
        }
        return replace(self, **parts)


def _scaled(part: RealismPart, factor: float) -> RealismPart:
    def value(spread: Spread | None, name: str) -> Spread | None:
        if spread is None or (name in ("friction", "softness") and isinstance(part, GroundErrors)):
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

    A file or a mapping may be on another level, which its `base` names. Names that `+` joins,
    `field+arms`, are one level, each of them with the last word on the fields that it has.

    Raises ConfigError naming the file, the field and the choices.
    """
    if given is None:
        return Realism()
    if isinstance(given, Realism):
        return given
    if isinstance(given, str) and len(names := level_names(given)) > 1:
        levels = [load_realism(name) for name in names]  # each says what is wrong with it
        data, source = reduce(overlay, (_fields(name) for name in names)), given
        data["name"] = "+".join(level.name for level in levels)
    elif isinstance(given, (str, Path)):
        path = resolve("realism", given)
        data, source = {"name": path.stem, **read_yaml(path)}, str(path)
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


def level_names(given: str) -> list[str]:
    """The names of levels in one of the form `field+arms`; a file may have a plus in its name."""
    return [given] if is_file(given) else given.split("+")


def _fields(name: str) -> dict[str, Any]:
    """What the file of a level says, and those that it is on."""
    path = resolve("realism", name)
    return on_base(read_yaml(path), "realism", path)
