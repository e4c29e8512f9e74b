"""The marks over a simulation: pushes, centre of mass, and what the balance depends on.

| mark | shape and colour |
|---|---|
| push, kick | amber arrow; its tip is the force's point of application, its length the peak force |
| centre of mass | black sphere, and a small black disc below it on the ground |
| centre of pressure | vermilion disc, while the ground carries anything |
| capture point | blue disc, the largest |
| support polygon | bluish green line around the soles |

Sizes are in heights of the CoM, as the camera's distance is: the smallest mark is ten pixels wide
in a picture of 640 by 480. Colours are those of `quantities.py`, and no two marks have both the
same shape and the same size. Marks on the ground that coincide lie on each other, the largest
lowest. `contact_forces.py` has one more mark, and a planned foothold is a sky blue disc
(`foothold_mark`).
"""

from typing import NamedTuple

import mujoco
import numpy as np

from poise.envs.physics.pushes.table import KICK, NOTHING
from poise.envs.physics.simulation import Simulation

from .quantities import CAPTURE_POINT, COM, COP, FOOTHOLD, PUSH, RGB, SUPPORT

FADE = 0.3  # [s] for which a push stays visible after its end
KICK_TIME = 0.1  # [s]: a kick is drawn as the force that gives its impulse in this time
ARROW_GAIN = 1.5  # arrow length over CoM height, for a force equal to the weight
ARROW_LENGTHS = (0.4, 1.0)  # shortest and longest, over CoM height
SPHERE, DISC = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CYLINDER
BAR, ARROW = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ARROW


class Mark(NamedTuple):
    """One thing to draw, world frame."""

    name: str
    shape: mujoco.mjtGeom
    start: np.ndarray  # (3,) centre, or where a bar or an arrow begins [m]
    end: np.ndarray  # (3,) where it ends [m]
    radius: float  # [m]
    colour: RGB
    opacity: float = 1.0


def marks(simulation: Simulation) -> list[Mark]:
    """All marks for the simulation's current state, which is only read."""
    state = simulation.state.copy()  # the support polygon is computed into the state's own arrays
    size = simulation.robot.height_com
    level = state.support_height
    polygon = state.support_polygon
    corners = np.column_stack([polygon, np.full(len(polygon), level)])
    found = [
        Mark("support", BAR, start, end, 0.013 * size, SUPPORT.colour)
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    point = np.append(state.capture_point, level)
    found.append(_disc("capture point", point, 0.065 * size, 0.004 * size, CAPTURE_POINT.colour))
    if state.contact_wrench[2] > 1e-3 * state.mass * simulation.arrays.gravity:
        point = np.append(state.cop, level)
        found.append(_disc("cop", point, 0.046 * size, 0.007 * size, COP.colour))
    black = COM.colour
    point = np.append(state.com[:2], level)
    found.append(_disc("com on ground", point, 0.026 * size, 0.010 * size, black))
    found.append(Mark("com", SPHERE, state.com, state.com, 0.04 * size, black))
    return found + push_arrows(simulation)


def push_arrows(simulation: Simulation) -> list[Mark]:
    """An arrow for every push that acts, or has ended less than `FADE` seconds ago."""
    weight = simulation.robot.mass * simulation.arrays.gravity
    size = simulation.robot.height_com
    views, found = simulation.views, []
    for row in simulation.push_table:
        if row["kind"] == NOTHING:
            continue
        body, start, duration = row["body"], row["start"], row["duration"]
        vector, is_kick = row["force"], row["kind"] == KICK
        age = simulation.time - start
        opacity = 1.0 - max(age - duration, 0.0) / FADE
        force = float(np.linalg.norm(vector))
        if age < -1e-9 or opacity <= 0.0 or force == 0.0:
            continue
        tip = views.xipos[body] + views.xmat[body].reshape(3, 3) @ row["point"]
        fraction = (simulation.robot.mass / KICK_TIME if is_kick else 1.0) * force / weight
        length = size * float(np.clip(ARROW_GAIN * fraction, *ARROW_LENGTHS))
        tail = tip - length * vector / force
        found.append(Mark("push", ARROW, tail, tip, 0.035 * size, PUSH.colour, float(opacity)))
    return found


def foothold_mark(point: np.ndarray, size: float) -> Mark:
    """The mark of a foothold (3,) that a controller means to step on; `size` is the CoM height."""
    return _disc("foothold", point, 0.085 * size, 0.003 * size, FOOTHOLD.colour)


def draw(scene: mujoco.MjvScene, found: list[Mark]) -> None:
    """Append marks to a scene, as far as it has room."""
    for mark in found:
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        rgba = np.array([*mark.colour, mark.opacity], dtype=np.float32)
        size = np.array([mark.radius, 0.0, 0.0])
        if mark.shape == DISC:
            size[1] = mark.radius
        mujoco.mjv_initGeom(geom, mark.shape, size, mark.start, np.eye(3).ravel(), rgba)
        if mark.shape != SPHERE:
            # MuJoCo draws an arrow at half the length given
            end = 2.0 * mark.end - mark.start if mark.shape == ARROW else mark.end
            mujoco.mjv_connector(geom, mark.shape, mark.radius, mark.start, end)
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        geom.specular, geom.shininess, geom.emission = 0.1, 0.2, 0.3
        scene.ngeom += 1


def _disc(name: str, point: np.ndarray, radius: float, height: float, colour: RGB) -> Mark:
    """A disc at `point` (3,), which sticks out of the ground by `height`."""
    return Mark(name, DISC, point, point + [0.0, 0.0, height], radius, colour)
