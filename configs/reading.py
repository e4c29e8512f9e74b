"""Untrusted files, read within bounds.

What comes back are plain values; everything else is a ConfigError of one line, naming the file:
a file that is missing, too large, no file at all, or not what it should be.
"""

import contextlib
import csv
import io
import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from .errors import ConfigError, PoiseError, shown
from .problems import Problem
from .yaml_loader import DEPTH, DIGITS, Loader

MIB = 1 << 20
POINTER = b"version https://git-lfs.github.com/spec/"  # that Git LFS leaves in a file's place
YAML_BYTES = 1 * MIB
JSON_BYTES = 16 * MIB
TABLE_BYTES = 128 * MIB  # trials of a benchmark: 40 MiB are 100,000
CELLS = 10_000_000  # of a table
OF_PROC = 1 * MIB  # at most, in a file that says it is empty


def is_file(path: str | Path) -> bool:
    """Return whether there is such a file; False for a name that no file can have."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):  # too long, or with a NUL
        return False


def is_folder(path: str | Path) -> bool:
    """Return whether there is such a folder; False for a name that no folder can have."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError):
        return False


def exists(path: str | Path) -> bool:
    """Return whether there is anything of this name; False for a name that nothing can have."""
    try:
        return Path(path).exists()
    except (OSError, ValueError):
        return False


def whole_path(
    path: str | Path, source: str | Path | None = None, field: str | None = None
) -> Path:
    """Return the absolute path, links followed, whether or not there is such a file.

    Raises ConfigError, about `field` of `source`, for a name that no file can have and for links
    that lead in a circle (from Python 3.13 on such a path is that of no file).
    """
    try:
        return Path(path).resolve()
    except ValueError:  # a NUL, half of a character
        problem = "is no name of a file"
    except (OSError, RuntimeError):
        problem = "leads in a circle of links"
    raise ConfigError(f"{problem}: {shown(str(path))}", source=source, field=field)


@contextlib.contextmanager
def parsing(path: str | Path, why: str = "cannot be read") -> Iterator[None]:
    """Turn any parser error into one ConfigError that names the file."""
    try:
        yield
    except PoiseError:
        raise
    except Exception as error:
        raise ConfigError(f"{why} ({type(error).__name__}: {error})", source=path) from None


def read_bytes(path: str | Path, limit: int) -> bytes:
    """Return the content of a regular file of at most `limit` bytes; a pipe or a device is none.

    Raises:
        ConfigError: no such file, no permission, no file, a larger one, a pointer of Git LFS.
    """
    try:
        # without O_NONBLOCK a pipe would be waited for
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            found = os.fstat(number)
            if not stat.S_ISREG(found.st_mode):
                raise Problem("unreadable", path, why="not a regular file")
            # as much memory is taken as may be read; files of /proc say that they are empty
            size = max(found.st_size, OF_PROC)
            with open(number, "rb", closefd=False) as file:
                data = file.read(min(limit, size) + 1)
        finally:
            os.close(number)
    except OSError as error:
        raise Problem("unreadable", path, why=error.strerror) from None
    except ValueError:
        raise Problem("unreadable", path, why="no name of a file") from None
    if len(data) > limit:
        raise ConfigError(f"is larger than {limit / MIB:g} MiB", source=path)
    if data.startswith(POINTER):
        raise ConfigError("is a pointer of Git LFS, not the file itself: run git lfs pull in its "
                          "checkout", source=path)  # fmt: skip
    return data


def read_text(path: str | Path, limit: int) -> str:
    """The UTF-8 text in a file of at most `limit` bytes; raises ConfigError as `read_bytes`."""
    with parsing(path):
        return read_bytes(path, limit).decode()


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises:
        ConfigError: the file is missing or larger than 1 MiB, does not parse, is nested too deep,
            repeats itself too often by aliases, or holds something else than a mapping.
    """
    text = read_bytes(path, YAML_BYTES)
    try:
        data = yaml.load(text, Loader=Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ConfigError(f"not valid YAML: {place}{error.problem}", source=path) from None
    except yaml.reader.ReaderError as error:
        line, why = text[: error.position].count(b"\n") + 1, "not UTF-8: save the file as UTF-8"
        if "octet" not in error.reason and "byte" not in error.reason:
            why = f"the character U+{error.character:04X} is none of YAML's"
        raise ConfigError(f"not valid YAML: line {line}: {why}", source=path) from None
    except Exception as error:
        raise ConfigError(f"not valid YAML: {error}", source=path) from None
    if not isinstance(data, dict):
        found = "nothing" if data is None else type(data).__name__
        raise ConfigError(f"must hold a mapping of fields, found {found}", source=path)
    return data


def read_json(path: str | Path) -> dict[str, Any]:
    """Return the mapping in a JSON file.

    Raises:
        ConfigError: the file is missing or larger than 16 MiB, does not parse, is nested too deep,
            or holds something else than a mapping.
    """
    text = read_text(path, JSON_BYTES)
    try:
        data = parse_json(text)
    except ValueError as error:
        raise ConfigError(f"is not valid JSON: {error}", source=path) from None
    if not isinstance(data, dict):
        raise ConfigError("must be a mapping", source=path)
    return data


def parse_json(text: str | bytes) -> Any:
    """Return a JSON value of at most 64 levels whose whole numbers have at most 308 digits.

    Raises ValueError for everything else.
    """
    try:
        value = json.loads(text, parse_int=_whole)
    except RecursionError:
        raise ValueError(f"more than {DEPTH} levels") from None
    level = [value]
    for _ in range(DEPTH):
        level = [child for each in level for child in _children(each)]
        if not level:
            return value
    raise ValueError(f"more than {DEPTH} levels")


def _whole(digits: str) -> int:
    if len(digits) > DIGITS:
        raise ValueError(f"a number of more than {DIGITS} digits")
    return int(digits)


def _children(value: Any) -> list[Any]:
    """Return the lists and mappings in a list or a mapping."""
    entries = value.values() if isinstance(value, dict) else value
    if not isinstance(value, (list, dict)):
        return []
    return [each for each in entries if isinstance(each, (list, dict))]


def read_lines(path: str | Path) -> Iterator[bytes]:
    """Return the lines of a file of at most 128 MiB; raises ConfigError as `read_bytes`."""
    return iter(io.BytesIO(read_bytes(path, TABLE_BYTES)))


def read_table(path: str | Path, advice: str = "") -> tuple[tuple[str, ...], list[dict[str, str]]]:
    """Return the columns of a CSV file, and its lines by column.

    Raises:
        ConfigError: the file is missing or larger than 128 MiB, is no table, or has a line of
            another number of columns than the first, to which the text adds the `advice`.
    """
    text = read_text(path, TABLE_BYTES)
    rows: list[dict[str, str]] = []
    with parsing(path, "is no table"):
        reader = csv.DictReader(io.StringIO(text, newline=""))
        columns = tuple(reader.fieldnames or ())
        for row in reader:
            if len(row) != len(columns) or None in row.values():
                line = f"line {reader.line_num} has another number of columns than the first"
                raise ConfigError(line + advice, source=path)
            rows.append(row)
            if len(rows) * len(columns) > CELLS:
                raise ConfigError(f"has more than {CELLS} cells", source=path)
    return columns, rows
