"""Compile the kernels once, in processes of their own.

Several at once are done sooner than one, and a user is told once that this takes a while.
"""

import subprocess
import sys
from collections.abc import Sequence

from poise.configs.errors import PoiseError
from poise.configs.files import write_atomic

from . import jit
from .cache_folder import file_folder
from .sources import module_file

_READY = "parts.ready"  # in the folder of the module that lists them: those that were compiled
_compiling = False  # whether this process is one of those that compile
_tried: set[str] = set()  # parts that this process has had compiled, or could not have


def fill_cache(module: str, *groups: Sequence[str]) -> None:
    """Compile what is missing: each group is a list of functions of `module`, its parts.

    The parts of a group are compiled at the same time, in a process each, and use the kernels of
    the groups before it. Where no cache can be written, nothing happens.
    """
    if _compiling or jit.CACHE is None:
        return
    try:
        ready = file_folder(jit.CACHE, module_file(module)) / _READY
        for parts in groups:
            done = ready.read_text().split() if ready.is_file() else []
            missing = [part for part in parts if part not in done and part not in _tried]
            if not missing:
                continue
            _tried.update(missing)
            jit.tell()
            if not _compile_apart(module, missing):
                return
            write_atomic(ready, "\n".join([*done, *missing]))
    except (OSError, PoiseError):
        return  # a folder that cannot be written has no cache: nothing to share


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
    jobs: list[subprocess.Popen] = []
    try:
        for part in parts:
            code = (
                f"{_WATCH}from {__name__} import begin; begin();"
                f"from {module} import {part}; {part}()"
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


def begin() -> None:
    """This process compiles: it has nothing to wait for, and its starter has told the user."""
    global _compiling
    _compiling = True
    jit.quiet()
