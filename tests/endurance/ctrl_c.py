"""Ctrl-C and SIGTERM at random moments: `python -m tests.endurance.ctrl_c --moments 20`.

How long each command takes until the prompt is back (the bar: 2 s), and how many of its processes
are left then (none). Commands marked "cold" run in a copy of the package without compiled kernels,
and are stopped while these compile. The signal goes to the main process alone, as `kill` sends it,
or to all, as a terminal does, in turns.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.performance.startup import package

from .commands import commands
from .processes import Running, kill

BAR = 2.0  # [s]
LONGEST = 25.0  # [s] into a command, which is about how long a cold one compiles
ENDING = ("replay", "report")  # before the latest moment
SHOWING = ("view",)  # are meant to be ended by Ctrl-C
HOUR = 10**7  # more trials or steps than anybody waits for


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--moments", type=int, default=20)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--longest", type=float, default=LONGEST, help="latest moment [s]")
    options.add_argument("--only", nargs="*", default=[])
    given = options.parse_args(arguments)
    rng = np.random.default_rng(given.seed)
    missed = 0
    print("| command | worst [s] | median [s] | processes left | other codes, tracebacks |")
    print("| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory(prefix="poise-ctrl-c-") as folder:
        for name, line in long_commands(Path(folder)).items():
            if given.only and name not in given.only:
                continue
            missed += _measure(name, line, Path(folder), given.moments, given.longest, rng)
    return 1 if missed else 0


def long_commands(room: Path) -> dict[str, list[str]]:
    """Command lines that go on for longer than they are watched, or nearly; `OUT` is a folder."""
    lines = {c.name: [*c.arguments, "--out", "OUT"] for c in commands(room, trials=3000)}
    finished = room / "finished"
    small = [*lines["evaluate"], "--trials", "6"]
    assert Running([str(finished) if part == "OUT" else part for part in small]).wait() == 0
    cold = {f"{name}, cold": lines[name] for name in ("evaluate", "train", "tune")}
    for name in ("train", "train --seeds"):
        lines[name] += ["--steps", str(HOUR)]
    lines["tune"] += ["--generations", str(HOUR)]
    return {
        **lines,
        "demo": ["demo", "--out", "OUT", "--workers", "2"],
        "replay": ["replay", str(finished), "--trial", "0", "--video", "OUT/a.mp4"],
        "report": ["report", str(finished), "--out", "OUT/report.html"],
        "view": ["view", "zero", "--port", "0"],
        **cold,
    }


def _measure(
    name: str, line: list[str], room: Path, moments: int, longest: float, rng: np.random.Generator
) -> int:
    """Print a row; returns how many moments have missed the bar."""
    seconds, left, odd = [], 0, 0
    cold = name.endswith("cold")
    latest = min(longest, _undisturbed(line, room)) if name in ENDING else longest
    for k in range(moments):
        out = room / f"out-{k}"
        path = room / f"package-{k}"
        environment = {"PYTHONPATH": str(package(path))} if cold else {}
        number = (signal.SIGINT, signal.SIGTERM)[k % 2]
        running = Running([part.replace("OUT", str(out)) for part in line], environment)
        time.sleep(rng.uniform(0.0, latest))
        start = time.monotonic()
        ended = running.process.poll() is not None
        if k % 4 < 2:
            kill(running.process.pid, number)
        elif not ended:
            os.killpg(running.process.pid, number)
        code = running.wait()
        seconds.append(time.monotonic() - start)
        left += running.left(0.0)
        early = code == -number and not out.exists()  # Python itself was still starting
        done = code == 0 and name in ENDING  # it was writing its last words
        done |= code == 0 and name in SHOWING and number == signal.SIGINT
        if not (ended or early or done) and (code != 128 + number or "Traceback" in running.output):
            odd += 1
            print(
                f"{name}: code {code} after {seconds[-1]:.2f} s\n{running.output[-1500:]}",
                file=sys.stderr,
                flush=True,
            )
        for folder in (out, path):
            shutil.rmtree(folder, ignore_errors=True)
    worst, median = max(seconds), float(np.median(seconds))
    print(f"| {name} | {worst:.2f} | {median:.2f} | {left} | {odd} |", flush=True)
    return sum(s > BAR for s in seconds) + left + odd


def _undisturbed(line: list[str], room: Path) -> float:
    """How long a command takes that ends [s]."""
    start, out = time.monotonic(), room / "undisturbed"
    running = Running([part.replace("OUT", str(out)) for part in line])
    assert running.wait() == 0, running.output
    return time.monotonic() - start


if __name__ == "__main__":
    sys.exit(main())
