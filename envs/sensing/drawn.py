"""The robot of one episode: drawn from a level, and simulated by one model, changed in place."""

import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.arms import ROLES, find_arms
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, on_terrain
from poise.envs.terrain.building import BUILT
from poise.envs.terrain.bumps import Bumps

from .realism import Realism, Spread

#: what an episode changes of a model
CHANGED = (
    *("body_mass", "body_inertia", "body_ipos", "dof_frictionloss"),
    *("geom_friction", "pair_friction", "geom_solref", "pair_solref", "geom_pos"),
)
HIGHEST = 0.05  # [m] that a bump is built; an episode lets it down


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
    softness: float | None  #: of contacts [s]; None: as in the model
    slope: np.ndarray  #: (2,) tangent of the ground's fall along x and y
    seed: int  #: of the noise within the episode
    bumps: float = 0.0  #: height of the highest bump [m]
    arms: float = 0.0  #: part of their reach within which external commands move them; 0: none do
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
        """Return its main numbers, for `info` and tables: SI units, degrees."""
        numbers = {
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
                numbers[name] = value
        numbers |= {name: getattr(self, name) for name in LATER if getattr(self, name)}
        if self.hand:
            numbers["side"] = self.side
        return {name: round(value, 6) for name, value in numbers.items()}


LATER = ("bumps", "arms", "hand")  # fields that `summary` has where they are not 0
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


class Plant:
    """A `simulation` of a robot whose body and ground differ from those of `robot`; the ground has
    bumps if it is `bumpy`.

    Its model is one of its own. Sizes, names and motors are those of `robot`, so that a controller
    made for that fits; its arrays have the true mass.

    Raises ConfigError for bumps on a terrain.
    """

    def __init__(self, robot: Robot, bumpy: bool = False):
        self.robot, self.bumpy = robot, bumpy
        if bumpy:
            if not robot.terrain.flat:
                raise ConfigError("only on level ground, not on a terrain", source="realism",
                                  field="ground.bumps")  # fmt: skip
            robot = on_terrain(robot, Bumps(lowest=HIGHEST, highest=HIGHEST))
        model = copy.copy(robot.model)
        self._nominal = {name: getattr(model, name).copy() for name in CHANGED}
        self._gravity = float(np.linalg.norm(model.opt.gravity))
        self._scratch = mujoco.MjData(model)
        self._loaded = model.body(push_bodies(robot)[0]).id
        self._hands = [arm.hand for arm in find_arms(robot)]
        self._limit = np.zeros(model.nv)
        self._limit[robot.motor_dofs] = robot.torque_limit
        self._mass = robot.mass
        self._root = robot.root_body_id
        self.simulation = Simulation(replace(robot, model=model))
        count = len(self.simulation.arrays.surfaces) if bumpy else 0
        self._bumps = [model.geom(f"{BUILT}{i}").id for i in range(1, count)]

    def become(self, drawn: DrawnRobot) -> None:
        """Change the model to the robot that was drawn; the simulation must be reset next."""
        model, nominal = self.simulation.model, self._nominal
        for name, value in nominal.items():
            getattr(model, name)[:] = value
        model.body_mass[:] *= drawn.mass_factor
        model.body_inertia[:] *= drawn.mass_factor[:, None]
        model.body_mass[self._loaded] += drawn.payload * self._mass
        model.body_ipos[self._loaded] += drawn.com_shift
        if drawn.hand:
            model.body_mass[self._hands[drawn.side]] += drawn.hand * self._mass
        model.dof_frictionloss[6:] += drawn.joint_friction * self._limit[6:]
        if drawn.friction is not None:
            model.geom_friction[:, 0] = drawn.friction
            model.pair_friction[:, :2] = drawn.friction
        if drawn.softness is not None:
            for solref in (model.geom_solref, model.pair_solref):
                soft = solref[:, 0] > 0.0  # a negative number is a stiffness of the model's own
                solref[soft, 0] = np.maximum(solref[soft, 0], drawn.softness)
        up = np.array([-drawn.slope[0], -drawn.slope[1], 1.0])  # of gravity, seen from the ground
        model.opt.gravity[:] = -self._gravity * up / np.linalg.norm(up)
        if self.bumpy:
            self._let_down(drawn)
        mujoco.mj_setConst(model, self._scratch)
        self.simulation.arrays.replace_number("mass", float(model.body_subtreemass[self._root]))

    def _let_down(self, drawn: DrawnRobot) -> None:
        """Let half of the bumps down by what they are less than built, the others under the floor.

        Only down: MuJoCo looks for contacts in boxes that were made when the model was built.
        """
        model, surfaces = self.simulation.model, self.simulation.arrays.surfaces
        rng = np.random.default_rng(drawn.seed)
        heights = drawn.bumps * np.maximum(rng.uniform(-1.0, 1.0, len(surfaces) - 1), 0.0)
        surfaces["height"][1:] = heights
        model.geom_pos[self._bumps, 2] -= HIGHEST - np.where(heights > 0.0, heights, -HIGHEST)


def check_limbs(level: Realism, robot: Robot) -> None:
    """Raise ConfigError where a level moves or loads arms, and the robot has none."""
    for field, spread in (("motors.arms", level.motors.arms), ("body.hand", level.body.hand)):
        if np.any(spread) and not find_arms(robot):
            raise ConfigError(
                f"the robot {robot.name} has no arms: its description has not the roles "
                f"{' and '.join(ROLES)}",
                source=level.name,
                field=field,
                choices=robot.description.roles or ("no roles",),
            )
