"""Read an MJCF file, also when mesh and texture files that only serve the eye are absent."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.reading import is_file

from .mjcf_bounds import MjcfText, check_spec


def read_mjcf(path: Path, feet: tuple[str, ...], source: str) -> mujoco.MjSpec:
    """The model in an MJCF file, without meshes and textures whose files are missing.

    A geom with a missing mesh is dropped, with a warning if it would have collided. That is refused
    for a foot, and for a geom that gives its body mass.

    Args:
        path: the MJCF file.
        feet: names of the foot bodies.
        source: the description file, for errors.

    Raises:
        ConfigError: the file is missing or does not parse, is larger than a robot's model is, or
            a missing mesh matters.
    """
    if not is_file(path):
        raise ConfigError(f"no such file: {path}", source=source, field="source.mjcf")
    MjcfText(path, source)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except Exception as error:  # of the XML, of MuJoCo, of the text in it
        raise ConfigError(
            f"{path} is not valid MJCF: {error}", source=source, field="source.mjcf"
        ) from None
    check_spec(spec, path.parent, source)
    _drop_missing_textures(spec, path)
    _drop_missing_meshes(spec, path, feet, source)
    return spec


def _drop_missing_meshes(
    spec: mujoco.MjSpec, path: Path, feet: tuple[str, ...], source: str
) -> None:
    folder = path.parent / spec.meshdir
    missing = {m.name for m in spec.meshes if m.file and not (folder / m.file).is_file()}
    lost = []
    for geom in [g for g in spec.geoms if g.meshname in missing]:
        body = geom.parent
        solid = bool(geom.contype or geom.conaffinity)
        massive = geom.mass > 0 if np.isfinite(geom.mass) else geom.density > 0
        if solid and body.name in feet:
            reason = f"the foot {body.name!r} collides with it"
        elif massive and not body.explicitinertial and body.name != "world":
            reason = f"it gives the body {body.name!r} its mass"
        else:
            if solid:
                lost.append(body.name)
            spec.delete(geom)
            continue
        raise ConfigError(
            f"the file of mesh {geom.meshname!r} is missing in {folder}, and {reason}",
            source=source,
            field="source.mjcf",
        )
    for mesh in [m for m in spec.meshes if m.name in missing]:
        spec.delete(mesh)
    if lost:
        warnings.warn(
            f"{path}: mesh files are missing; these bodies lose collision geometry: "
            + ", ".join(dict.fromkeys(lost)),
            stacklevel=2,
        )


def _drop_missing_textures(spec: mujoco.MjSpec, path: Path) -> None:
    folder = path.parent / spec.texturedir
    missing = {
        t.name
        for t in spec.textures
        if any(f and not (folder / f).is_file() for f in [t.file, *t.cubefiles])
    }
    for material in spec.materials:
        material.textures = ["" if name in missing else name for name in material.textures]
    for texture in [t for t in spec.textures if t.name in missing]:
        spec.delete(texture)
