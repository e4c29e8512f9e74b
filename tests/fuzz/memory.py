"""The memory of this process, and a bound on it. Linux alone counts and bounds; elsewhere 0."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

LINUX = sys.platform == "linux"
STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def _read(name: str) -> float:
    if not LINUX:
        return 0.0
    lines = STATUS.read_text().splitlines()
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(name)), 0.0)


def in_use() -> float:
    """Resident now [MiB]."""
    return _read("VmRSS:")


def peak() -> float:
    """Resident at most since `reset_peak` [MiB]."""
    return _read("VmHWM:")


def reset_peak() -> None:
    """Begin to count the peak anew."""
    if LINUX:
        CLEAR.write_text("5")


def bound(mebibytes: float) -> None:
    """Allow this process so much more address space than it has now."""
    if LINUX:
        limit = int((_read("VmSize:") + mebibytes) * 2**20)
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
