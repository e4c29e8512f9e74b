"""The marks of `envs/viewing/overlays.py` in viser's scene."""

from collections.abc import Iterable, Sequence
from functools import cache

import mujoco
import numpy as np
import trimesh
import viser

from poise.envs.viewing.overlays import ARROW, SPHERE, Mark
from poise.envs.viewing.quantities import Quantity
from poise.training.pictures.figures.palette import linear_rgb

ROOM = {"spheres": 2, "cylinders": 32, "heads": 10}  # mesh → instances for each robot
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0], np.float32)
HEAD = 0.3  # of an arrow's length, at most
HEAD_WIDTH = 2.2  # over the radius of its shaft
LIFT = 0.002  # [m] over the ground, so that what lies on it is not hidden by it
Placed = tuple[np.ndarray, np.ndarray, np.ndarray, Mark]  # start, end, scale, mark


class MarkSet:
    """All marks of one shape: instances of one mesh, as many as there is room for.

    Unused marks have no size: the browser rebuilds all of them when their number or opacity
    changes. So a mark that fades becomes thinner.
    """

    def __init__(self, scene: viser.SceneApi, name: str, mesh: trimesh.Trimesh, room: int):
        self._room = room
        self.handle = scene.add_batched_meshes_simple(
            name, mesh.vertices, mesh.faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (room, 1)), np.zeros((room, 3)),
            batched_scales=np.zeros((room, 3)),
            batched_colors=np.zeros((room, 3), dtype=np.uint8),
            lod="off", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def show(self, placed: Sequence[Placed]) -> None:
        """Show these and nothing else, as far as there is room."""
        room = self._room
        positions, scales = np.zeros((2, room, 3), np.float32)
        wxyzs, colours = np.tile(NO_TURN, (room, 1)), np.zeros((room, 3), np.uint8)
        for k, (start, end, scale, mark) in enumerate(placed[:room]):
            positions[k], scales[k] = start, scale * [mark.opacity, mark.opacity, 1.0]
            wxyzs[k], colours[k] = _along(end - start), linear(mark.colour)
        self.handle.batched_positions, self.handle.batched_wxyzs = positions, wxyzs
        self.handle.batched_scales, self.handle.batched_colors = scales, colours


class SceneMarks:
    """The marks of `count` robots below the scene's node `root`; `hidden` are not shown."""

    def __init__(self, scene: viser.SceneApi, root: str, count: int):
        cylinder = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=24)
        cylinder.apply_translation([0.0, 0.0, 0.5])
        meshes = {
            "spheres": trimesh.creation.icosphere(subdivisions=3, radius=1.0),
            "cylinders": cylinder,
            "heads": trimesh.creation.cone(radius=1.0, height=1.0, sections=24),
        }
        self.sets = {
            name: MarkSet(scene, f"{root}/marks/{name}", mesh, count * ROOM[name])
            for name, mesh in meshes.items()
        }
        self.hidden: set[Quantity] = set()

    def show(self, found: Iterable[tuple[Mark, np.ndarray]]) -> None:
        """Show marks, each moved by an offset (3,) [m]."""
        left_out = {quantity.colour for quantity in self.hidden}
        placed: dict[str, list[Placed]] = {name: [] for name in self.sets}
        for mark, offset in found:
            if mark.colour not in left_out:
                for name, start, end, scale in _parts(mark):
                    placed[name].append((start + offset, end + offset, scale, mark))
        for name, each in self.sets.items():
            each.show(placed[name])


Part = tuple[str, np.ndarray, np.ndarray, np.ndarray]  # mesh, start, end, scale


def _parts(mark: Mark) -> list[Part]:
    """What a mark is made of; an arrow of a shaft and a head, its tip is the mark's end."""
    if mark.shape == SPHERE:
        return [("spheres", mark.start, mark.start, np.full(3, mark.radius))]
    length = float(np.linalg.norm(mark.end - mark.start))
    if mark.shape != ARROW:
        up = np.array([0.0, 0.0, LIFT])
        scale = np.array([mark.radius, mark.radius, length])
        return [("cylinders", mark.start + up, mark.end + up, scale)]
    if length < 1e-6:
        return []
    width = mark.radius * HEAD_WIDTH
    head = min(HEAD * length, 3.0 * width)
    neck = mark.end - head / length * (mark.end - mark.start)
    shaft, cone = np.array([mark.radius] * 2 + [length - head]), np.array([width, width, head])
    return [("cylinders", mark.start, neck, shaft), ("heads", neck, mark.end, cone)]


@cache
def linear(colour: tuple[float, ...]) -> np.ndarray:
    """A colour (3,) of 0 to 1 as viser's instances take it: uint8 in linear RGB, not in sRGB."""
    return np.rint(255.0 * linear_rgb(colour)).astype(np.uint8)


def _along(vector: np.ndarray) -> np.ndarray:
    """Return a quaternion (4,), w first, that turns the z axis towards `vector` (3,)."""
    quaternion = NO_TURN.astype(float)
    if vector.any():
        mujoco.mju_quatZ2Vec(quaternion, vector)
    return quaternion
