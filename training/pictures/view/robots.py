"""Robots in viser's scene: the bodies of one model, drawn once for each robot."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import trimesh
import viser
from mjviser.conversions import get_geom_texture_id, merge_geoms

from poise.envs.robots.robot import Robot
from poise.envs.viewing.appearance import looks
from poise.envs.viewing.quantities import RGB
from poise.training.pictures.sessions.frames import Frame
from poise.training.pictures.sessions.ghost import Poses

from .marks import linear

AZIMUTH = 50.0  # of the lamp in the copy of the model, which viser does not use
VISIBLE_GROUPS = 3  # of geoms, as in MuJoCo's own viewer
Mesh = viser.BatchedMeshHandle | viser.BatchedGlbHandle


@dataclass(frozen=True)
class BodyMesh:
    """A part of a body in one colour, or with textures; one instance for each robot."""

    body: int
    handle: Mesh


class Robots:
    """`count` robots of one kind below the scene's node `root`; `meshes` are to be clicked on.

    Args:
        scene: of the server.
        root: name of the node that they stand below.
        robot: their kind.
        count: of robots.
        opacity: with less than 1, marks inside of them are seen; textures are always opaque.
        colour: of all of it, without textures; None: as described.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        root: str,
        robot: Robot,
        count: int,
        opacity: float = 1.0,
        colour: RGB | None = None,
    ):
        self._scene, self._opacity, self._colour = scene, opacity, colour
        self.model = looks(robot, 16, 16, AZIMUTH)
        self._still = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3))
        self.meshes = [
            BodyMesh(body, self._add(f"{root}/bodies/{body}_{k}", geoms))
            for body in range(1, self.model.nbody)
            for k, geoms in enumerate(_parts(self.model, body))
        ]

    def show(self, frames: Sequence[Frame | Poses], offsets: np.ndarray) -> None:
        """Put each robot where its frame says, moved by its offset (count, 3) [m]."""
        positions = np.stack([f.positions for f in frames], axis=1) + offsets  # (nbody, count, 3)
        quaternions = np.stack([f.quaternions for f in frames], axis=1)
        for mesh in self.meshes:
            mesh.handle.batched_positions = positions[mesh.body]
            mesh.handle.batched_wxyzs = quaternions[mesh.body]

    def set_opacity(self, opacity: float) -> None:
        """Make the robots transparent, or opaque again."""
        for mesh in self.meshes:
            if isinstance(mesh.handle, viser.BatchedMeshHandle):
                mesh.handle.opacity = _opacity(opacity)

    def set_visible(self, visible: bool) -> None:
        """Show the robots, or hide them."""
        for mesh in self.meshes:
            mesh.handle.visible = visible

    def _add(self, name: str, geoms: list[int]) -> Mesh:
        mesh = merge_geoms(self.model, geoms)
        wxyzs, positions = self._still
        colour = self._colour
        if colour is None:
            if get_geom_texture_id(self.model, geoms[0]) >= 0:
                return self._scene.add_batched_meshes_trimesh(
                    name, mesh, wxyzs, positions, lod="off"
                )
            assert isinstance(mesh.visual, trimesh.visual.ColorVisuals)
            colour = tuple(np.asarray(mesh.visual.vertex_colors)[0, :3] / 255.0)
        return self._scene.add_batched_meshes_simple(
            name, mesh.vertices, mesh.faces, wxyzs, positions, batched_colors=linear(colour),
            lod="off", opacity=_opacity(self._opacity),
        )  # fmt: skip


def _opacity(opacity: float) -> float | None:
    """As viser takes it: None is opaque, and drawn faster."""
    return opacity if opacity < 1.0 else None


def _parts(model: mujoco.MjModel, body: int) -> list[list[int]]:
    """Return the visible geoms of a body, those together that are drawn as one mesh."""
    parts: dict[tuple[object, ...], list[int]] = {}
    first = model.body_geomadr[body]
    for geom in range(first, first + model.body_geomnum[body]):
        if model.geom_group[geom] < VISIBLE_GROUPS and model.geom_rgba[geom, 3] > 0.0:
            parts.setdefault(_look(model, geom), []).append(geom)
    return list(parts.values())


def _look(model: mujoco.MjModel, geom: int) -> tuple[object, ...]:
    texture, material = get_geom_texture_id(model, geom), int(model.geom_matid[geom])
    if texture >= 0:
        return ("texture", texture)
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return tuple(np.round(rgba, 4).tolist())
