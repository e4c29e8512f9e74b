"""Compile the kernels once, in processes of their own.

A kernel that a process compiled itself may differ in the last bits from the same kernel read from
the cache (other functions were at hand to be inlined). After `prepare` every process reads the
same compiled code, so results do not depend on which process came first.
"""

import subprocess
import sys
from collections.abc import Sequence

from poise.envs import jit
from poise.envs.config import write_atomic
from poise.envs.errors import PoiseError
from poise.envs.kernel_cache import stamp

_READY = "kernels.ready"  # beside the kernels: the digest of the sources, then shares
_SHARES = ("assembly", "solver", "steps")  # of `compilation.py`, one process for each
_compiling = False  # whether this is one of them
_tried: set[str] = set()  # shares that this process has had compiled, or could not have


def prepare(*further: str) -> None:
    """Fill the cache of compiled kernels if it is cold: some twenty seconds on two cores, once.

    `further` shares of `compilation.py` follow, for ten more; they use the kernels of the first.
    """
    if _compiling or jit.CACHE is None:
        return
    ready = jit.CACHE / _READY
    try:
        sources = stamp(jit.CACHE).read_text()
        for shares in (_SHARES, further):
            digest, *done = ready.read_text().split() if ready.is_file() else [""]
            done = done if digest == sources else []
            missing = [share for share in shares if share not in done and share not in _tried]
            if not missing:
                continue
            _tried.update(missing)
            jit.tell()
            if not _compile_apart(missing):
                return
            write_atomic(ready, "\n".join([sources, *done, *missing]))
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


def _compile_apart(shares: Sequence[str]) -> bool:
    """Whether the processes have all finished without an error; Ctrl-C reaches this one alone."""
    jobs: list[subprocess.Popen] = []
    try:
        for share in shares:
            code = f"{_WATCH}from poise.baselines.compilation import *; begin(); {share}()"
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
