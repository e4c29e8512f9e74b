"""Compile the kernels once, in processes of their own.

Several at once are done sooner than one, and a line says what is compiled.
"""

import contextlib
import gc
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

from poise.configs.errors import PoiseError
from poise.configs.files import write_atomic

from . import jit
from .sources import source_digest

_compiling = False  # whether this process is one of those that compile
_tried: set[str] = set()  # parts that this process has had compiled, or could not have


def fill_cache(module: str, names: Mapping[str, str], *groups: Sequence[str]) -> None:
    """Compile what is missing: each group is a list of functions of `module`, its parts.

    `names` says what each part is, in the line that a user reads meanwhile. The parts of a group
    are compiled at the same time, and use the kernels of the groups before it. Each processor has a
    process, which takes every so many-th part of the group in turn: those that take longest should
    stand first. Where no cache can be written, nothing happens.
    """
    if _compiling or jit.CACHE is None:
        return
    for parts in groups:
        missing = [part for part in parts if part not in _tried and not _is_ready(module, part)]
        if not missing:
            continue
        _tried.update(missing)
        jit.patience.tell(", ".join(names[part] for part in missing))
        if not _compile_apart(module, missing):
            return


def _is_ready(module: str, part: str) -> bool:
    """Whether a part was compiled from the files that its kernels would be compiled from now."""
    try:
        lines = _record(module, part).read_text().splitlines()
        files = [line.partition(" ")[::2] for line in lines]
        return bool(files) and all(source_digest(file) == digest for digest, file in files)
    except OSError:
        return False


def _record(module: str, part: str) -> Path:
    """What says from which files, with their digests, a part was compiled."""
    assert jit.CACHE is not None
    return jit.CACHE / f"{module}.{part}.ready"


# Ends with the process that holds the other end of its standard input, even if that is killed.
_WATCH = """
import os, threading
def watch():
    os.read(0, 1)
    os._exit(1)
threading.Thread(target=watch, daemon=True).start()
"""


def _compile_apart(module: str, parts: Sequence[str]) -> bool:
    """Return whether all processes finished without an error; Ctrl-C reaches this one alone."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    count = min(len(parts), len(usable(0)))
    jobs: list[subprocess.Popen] = []
    try:
        for first in range(count):
            share = tuple(parts[first::count])
            code = (
                f"{_WATCH}import {module} as functions; from {__name__} import compile_here; "
                f"compile_here(functions, {share})"
            )
            jobs.append(
                subprocess.Popen(  # -P: no modules from the current folder
                    [sys.executable, "-P", "-c", code],
                    stdin=subprocess.PIPE,
                    start_new_session=True,
                )
            )
        return all([job.wait() == 0 for job in jobs])
    finally:
        for job in jobs:
            job.kill()
            job.wait()
            assert job.stdin is not None  # a pipe
            job.stdin.close()


def compile_here(module: ModuleType, parts: Sequence[str]) -> None:
    """This process compiles these parts, one after the other, and ends soon after."""
    begin()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)  # looking for garbage of Numba's takes a tenth of the time
    for part in parts:
        getattr(module, part)()
        end(module.__name__, part)


def begin() -> None:
    """Mark this process as the one that compiles: it does not wait, and its parent prints."""
    global _compiling
    _compiling = True
    jit.patience.announced = True


def end(module: str, part: str) -> None:
    """This process has compiled a part: note from what."""
    used = {each.py_func.__code__.co_filename for each in jit.kernels if each.overloads}
    lines = [f"{source_digest(file)} {file}" for file in sorted(used)]
    with contextlib.suppress(OSError, PoiseError):  # nothing to share
        write_atomic(_record(module, part), "\n".join(lines))
