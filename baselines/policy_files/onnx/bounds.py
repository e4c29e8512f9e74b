"""Bounds of time and memory for an external network.

Optimising it, or a loop within it, cannot be stopped from the thread that waits for it. So it is
asked for the first time in a process of its own, whose time and memory the system bounds; what
depends on the observation is stopped by a thread that looks at the clock.
"""

import contextlib
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakSet

from poise.configs.errors import ConfigError

CPU = 10  # [s] of the first asking, with the imports: half a second is usual
WALL = 120.0  # [s] the same, on a machine that is busy otherwise
MEMORY = 1 << 30  # [bytes] of data
LONGEST = 10.0  # [s] of each asking: a tenth of a millisecond is usual
_TRIED = """
import resource, sys
path, cpu, memory = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu))
resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
import numpy, onnxruntime
options = onnxruntime.SessionOptions()
options.intra_op_num_threads = options.inter_op_num_threads = 1
options.log_severity_level = 4
try:
    session = onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])
except Exception as error:
    print(error)
    sys.exit(3)
try:
    shapes = {each.name: [size if isinstance(size, int) else 1 for size in each.shape]
              for each in session.get_inputs()}
    session.run(None, {name: numpy.zeros(shape, numpy.float32) for name, shape in shapes.items()})
except MemoryError:
    sys.exit(4)
except Exception as error:  # sizes are asked about later
    sys.exit(4 if "alloc" in str(error) else 0)
"""


@cache
def try_network(path: Path, digest: str) -> None:
    """Read a network and ask it once, with zeros, in another process; once for each `digest`.

    Raises ConfigError naming the file: onnxruntime cannot read it, ends with it, or takes more than
    `CPU` or `MEMORY`. Whether it takes and gives what it should is not looked at.
    """
    command = [sys.executable, "-P", "-c", _TRIED, str(path), str(CPU), str(MEMORY)]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL, timeout=WALL, check=False)  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ConfigError(f"takes more than {WALL:g} s to read and ask once", source=path) from None
    problem = {
        0: None,
        3: f"cannot be read by onnxruntime ({done.stdout.decode(errors='replace').strip()})",
        4: f"takes more than {MEMORY >> 20} MiB",
        -9: f"takes more than {CPU} s to read and ask once",
    }.get(done.returncode, f"ends the process of onnxruntime (code {done.returncode})")
    if problem is not None:
        raise ConfigError(problem, source=path)


class RunOptions:
    """The options of runs of onnxruntime that end with an error after `LONGEST`."""

    def __init__(self) -> None:
        import onnxruntime

        self.options: Any = onnxruntime.RunOptions()
        self.begun: float | None = None
        with _lock:
            _running.add(self)

    @contextlib.contextmanager
    def run(self) -> Iterator[Any]:
        """The options, for one run within the block."""
        self.options.terminate = False
        self.begun = time.monotonic()
        _watch()
        try:
            yield self.options
        finally:
            self.begun = None


_running: WeakSet[RunOptions] = WeakSet()
_lock = threading.Lock()  # of the set, which two threads look at
_thread: threading.Thread | None = None


def _watch() -> None:
    """Let a thread look at the clock, if none does in this process yet."""
    global _thread
    if _thread is None or not _thread.is_alive():  # in a forked process it is not
        _thread = threading.Thread(target=_look, daemon=True)
        _thread.start()


def _look() -> None:
    while True:
        time.sleep(LONGEST / 10.0)
        with _lock:
            known = list(_running)
        for each in known:
            begun = each.begun
            if begun is not None and time.monotonic() - begun > LONGEST:
                each.options.terminate = True
