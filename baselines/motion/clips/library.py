"""The clips that come with Poise, by name; each has its licence beside it."""

from __future__ import annotations

from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged_folder
from poise.configs.reading import is_file


def packaged_clips() -> list[str]:
    """Names of the packaged BVH files; configs/clips/SOURCES.md says whose they are."""
    return sorted(path.stem for path in packaged_folder("clips").glob("*.bvh"))


def find_bvh(name: str | Path) -> Path:
    """The file of a packaged clip's name, or the path of a .bvh file itself.

    Raises ConfigError, which lists the packaged names, if there is neither.
    """
    names = packaged_clips()
    if str(name) in names:
        return packaged_folder("clips") / f"{name}.bvh"
    path = Path(name)
    if path.suffix.lower() == ".bvh" and is_file(path):
        return path
    problem = "no such file" if path.suffix or len(path.parts) > 1 else "no such name"
    raise ConfigError(f"{problem}: {shown(str(name))}; give a path to a .bvh file or a packaged "
                      "name", field="clip", choices=names)  # fmt: skip
