"""Read an MJCF file, also when mesh and texture files that only serve the eye are absent."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.reading import is_file, read_text

from .mjcf_bounds import MJCF_BYTES, MjcfText, check_spec, tags

SCENE_ELEMENTS = {"pair": "contact pairs", "key": "keyframes"}  # that a scene file often holds


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


@contextmanager
def pointing_to_scenes(path: Path | None, element: str) -> Iterator[None]:
    """A ConfigError raised meanwhile also names the scene files that may be what was meant.

    Args:
        path: the MJCF file of the robot; None: there is none.
        element: what a scene file may add to it, a key of `SCENE_ELEMENTS`.
    """
    try:
        yield
    except ConfigError as error:
        scenes = ", ".join(scenes_with(path, element)) if path else ""
        if not scenes:
            raise
        raise ConfigError(
            f"{error.message}; {scenes} beside {path.name} includes it and has "  # type: ignore[union-attr]
            + SCENE_ELEMENTS[element],
            source=error.source,
            field=error.field,
            choices=error.choices,
        ) from None


def scenes_with(path: Path, element: str) -> list[str]:
    """Names of the files beside an MJCF file that include it and hold `element`: ``key``, say."""
    found = []
    for beside in sorted(path.parent.glob("*.xml")):
        if beside == path:
            continue
        try:
            held = list(tags(read_text(beside, MJCF_BYTES)))
        except ConfigError:  # whatever it is, it is no scene
            continue
        includes = any(
            name == "include" and attributes.get("file") == path.name
            for _, name, attributes, _ in held
        )
        if includes and any(name == element for _, name, _, _ in held):
            found.append(beside.name)
    return found


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
