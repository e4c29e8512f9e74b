"""Compile the kernels once, in processes of their own.

A kernel that a process compiled itself may differ in the last bits from the same kernel read from
the cache (other functions were at hand to be inlined). After `prepare` every process reads the
same compiled code, so results do not depend on which process came first.
"""

import subprocess
import sys

from poise.envs import jit
from poise.envs.config import write_atomic

_READY = jit.CACHE_STAMP.with_name("kernels.ready")
#: One process for each; the last goes on with what needs all of them when the others are done.
_SHARES = ("assembly()", "solver()", "steps(); input(); ticks()")
_compiling = False  # whether this is one of them


def prepare() -> None:
    """Fill the cache of compiled kernels if it is cold: some fifteen seconds on two cores, once."""
    if _compiling:
        return
    try:
        sources = jit.CACHE_STAMP.read_text()
        if _READY.is_file() and _READY.read_text() == sources:
            return
        print(jit.MESSAGE, file=sys.stderr, flush=True)
        if _compile_apart():
            write_atomic(_READY, sources)
    except OSError:
        return  # a folder that cannot be written has no cache: nothing to share


def _compile_apart() -> bool:
    """Whether all processes have finished without an error."""
    jobs: list[subprocess.Popen[bytes]] = []
    try:
        for calls in _SHARES:
            code = f"from poise.baselines.compilation import *; begin(); {calls}"
            jobs.append(subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE))
        *first, last = jobs
        good = [job.wait() == 0 for job in first]
        last.communicate(b"\n")
        return all(good) and last.returncode == 0
    finally:
        for job in jobs:
            job.kill()


def begin() -> None:
    """This process compiles: it has nothing to wait for, and its starter has told the user."""
    global _compiling
    _compiling = True
    jit.quiet()
