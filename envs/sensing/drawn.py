"""The robot of one episode, drawn from a level."""

from dataclasses import dataclass

import numpy as np

from poise.envs.robots.robot import Robot

from .realism import Realism, Spread


@dataclass(frozen=True, eq=False)
class DrawnRobot:
    """What is true of the robot of an episode; nj joints, nu motors, nb bodies."""

    sense: int  #: physics steps by which measurements are late
    command: int  #: the same of torques
    misjudged: float  #: by which the estimator takes both together for longer [s]
    lag: float  #: of the motors [s]
    gain: np.ndarray  #: (nu,) of each motor
    joint_friction: np.ndarray  #: (nj,) Coulomb's, over the motor's limit
    no_load_speed: float  #: of the motors [rad/s]
    backlash: float  #: of the motors [rad]
    noise: dict[str, float]  #: standard deviations by the names of `SensorErrors`
    encoder_bias: np.ndarray  #: (nj,) [rad]
    gyro_bias: np.ndarray  #: (3,) [rad/s]
    accelerometer_bias: np.ndarray  #: (3,) [m/s²]
    tilt_bias: np.ndarray  #: (3,) [rad]
    com_shift: np.ndarray  #: (3,) of the loaded body's centre of mass, in its frame [m]
    mass_factor: np.ndarray  #: (nb,) of each body's mass and inertia
    payload: float  #: on the loaded body, over the robot's mass
    friction: float | None  #: of the ground; None: as in the model
    softness: float | None  #: likewise
    slope: np.ndarray  #: (2,) tangent of the ground's fall along x and y
    seed: int  #: of the noise within the episode
    bumps: float = 0.0  #: height of the highest bump [m]
    arms: float = 0.0  #: part of their reach within which somebody else moves them; 0: nobody does
    hand: float = 0.0  #: load in a hand, over the robot's mass
    side: int = 0  #: of that hand: 0 left, 1 right
    arms_seed: int = 0  #: of the postures of the arms

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
