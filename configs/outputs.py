"""What a command is to write: refused before anything is computed, and nothing is made."""

import errno
import os
from pathlib import Path

from .errors import ConfigError, WriteError
from .reading import exists, is_folder, whole_path

NAME = "PC_NAME_MAX"  # bytes of a name in a folder


def check_out_folder(out: str | Path, field: str = "out") -> None:
    """Refuse a folder that cannot be written to; it need not exist yet.

    Raises:
        ConfigError: it is a file, or no file can have this name.
        WriteError: nothing may be written there.
    """
    _check_named(out, field)
    if exists(out) and not is_folder(out):
        raise ConfigError("is not a folder", source=out, field=field)
    _check_place(out, Path(out))


def check_out_file(out: str | Path, field: str = "out") -> None:
    """Refuse a file that cannot be written; neither it nor its folder need exist yet.

    Raises ConfigError and WriteError as `check_out_folder`, ConfigError for a folder.
    """
    _check_named(out, field)
    if is_folder(out):
        raise ConfigError("is a folder: name a file", source=out, field=field)
    _check_place(out, Path(out).parent)


def _check_named(out: str | Path, field: str) -> None:
    if not str(out):
        raise ConfigError("must not be empty", field=field)
    whole_path(out, field=field)


def _check_place(out: str | Path, folder: Path) -> None:
    """Refuse `out` if nothing can be written in `folder`, or in the nearest one above it."""
    while not exists(folder) and folder != folder.parent:
        folder = folder.parent
    if not is_folder(folder):
        problem = errno.ENOTDIR
    elif not os.access(folder, os.W_OK | os.X_OK):
        problem = errno.EROFS if os.statvfs(folder).f_flag & os.ST_RDONLY else errno.EACCES
    elif any(len(os.fsencode(part)) > os.pathconf(folder, NAME) for part in Path(out).parts):
        problem = errno.ENAMETOOLONG
    else:
        return
    raise WriteError(out, os.strerror(problem))
