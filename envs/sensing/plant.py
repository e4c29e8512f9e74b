"""The simulated robot that an episode draws: one model, changed in place at every reset."""

import copy
from dataclasses import replace

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.arms import ROLES, find_arms
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, on_terrain
from poise.envs.terrain.arrays import HEIGHT
from poise.envs.terrain.building import BUILT
from poise.envs.terrain.bumps import Bumps

from .drawn import DrawnRobot
from .realism import Realism

#: what an episode changes of a model
CHANGED = (
    *("body_mass", "body_inertia", "body_ipos", "dof_frictionloss"),
    *("geom_friction", "pair_friction", "geom_solref", "pair_solref", "geom_pos"),
)
HIGHEST = 0.05  # [m] that a bump is built; an episode lets it down


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
        surfaces[1:, HEIGHT] = heights
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
