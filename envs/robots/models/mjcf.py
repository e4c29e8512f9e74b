"""Read an MJCF file, also when mesh and texture files that only serve the eye are absent."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from poise.configs.errors import ConfigError, naming
from poise.configs.reading import is_file, read_text

from .missing import drop_missing
from .mjcf_bounds import MJCF_BYTES, MjcfText, check_spec, tags

SCENE_ELEMENTS = {"pair": "contact pairs", "key": "keyframes"}  # that a scene file often holds


def read_mjcf(path: Path, feet: tuple[str, ...]) -> mujoco.MjSpec:
    """The model in an MJCF file, as MuJoCo reads it by its absolute path.

    What needs a missing file is dropped with a warning, see `drop_missing`. That is refused for a
    mesh that a foot, one of these bodies, collides with, or that gives a body its mass.

    Raises:
        ConfigError: the file is missing or does not parse, is larger than a robot's model is, or
            a missing mesh matters.
    """
    with naming(field="source.mjcf"):
        if not is_file(path):
            raise ConfigError(f"no such file: {path}")
        path = Path(os.path.abspath(path))  # by a relative one MuJoCo misses what an include names;
        text = MjcfText(path)  # and links stay, beside which a package keeps the meshes
        try:
            spec = mujoco.MjSpec.from_file(str(path))
        except Exception as error:  # of the XML, of MuJoCo, of the text in it
            raise ConfigError(f"{path} is not valid MJCF: {error}") from None
        check_spec(spec, text.folders)
        drop_missing(spec, path, feet)
    return spec


@contextmanager
def pointing_to_scenes(path: Path | None, element: str) -> Iterator[None]:
    """A ConfigError raised meanwhile also names the scene files that may be what was meant.

    `path` is the robot's MJCF file, if it has one; a scene may add an `element` to it, a key of
    `SCENE_ELEMENTS`.
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
