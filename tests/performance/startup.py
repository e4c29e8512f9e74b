"""Imports, and the compilation of a first use: `python -m tests.performance.startup`.

Every time is that of a fresh process less an empty one's, the best of five for imports. The
compilation happens once, in a copy of the package without its cache (`--no-compile` leaves it
out). CPU seconds tell what a quiet machine would take; the clock also counts what other jobs take.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("envs", "baselines", "training", "configs")
REPEATS = 5
FIRST_USE = "from poise.baselines.warmup import prepare; prepare()"
STEPS = "from poise.baselines.warmup import prepare; prepare('contacts', 'planner')"


class Spent(NamedTuple):
    """Seconds on the clock, and of the processor."""

    clock: float
    cpu: float


def run(code: str, path: Path) -> Spent:
    """What a fresh process takes to run `code` with `poise` found in `path`."""
    environment = os.environ | {"PYTHONPATH": str(path), "OMP_NUM_THREADS": "1"}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    clock, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(clock, cpu)


def best(code: str, path: Path) -> Spent:
    """The smallest of each over a few runs; the first one also writes byte code."""
    runs = [run(code, path) for _ in range(1 + REPEATS)][1:]
    return Spent(min(spent.clock for spent in runs), min(spent.cpu for spent in runs))


def package(room: Path) -> Path:
    """A copy of the package without any cache; returns the folder to put on the path."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "src/poise", room / "poise", ignore=ignored)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, room / "poise" / name, ignore=ignored)
    return room


def main(args: list[str] | None = None) -> None:
    args = sys.argv[1:] if args is None else args
    print("| start | clock | CPU |")
    print("| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as room:
        path = package(Path(room))
        empty = best("pass", path)
        for code in ("import gymnasium", "import poise", "from poise.envs import BalanceEnv"):
            spent = best(code, path)
            print(f"| {code} | {spent.clock - empty.clock:.2f} s | {spent.cpu - empty.cpu:.2f} s |")
        if "--no-compile" not in args:
            uses = {
                "first use, compiling": FIRST_USE,
                "second use": FIRST_USE,
                "first use of a controller that steps, besides": STEPS,
            }
            for name, code in uses.items():
                spent = run(code, path)
                print(f"| {name} | {spent.clock:.1f} s | {spent.cpu:.1f} s |")


if __name__ == "__main__":
    main()
