"""Missing files of meshes, textures, height fields and skins, as MuJoCo looks for them."""

import re
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, PoiseWarning

Asset = Any  # MuJoCo's mesh, texture, height field or skin of a spec
TETRAHEDRON = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
_UNOPENED = re.compile(r"Error opening file '(.*)'")


def drop_missing(spec: mujoco.MjSpec, path: Path, feet: tuple[str, ...]) -> None:
    """Take what has a missing file out of a model, with one warning that names it.

    MuJoCo itself decides what is missing: it alone knows the folders of included and attached
    files. Where it opens every file, nothing is changed. `path` is the model's file, for the
    warning; `feet` are the names of the foot bodies.

    Raises:
        ConfigError: a foot collides with a missing mesh, or a body has its mass from it.
    """
    if unopened(spec.copy()) is None:  # a mesh that MuJoCo has read keeps faces of it
        return
    missing: dict[str, dict[str, str]] = {}
    files: list[str] = []
    for kind, assets in _assets(spec).items():
        missing[kind] = {}
        for i, asset in enumerate(assets):  # each is tried alone
            if _files(asset) and (file := unopened(_alone(spec, kind, i))) is not None:
                missing[kind][asset.name] = file
                files += [] if file in files else [file]
    bodies = _drop_meshes(spec, missing["mesh"], feet)
    _drop_textures(spec, set(missing["texture"]))
    _drop_height_fields(spec, set(missing["hfield"]))
    for skin in [skin for skin in spec.skins if skin.name in missing["skin"]]:
        spec.delete(skin)
    warnings.warn(
        f"{path}: {len(files)} files are missing ({', '.join(files[:3])}"
        f"{', …' if len(files) > 3 else ''}), and what is drawn with them; these bodies lose "
        f"collision geometry: {', '.join(bodies) or 'none'}",
        PoiseWarning,
        stacklevel=4,
    )


def unopened(spec: mujoco.MjSpec) -> str | None:
    """The first file that MuJoCo cannot open for this model, as it names it; None: all are there,
    or something else is wrong, which the model's compilation will say."""
    try:
        spec.compile()
    except Exception as error:  # whatever MuJoCo has
        found = _UNOPENED.search(str(error))
        return found[1] if found else None
    return None


def _assets(spec: mujoco.MjSpec) -> dict[str, list[Asset]]:
    return {"mesh": list(spec.meshes), "texture": list(spec.textures),
            "hfield": list(spec.hfields), "skin": list(spec.skins)}  # fmt: skip


def _alone(spec: mujoco.MjSpec, kind: str, number: int) -> mujoco.MjSpec:
    """The model with all its assets made up, but for one."""
    copy = spec.copy()
    for each, assets in _assets(copy).items():
        for i, asset in enumerate(assets):
            if (each, i) != (kind, number):
                _make_up(copy, asset)
    return copy


def _files(asset: Asset) -> list[str]:
    return [file for file in (asset.file, *getattr(asset, "cubefiles", ())) if file]


def _make_up(spec: mujoco.MjSpec, asset: Asset) -> None:
    """Give an asset something quick instead of a file or a large pattern."""
    asset.file = ""
    if isinstance(asset, mujoco.MjsMesh):
        asset.uservert = TETRAHEDRON
        asset.userface = asset.usernormal = asset.usertexcoord = []
    elif isinstance(asset, mujoco.MjsTexture):
        asset.builtin, asset.width, asset.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 0
        asset.type, asset.cubefiles = mujoco.mjtTexture.mjTEXTURE_CUBE, [""] * 6
    elif isinstance(asset, mujoco.MjsHField):
        asset.nrow = asset.ncol = 2
        asset.userdata = [0.0] * 4
    else:
        spec.delete(asset)


def _drop_meshes(spec: mujoco.MjSpec, missing: dict[str, str], feet: tuple[str, ...]) -> list[str]:
    """The bodies that lose a shape which would have collided."""
    bodies = []
    for geom in [geom for geom in spec.geoms if geom.meshname in missing]:
        body = geom.parent
        solid = bool(geom.contype or geom.conaffinity) or geom.name in paired_geoms(spec)
        massive = geom.mass > 0 if np.isfinite(geom.mass) else geom.density > 0
        if solid and body.name in feet:
            reason = f"the foot {body.name!r} collides with it"
        elif massive and not body.explicitinertial and body.name != "world":
            reason = f"it gives the body {body.name!r} its mass"
        else:
            if solid:
                bodies.append(body.name)
            for pair in [p for p in spec.pairs if geom.name in (p.geomname1, p.geomname2)]:
                spec.delete(pair)
            spec.delete(geom)
            continue
        raise ConfigError(
            f"the file {missing[geom.meshname]} of mesh {geom.meshname!r} is missing, and {reason}"
        )
    for mesh in [mesh for mesh in spec.meshes if mesh.name in missing]:
        spec.delete(mesh)
    return list(dict.fromkeys(bodies))


def paired_geoms(spec: mujoco.MjSpec) -> set[str]:
    """Geoms that collide by a contact pair."""
    return {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}


def _drop_textures(spec: mujoco.MjSpec, missing: set[str]) -> None:
    for material in spec.materials:
        material.textures = ["" if name in missing else name for name in material.textures]
    for texture in [texture for texture in spec.textures if texture.name in missing]:
        spec.delete(texture)


def _drop_height_fields(spec: mujoco.MjSpec, missing: set[str]) -> None:
    for field in [field for field in spec.hfields if field.name in missing]:
        if any(geom.hfieldname == field.name for geom in spec.geoms):
            raise ConfigError(
                f"the file of the height field {field.name!r} is missing, and a geom is made of it"
            )
        spec.delete(field)
