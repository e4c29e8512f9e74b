"""What is seen of a robot at one moment: poses, marks, and the values that are plotted."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.robot_clip import RobotClip
from poise.baselines.balance.stepping.controller import SteppingController
from poise.baselines.controller import BaseController
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.terrain.arrays import SURFACE
from poise.envs.terrain.terrain import Surface, height_at
from poise.envs.viewing.contact_forces import ContactForces
from poise.envs.viewing.overlays import Mark, foothold_mark, marks

from .ghost import Ghost, GhostBodies, Poses, ghost_of

#: value of a frame → title of its plot
VALUES = {
    "speed": "speed of the centre of mass [m/s]",
    "margin": "capture point inside the support [m]",
    "torque": "largest torque over its limit",
    "push": "push [N]",
}


LEVEL = np.zeros(0, SURFACE)  # no surfaces


class Frame(NamedTuple):
    """A robot at one moment, world axes.

    Attributes:
        time: [s] after the reset.
        positions, quaternions: (nbody, 3) [m] and (nbody, 4), w first, of the bodies.
        com: (3,) centre of mass [m].
        marks: of the quantities of `envs/viewing/quantities.py`.
        values: of `VALUES`.
        fall_time: when it fell [s]; None: it has not.
        ghost: where the bodies are if the reference motion is followed exactly; None: it has none
            that moves.
        surfaces: (n,) of the ground, see `surface_arrays`; the same array for as long as it is the
            same ground.
        floor: height of the plane below them [m].
    """

    time: float
    positions: np.ndarray
    quaternions: np.ndarray
    com: np.ndarray
    marks: tuple[Mark, ...]
    values: dict[str, float]
    fall_time: float | None
    ghost: Poses | None = None
    surfaces: np.ndarray = LEVEL
    floor: float = 0.0


def frame_between(first: Frame, second: Frame, fraction: float) -> Frame:
    """Bodies between two frames, for slow motion; everything else is that of the second one."""
    ghost = second.ghost
    if first.ghost is not None and ghost is not None:
        ghost = _between(first.ghost, ghost, fraction)
    both = Poses(first.positions, first.quaternions), Poses(second.positions, second.quaternions)
    return second._replace(**_between(*both, fraction)._asdict(), ghost=ghost)


def _between(first: Poses, second: Poses, fraction: float) -> Poses:
    """Of each body the fraction of the way, and of the turn the shorter way around."""
    signs = np.where(np.sum(first.quaternions * second.quaternions, axis=1) < 0.0, -1.0, 1.0)
    turned = (1.0 - fraction) * signs[:, None] * first.quaternions + fraction * second.quaternions
    return Poses(
        (1.0 - fraction) * first.positions + fraction * second.positions,
        turned / np.linalg.norm(turned, axis=1, keepdims=True),
    )


class FrameMaker:
    """Makes the frames of an environment, which is only read.

    Args:
        env: whose robot.
        seen: postures that are seen beside it; None: those of the motion that it performs.
    """

    def __init__(self, env: BalanceEnv, seen: RobotClip | None = None):
        self._env, self._seen = env, seen
        self._forces = ContactForces(env.simulation)
        self._ghost: Ghost | GhostBodies | None = None
        self._surfaces = LEVEL

    def __call__(self, fall_time: float | None = None) -> Frame:
        """Return the frame of this moment, of a robot that fell at `fall_time` [s]."""
        simulation = self._env.simulation
        if self._forces.simulation is not simulation:  # other conditions, another simulation
            self._forces = ContactForces(simulation)
        data, arrays = simulation.data, simulation.arrays
        if not np.array_equal(self._surfaces, arrays.surfaces):  # an episode may resample them
            self._surfaces = arrays.surfaces.copy()
        return Frame(
            time=simulation.time,
            positions=data.xpos.copy(),
            quaternions=data.xquat.copy(),
            com=simulation.state.com.copy(),
            marks=(*marks(simulation), *self._forces.marks(), *self._footholds()),
            values=_values(simulation),
            fall_time=fall_time,
            ghost=self._reference(simulation.time),
            surfaces=self._surfaces,
            floor=float(arrays.floor),
        )

    def _reference(self, time: float) -> Poses | None:
        """Return the ghost's bodies at a time [s]; after a reset it stands where the robot does."""
        if time == 0.0:
            robot, seen = self._env.robot, self._seen
            self._ghost = ghost_of(self._env) if seen is None else GhostBodies(seen, robot)
        return None if self._ghost is None else self._ghost(time)

    def _footholds(self) -> list[Mark]:
        """Where the controller's foot is to land, while it swings."""
        env = self._env
        controller = getattr(env, "controller", None)
        inner = controller.unwrapped if isinstance(controller, BaseController) else None
        if not isinstance(inner, SteppingController) or inner.stepping().foot < 0:
            return []
        floor = float(env.simulation.arrays.floor)
        point = ground_at(inner.stepping().foothold, self._surfaces, floor)
        return [foothold_mark(point, env.robot.height_com)]


def ground_at(point: np.ndarray, surfaces: np.ndarray, floor: float) -> np.ndarray:
    """Return (3,) the ground at the x and y of `point` [m]; surfaces and floor as of a `Frame`."""
    x, y = float(point[0]), float(point[1])
    return np.array([x, y, height_at([Surface(*row) for row in surfaces.tolist()], floor, x, y)])


def _values(simulation: Simulation) -> dict[str, float]:
    state = simulation.state.copy()  # the support polygon is computed into the state's own arrays
    load = np.abs(simulation.views.ctrl) / simulation.robot.torque_limit
    force = sum(
        float(np.linalg.norm(push.force(simulation.time)))
        for push in simulation.pushes
        if isinstance(push, Push)
    )
    return {
        "speed": float(np.linalg.norm(state.com_vel)),
        "margin": state.support_distance(state.capture_point),
        "torque": float(load.max()),
        "push": force,
    }
