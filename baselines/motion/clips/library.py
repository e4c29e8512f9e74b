"""The clips that come with Poise, by name, and captured ones where they are found."""

import os
from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged_folder
from poise.configs.reading import is_file

PLACES = "POISE_CLIPS"  # environment variable: folders, with the system's separator between them
SHARED = "shared/motions"  # beside the repository


def packaged_clips() -> list[str]:
    """Names of the packaged BVH files, which `poise.training.motion.recording` makes."""
    return sorted(path.stem for path in packaged_folder("clips").glob("*.bvh"))


def walking_clips() -> list[str]:
    """Names of the packaged BVH files of walks, which a controller walked in the simulation, of the
    same skeleton: for motion matching (`poise.training.motion.gaits.recorded_walk`)."""
    return sorted(path.stem for path in (packaged_folder("clips") / "walks").glob("*.bvh"))


def captured_clips() -> dict[str, Path]:
    """Name → file of captured clips: of folders in `POISE_CLIPS`, and of ``../shared/motions``."""
    named = [Path(each) for each in os.environ.get(PLACES, "").split(os.pathsep) if each]
    beside = packaged_folder("clips").resolve().parents[2] / SHARED
    folders = [*named, beside, beside / "extra"]
    files = [path for folder in folders for path in sorted(folder.glob("*.bvh")) if is_file(path)]
    return {path.stem: path for path in reversed(files)}  # the first place wins


def known_clips() -> list[str]:
    """Return the names of all known clips, the packaged ones first."""
    return list(dict.fromkeys([*packaged_clips(), *walking_clips(), *sorted(captured_clips())]))


def find_bvh(name: str | Path) -> Path:
    """The file of a clip's name, packaged or captured, or the path of a .bvh file itself.

    Raises ConfigError, which lists the names, if there is neither.
    """
    names = packaged_clips()
    if str(name) in names:
        return packaged_folder("clips") / f"{name}.bvh"
    if str(name) in walking_clips():
        return packaged_folder("clips") / "walks" / f"{name}.bvh"
    path = Path(name)
    if path.suffix.lower() == ".bvh" and is_file(path):
        return path
    captured = captured_clips()
    if str(name) in captured:
        return captured[str(name)]
    problem = "no such file" if path.suffix or len(path.parts) > 1 else "no such name"
    raise ConfigError(
        f"{problem}: {shown(str(name))}; give a path to a .bvh file, a packaged name, or that of a "
        f"file in a folder of {PLACES}", field="clip", choices=known_clips(),
    )  # fmt: skip
