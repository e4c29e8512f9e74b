"""Files: packaged ones by name, and files that are written whole or not at all."""

import contextlib
import functools
import os
import shutil
import tempfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from .errors import ConfigError, WriteError, meant, shown
from .outputs import check_out_folder
from .problems import Problem
from .reading import is_file, is_folder

#: kind → suffixes that are accepted in addition to those of YAML
OTHERS = {"robots": (".xml", ".mjcf", ".urdf")}
#: kind → the field, or option, that names one of them
FIELDS = {
    "controllers": "controller", "envs": "env", "guards": "guard", "motions": "motion",
    "policies": "policy", "rivals": "policy", "robots": "robot", "suites": "suite",
}  # fmt: skip


def packaged(kind: str) -> list[str]:
    """Return names of the packaged configurations of one kind: ``packaged("robots")``.

    A configuration is a file, ``NAME.yaml``, or a folder, ``NAME/config.yaml`` (policies).
    """
    folder = packaged_folder(kind)
    return list(_names(folder, folder.stat().st_mtime_ns)) if folder.is_dir() else []


@functools.cache
def _names(folder: Path, changed: int) -> tuple[str, ...]:
    """Names in a folder as it was when it `changed` [ns]."""
    files = [path.stem for path in folder.glob("*.yaml")]
    return tuple(sorted(files + [path.parent.name for path in folder.glob("*/config.yaml")]))


def packaged_folder(kind: str) -> Path:
    """Return the folder of the packaged configurations of one kind."""
    return Path(str(files("poise.configs"))) / kind


def resolve(kind: str, name: str | Path) -> Path:
    """Return the YAML file of a packaged name (``humanoid``) or of a path to a ``.yaml`` file.

    Args:
        kind: folder of ``poise.configs``, such as ``robots`` or ``controllers``.
        name: a packaged name, or a path with a folder or a suffix in it; of a robot also that of
            its model.

    Raises:
        ConfigError: there is no such name or file; its text lists the packaged names.
    """
    names, field = packaged(kind), FIELDS.get(kind, kind)
    if not isinstance(name, (str, Path)):
        raise Problem("type", None, field, names, expected="a name or a path", value=shown(name))
    if str(name) in names:
        return packaged_folder(kind) / f"{name}.yaml"
    path = Path(name)
    if path.suffix.lower() in (".yaml", ".yml", *OTHERS.get(kind, ())) and is_file(path):
        return path
    if str(name) and is_folder(path):
        raise Problem("folder", None, field, names, value=shown(str(name)))
    problem = "no file" if path.suffix or len(path.parts) > 1 else "unknown name"
    hint = meant(name, names) or ";"
    raise Problem(problem, None, field, names, value=shown(str(name)), hint=hint)


def write_atomic(path: str | Path, content: str | bytes) -> None:
    """Write a file so that a reader, or a kill, sees the old content or the new, never a part.

    Missing folders are made.

    Raises:
        WriteError: the file cannot be written; the old content is then untouched.
    """
    path = Path(path)
    part = path.parent / f".{path.name}.{os.getpid()}.part"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.unlink(missing_ok=True)
        with open(part, "xb") as file:  # not through a link that a received folder has there
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        why = "it is a folder" if is_folder(path) else error.strerror
        raise WriteError(path, why) from None
    except ValueError:  # a NUL in its name
        raise WriteError(path, "no name of a file") from None
    finally:
        with contextlib.suppress(OSError, ValueError):  # its folder may be a file
            part.unlink(missing_ok=True)


def check_new_folder(out: str | Path) -> None:
    """Refuse what `check_out_folder` refuses, and, by ConfigError, a folder that is not empty."""
    out = Path(out)
    check_out_folder(out)
    with _writing(out):
        if is_folder(out) and any(out.iterdir()):
            raise ConfigError("is not empty: choose another folder", source=out, field="out")


@contextlib.contextmanager
def new_folder(out: str | Path) -> Iterator[Path]:
    """Yield a folder to fill, which is at `out` once the block has ended without an error.

    Until then, and after an error or a kill, there is nothing at `out`. Missing folders above it
    are made.

    Raises:
        ConfigError: `out` is a file, or a folder that is not empty.
        WriteError: it, or what the block writes, cannot be written.
    """
    out = Path(out)
    check_new_folder(out)
    with _writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
        try:
            part.chmod(0o755)
            yield part
            os.replace(part, out)
        finally:
            shutil.rmtree(part, ignore_errors=True)


@contextlib.contextmanager
def _writing(out: Path) -> Iterator[None]:
    """Turn the system's error for a folder that cannot be written into a WriteError."""
    try:
        yield
    except OSError as error:
        raise WriteError(out, error.strerror) from None
