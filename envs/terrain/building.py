"""Terrain in MuJoCo: a box under every surface."""

import mujoco
import numpy as np

from .terrain import Surface, Terrain

THICKNESS = 0.05  # [m] of a box below the floor; half of that of a slanting one
SHADES = ((0.80, 0.82, 0.84, 1.0), (0.70, 0.72, 0.75, 1.0))
BUILT = "terrain_"  # prefix of the geoms, the surface's number behind it
ALIKE = (  # what a box has of the plane beneath it
    *("contype", "conaffinity", "condim", "priority", "margin", "gap", "solmix"),
    *("friction", "solref", "solimp"),
)


def build_terrain(spec: mujoco.MjSpec, terrain: Terrain, ground: str) -> None:
    """Add the surfaces to a model whose plane is called `ground`, which becomes the floor."""
    plane = next(geom for geom in spec.worldbody.geoms if geom.name == ground)
    floor = terrain.floor()
    plane.pos[2] += floor
    pairs = [pair for pair in spec.pairs if ground in (pair.geomname1, pair.geomname2)]
    for i, surface in enumerate(terrain.surfaces()):
        if surface.gradient == 0.0 and surface.height == floor:
            continue  # it is the plane's
        name = f"{BUILT}{i}"
        half, middle, quaternion = box_below(surface, floor)
        kind = mujoco.mjtGeom.mjGEOM_BOX
        box = spec.worldbody.add_geom(name=name, type=kind, size=half, pos=middle, quat=quaternion)
        box.material, box.rgba = "", SHADES[i % len(SHADES)]  # not the robot's
        for attribute in ALIKE:
            setattr(box, attribute, getattr(plane, attribute))
        for pair in pairs:
            _copy_pair(spec, pair, ground, name)


def box_below(surface: Surface, floor: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The box whose upper side is the surface, and which reaches down to the floor.

    Returns:
        (3,) half of its lengths, (3,) its middle [m], and (4,) its orientation, w first.
    """
    angle = np.arctan(surface.gradient)
    slant = 0.5 * (surface.x_max - surface.x_min) / np.cos(angle)
    depth = 2.0 * THICKNESS if surface.gradient else surface.height - floor + THICKNESS
    half = np.array([slant, 0.5 * (surface.y_max - surface.y_min), 0.5 * depth])
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    quaternion = np.array([np.cos(0.5 * angle), 0.0, -np.sin(0.5 * angle), 0.0])
    return half, surface.middle - half[2] * normal, quaternion


def _copy_pair(spec: mujoco.MjSpec, pair: mujoco.MjsPair, ground: str, name: str) -> None:
    """The contact pair of the plane for a box, too."""
    other = pair.geomname2 if pair.geomname1 == ground else pair.geomname1
    spec.add_pair(
        geomname1=name, geomname2=other, condim=pair.condim, friction=pair.friction,
        margin=pair.margin, gap=pair.gap, solref=pair.solref, solreffriction=pair.solreffriction,
        solimp=pair.solimp,
    )  # fmt: skip
