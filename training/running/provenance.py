"""The origin of a result: command, versions, machine, commit and time."""

import importlib.metadata
import os
import platform
import shlex
import subprocess
import sys
import time
from pathlib import Path
from typing import TypedDict

import poise
from poise.configs.texts import LONGEST

LIBRARIES = ("mujoco", "numpy", "numba", "torch", "stable-baselines3", "gymnasium", "scipy")


class Machine(TypedDict):
    """System, processor and number of usable cores."""

    system: str
    processor: str
    cores: int


class Circumstances(TypedDict):
    """The origin of a result; `seconds` is of the last call only."""

    command: str
    versions: dict[str, str]
    machine: Machine
    workers: int
    backend: str
    commit: str | None
    seconds: float


def circumstances(started: float, workers: int, backend: str) -> Circumstances:
    """Return the origin of a result of this process; `started` is a `time.perf_counter` value."""
    return {
        "command": command_line(),
        "versions": versions(),
        "machine": machine(),
        "workers": workers,
        "backend": backend,
        "commit": commit(),
        "seconds": round(time.perf_counter() - started, 1),
    }


def command_line() -> str:
    """Return the command line without the program's folder, cut where no reader would take it."""
    program = Path(sys.argv[0]).name
    text = shlex.join(["poise" if program == "__main__.py" else program, *sys.argv[1:]])
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def versions(names: tuple[str, ...] = LIBRARIES) -> dict[str, str]:
    """Return the versions of Python, Poise and the libraries."""
    found = {"python": platform.python_version(), "poise": poise.__version__}
    for name in names:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def machine() -> Machine:
    """Return system, processor and cores of this machine."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": usable_cores(),
    }


def usable_cores() -> int:
    """Return the number of cores available to this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def commit() -> str | None:
    """Return the commit of Poise's checkout, with "+" if files differ; None without a checkout."""
    root = Path(__file__).resolve().parents[2]
    top = _git(root, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != root:
        return None
    head = _git(root, "rev-parse", "HEAD")
    changed = _git(root, "status", "--porcelain", "--untracked-files=no")
    return f"{head}+" if head and changed else head


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True, text=True, timeout=10, check=False,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text("utf-8", "replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
