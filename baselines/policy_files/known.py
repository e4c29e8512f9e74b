"""Public policies that are known: where their networks are looked for, and found by their sums."""

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from poise.baselines.allowance import is_script
from poise.configs.errors import ConfigError
from poise.configs.files import packaged, packaged_folder, resolve
from poise.configs.reading import is_folder, read_bytes, read_yaml
from poise.configs.schema import build, on_base

from .config import KnownFile, Origin, PolicyFileConfig
from .onnx.files import BYTES, ONNX

RIVALS = "rivals"  # folder of descriptions of policies of others, which are for one robot each
GUARDS = "guards"  # folder of recovery policies that take over from such a one
PLACES = "POISE_POLICIES"  # environment variable: folders, with the system's separator between them
SHARED = "shared/rivals"  # beside the repository
FILES = 20_000  # that are looked at in a place


class Found(NamedTuple):
    """What the places have of a known policy."""

    network: Path | None  # with the known sums, its other files beside it
    others: tuple[Path, ...]  # of the same name, with another content


class Known(NamedTuple):
    """A public policy that is described."""

    name: str
    origin: Origin
    period: float  # of the policy [s]


def known_policies() -> list[Known]:
    """The packaged descriptions of policies that others publish; no network is looked for."""
    found = []
    for name in packaged(RIVALS):
        path = resolve(RIVALS, name)
        data = on_base(read_yaml(path), RIVALS, path)
        period = data.get("policy_period", PolicyFileConfig.policy_period)
        found.append(Known(name, build(Origin, data.get("origin", {}), f"{path}: origin"), period))
    return found


def places(origin: Origin) -> list[Path]:
    """The folders in which the network is looked for, in this order.

    Those of the environment variable `POISE_POLICIES`; a checkout of the project here or beside
    the repository of Poise; ``shared/rivals`` beside the latter.
    """
    named = [Path(each) for each in os.environ.get(PLACES, "").split(os.pathsep) if each]
    project = origin.project.rpartition("/")[2]
    beside = packaged_folder(RIVALS).resolve().parents[2]
    folders = [*named, Path.cwd() / project, beside / project, beside / SHARED]
    return [folder for folder in dict.fromkeys(folders) if is_folder(folder)]


def find_network(origin: Origin) -> Found:
    """The network of a known policy, by its sums, whatever it is called in its place."""
    (name, known), *beside = origin.files.items()
    others: list[Path] = []
    for folder in places(origin):
        for path in _networks(folder):
            same = _is(path, known) and all(_is(path.with_name(n), k) for n, k in beside)
            if same:
                return Found(path, ())
            if path.name == name and (origin.folder in path.as_posix() if origin.folder else True):
                others.append(path)
    return Found(None, tuple(others))


def expect_network(origin: Origin, name: str) -> Path:
    """The same; raises ConfigError, which says how to get it, where it is not there."""
    found = find_network(origin)
    if found.network is not None:
        return found.network
    hint = ""
    if found.others:
        hint = (f"{found.others[0]} has another checksum than the known one, and runs only when "
                f"you give its path (base: {name}, policy: PATH in a .yaml file); ")  # fmt: skip
    raise ConfigError(f"the network of {name} is not here, nor in a folder of {PLACES}: {hint}get "
                      f"it by: {how_to_get(origin)}", source=name, field="policy")  # fmt: skip


def how_to_get(origin: Origin) -> str:
    """The line that fetches a policy to where it is looked for."""
    project = origin.project.rpartition("/")[2]
    return (f"git clone https://github.com/{origin.project} && git -C {project} checkout "
            f"{origin.commit}")  # fmt: skip


def _networks(folder: Path) -> Iterator[Path]:
    """The networks below a folder, at most so many files looked at; hidden folders are not."""
    seen = 0
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            seen += 1
            if seen > FILES:
                return
            if Path(name).suffix in ONNX or is_script(name):
                yield Path(place) / name


def _is(path: Path, known: KnownFile) -> bool:
    """Return whether a file has this size and sum."""
    try:
        if path.stat().st_size != known.bytes:
            return False
        return hashlib.sha256(read_bytes(path, BYTES)).hexdigest() == known.sha256
    except (OSError, ValueError, ConfigError):  # it is gone, or not to be read
        return False
