"""The robot of one episode, drawn from a level."""

from dataclasses import dataclass

import numpy as np

from poise.envs.robots.robot import Robot

from .realism import Realism, Spread


@dataclass(frozen=True, eq=False)
class DrawnRobot:
    """What is true of the robot of an episode; nj joints, nu motors, nb bodies.

    Attributes:
        sense, command: physics steps by which measurements and torques are late.
        misjudged: by which the estimator takes both together for longer [s].
        lag, no_load_speed, backlash: of the motors [s, rad/s, rad].
        gain: (nu,) of each motor.
        joint_friction: (nj,) Coulomb's, over the motor's limit.
        noise: standard deviations by the names of `SensorErrors`.
        encoder_bias: (nj,) [rad]; gyro_bias, accelerometer_bias, tilt_bias: (3,).
        com_shift: (3,) of the loaded body's centre of mass, in its frame [m].
        mass_factor: (nb,) of each body's mass and inertia.
        payload: on the loaded body, over the robot's mass.
        friction, softness: of the ground, or None: as in the model.
        slope: (2,) tangent of the ground's fall along x and y.
        bumps: height of the highest bump [m].
        arms: part of their reach within which somebody else moves the arms; 0: nobody does.
        hand: load in a hand, over the robot's mass; `side` of it: 0 left, 1 right.
        arms_seed: of the postures of the arms.
    """

    sense: int
    command: int
    misjudged: float
    lag: float
    gain: np.ndarray
    joint_friction: np.ndarray
    no_load_speed: float
    backlash: float
    noise: dict[str, float]
    encoder_bias: np.ndarray
    gyro_bias: np.ndarray
    accelerometer_bias: np.ndarray
    tilt_bias: np.ndarray
    com_shift: np.ndarray
    mass_factor: np.ndarray
    payload: float
    friction: float | None
    softness: float | None
    slope: np.ndarray
    seed: int  #: of the noise within the episode
    bumps: float = 0.0
    arms: float = 0.0
    hand: float = 0.0
    side: int = 0
    arms_seed: int = 0

    @property
    def measured(self) -> bool:
        """True where a sensor errs, so that the state is known by measurements alone."""
        biases = self.encoder_bias, self.gyro_bias, self.accelerometer_bias, self.tilt_bias
        return any(self.noise.values()) or self.backlash > 0.0 or any(b.any() for b in biases)

    @property
    def loaded(self) -> bool:
        """True where the body is not as the model has it."""
        other = self.payload or self.hand or self.com_shift.any()
        return bool(other or (self.mass_factor != 1.0).any())

    def summary(self, timestep: float) -> dict[str, float]:
        """The numbers that tell most of it, for `info` and tables: SI units, degrees."""
        told = {
            "sense_delay": self.sense * timestep,
            "command_delay": self.command * timestep,
            "lag": self.lag,
            "payload": self.payload,
            "com_shift": float(np.linalg.norm(self.com_shift)),
            "tilt_bias": float(np.linalg.norm(self.tilt_bias[:2])),
            "slope": float(np.degrees(np.arctan(np.linalg.norm(self.slope)))),
        }
        for name in ("friction", "softness"):
            if (value := getattr(self, name)) is not None:
                told[name] = value
        told |= {name: getattr(self, name) for name in LATER if getattr(self, name)}
        if self.hand:
            told["side"] = self.side
        return {name: round(value, 6) for name, value in told.items()}


LATER = ("bumps", "arms", "hand")  # fields that are told where they are not 0
NOISES = (
    *("encoder_noise", "velocity_noise", "gyro_noise", "accelerometer_noise"),
    *("tilt_drift", "force_noise", "cop_noise"),
)


def draw_robot(level: Realism, robot: Robot, rng: np.random.Generator) -> DrawnRobot:
    """The robot of an episode.

    Ranges are drawn uniformly, and all numbers in one order whatever the level, so that one seed
    gives the same robot wherever levels are equal.
    """
    latency, motors, sensors, body, ground = (
        level.latency, level.motors, level.sensors, level.body, level.ground
    )  # fmt: skip
    nj, timestep = len(robot.joint_names), float(robot.model.opt.timestep)

    def number(spread: Spread) -> float:
        low, high = spread if isinstance(spread, tuple) else (spread, spread)
        return float(low + (high - low) * rng.random())

    def known(spread: Spread | None) -> float | None:
        drawn = number(1.0 if spread is None else spread)
        return None if spread is None else drawn

    def each(spread: Spread, count: int) -> np.ndarray:
        low, high = spread if isinstance(spread, tuple) else (spread, spread)
        return low + (high - low) * rng.random(count)

    def bias(spread: Spread, count: int = 3) -> np.ndarray:
        return number(spread) * rng.uniform(-1.0, 1.0, count)

    def direction(dimensions: int) -> np.ndarray:
        vector = rng.standard_normal(dimensions)
        return vector / np.linalg.norm(vector)

    return DrawnRobot(
        sense=round(number(latency.sense) / timestep),
        command=round(number(latency.command) / timestep),
        misjudged=number(latency.misjudged),
        lag=number(motors.lag),
        gain=1.0 + bias(motors.gain_error, robot.model.nu),
        joint_friction=each(motors.friction, nj),
        no_load_speed=number(motors.no_load_speed),
        backlash=number(motors.backlash),
        noise={name: number(getattr(sensors, name)) for name in NOISES},
        encoder_bias=bias(sensors.encoder_bias, nj),
        gyro_bias=bias(sensors.gyro_bias),
        accelerometer_bias=bias(sensors.accelerometer_bias),
        tilt_bias=bias(sensors.tilt_bias),
        com_shift=number(body.com) * direction(3),
        mass_factor=(1.0 + number(body.scale)) * (1.0 + bias(body.mass, robot.model.nbody)),
        payload=number(body.payload),
        friction=known(ground.friction),
        softness=known(ground.softness),
        slope=np.tan(np.radians(number(ground.slope))) * direction(2),
        seed=int(rng.integers(2**63)),
        bumps=number(ground.bumps),
        arms=number(motors.arms),
        hand=number(body.hand),
        side=int(rng.integers(2)),
        arms_seed=int(rng.integers(2**63)),
    )
