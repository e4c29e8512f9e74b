"""The files of a policy: where they lie, and the digest of their version."""

import hashlib
from pathlib import Path

from poise.baselines.allowance import SCRIPTS, is_script
from poise.configs.errors import ConfigError, shown
from poise.configs.reading import MIB, is_file, is_folder, read_bytes, whole_path

from .tensors import external_files

BYTES = 64 * MIB  # of each file
ONNX = (".onnx",)
DESCRIPTIONS = ("policy.yaml", "deploy.yaml", "params/deploy.yaml")
NETWORKS = ("", "exported", "params")  # folders in which frameworks put them


def is_network(path: Path) -> bool:
    """Return whether `path` is an ONNX file."""
    return path.suffix in ONNX and is_file(path)


def is_policy_place(name: str | Path) -> bool:
    """Return whether `name` is an ONNX file, or a folder that holds or describes a network."""
    path = Path(name)
    if not is_folder(path):
        return is_network(path)
    return any(is_file(path / each) for each in DESCRIPTIONS) or bool(networks(path))


def description(folder: Path) -> Path | None:
    """The YAML file that describes the policy in a folder."""
    return next((folder / each for each in DESCRIPTIONS if is_file(folder / each)), None)


def networks(folder: Path) -> list[Path]:
    """The ONNX files of a policy's folder; TorchScript where there is none."""
    files = [path for place in NETWORKS for path in sorted((folder / place).glob("*"))]
    onnx = [path for path in files if path.suffix in ONNX]
    return onnx or [path for path in files if is_script(path)]


def only_network(folder: Path, source: str | Path) -> Path:
    """The one network in a folder, links followed.

    Raises ConfigError where there is none, or several, or links lead in a circle.
    """
    found = networks(folder)
    if len(found) > 1:
        found = [path for path in found if path.stem == "policy"] or found
    if len(found) == 1:
        return whole_path(found[0], source, "policy")
    what = "several networks" if found else f"no network ({', '.join(ONNX + SCRIPTS)})"
    raise ConfigError(f"{what} in {folder}: say which", source=source, field="policy",
                      choices=[path.name for path in found] or None)  # fmt: skip


def digest(path: Path, source: str | Path) -> str:
    """SHA-256 (hexadecimal) of a network and of the files that its tensors are in.

    Raises ConfigError where it is no ONNX file, or one of these is missing, lies elsewhere than
    beside it, or is still to be fetched by Git LFS.
    """
    content = read_bytes(path, BYTES)
    found = hashlib.sha256(content)
    for name in () if is_script(path) else sorted(_outside(content, path)):  # whatever it is called
        if name in ("", "..") or Path(name).name != name:
            raise ConfigError(f"{path.name} has data in {shown(name)}, not beside it",
                              source=source, field="policy")  # fmt: skip
        if not is_file(path.with_name(name)):
            raise ConfigError(f"{path.name} needs the file {shown(name)} beside it, which is "
                              "missing", source=source, field="policy")  # fmt: skip
        found.update(read_bytes(path.with_name(name), BYTES))
    return found.hexdigest()


def _outside(content: bytes, path: Path) -> set[str]:
    """Names of the files that an ONNX file says its tensors are in."""
    try:
        return external_files(content)
    except ValueError as error:
        raise ConfigError(f"is no ONNX file ({error})", source=path) from None
