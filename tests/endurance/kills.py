"""Kills at random moments, then the same command: `python -m tests.endurance.kills --count 100`.

A case is a command, a signal (SIGKILL, SIGTERM, SIGINT), the main process or a worker, a moment:
a fraction of the undisturbed run's seconds, or of what it has finished, so that it lands inside.
Then the same command goes on (with --resume where it wants that), and its result must be that of an
undisturbed run, byte by byte but for what `commands.py` names. A resumed training starts new
episodes, by design: it must be, byte by byte, what an undisturbed run gives that was resumed from
its own checkpoint of that step. After a kill of a worker the command itself must end well.
"""

from __future__ import annotations

import argparse
import json
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from poise.configs.errors import PoiseError

from .commands import Command, commands
from .processes import Running, kill
from .resumed import Resumed

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ORPHANS = 5.0  # [s] within which the processes of a killed main process end
FAILED = "FAILED"
GLANCE = 0.02  # [s] between looks


class Undisturbed:
    """What each command gives if it is left alone, and how long it takes."""

    def __init__(self, room: Path):
        self.room, self.resumed = room, Resumed(room)
        self.results: dict[str, Any] = {}
        self.seconds: dict[str, float] = {}
        self.kept: dict[str, int] = {}  # the most that was seen

    def run(self, command: Command) -> None:
        out, start = self.room / "whole" / command.name, time.monotonic()
        running = Running(command.line(out))
        seen = [0]
        while running.process.poll() is None:
            seen.append(_kept(command, out))
            time.sleep(GLANCE)
        assert running.wait() == 0, running.output
        self.kept[command.name] = max(seen)
        self.seconds[command.name] = time.monotonic() - start
        self.results[command.name] = command.result(out)

    def result(self, command: Command, stopped: dict[str, Path]) -> Any:
        """What must come of it; `stopped` are the runs of a training as the kill has left them."""
        result = self.results[command.name]
        if command.name == "train":
            return self.resumed.result(stopped["."], 0) if stopped else result
        if command.name == "train --seeds":
            runs = {f"seed-{s}": self.resumed.result(stopped.get(f"seed-{s}"), s) for s in (0, 1)}
            return runs  # seeds.json says what their states say
        return result


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", nargs="*", default=[])
    options.add_argument("--signals", nargs="*", default=[number.name for number in SIGNALS])
    given = options.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="poise-kills-") as folder:
        room = Path(folder)
        chosen = [c for c in commands(room) if not given.only or c.name in given.only]
        whole = Undisturbed(room)
        for command in chosen:
            whole.run(command)
            print(f"undisturbed {command.name}: {whole.seconds[command.name]:.1f} s", flush=True)
        told = Counter[str]()
        for number in range(given.count):
            told[_case(number, chosen, whole, given.signals, given.seed)] += 1
    print(f"{given.count - told[FAILED]} of {given.count} as if nothing had happened")
    for words, count in sorted(told.items()):
        print(f"{count}: {words}")
    return 1 if told[FAILED] else 0


def _case(n: int, chosen: list[Command], whole: Undisturbed, signals: list[str], seed: int) -> str:
    """Print how it went; returns that for a count."""
    rng = np.random.default_rng([seed, n])
    command = chosen[n % len(chosen)]
    number = signal.Signals[str(rng.choice(signals))]
    worker = command.has_workers and bool(rng.random() < 0.5)
    moment = Moment(float(rng.random()), bool(rng.random() < 0.5))
    out = whole.room / f"case-{n}"
    kind = f"{number.name} of {'a worker' if worker else 'the main process'}"
    try:
        told = _kill_and_go_on(command, out, number, worker, moment, whole, rng)
    except Exception as error:
        told = f"{FAILED}: {type(error).__name__}: {error}"
    print(f"{n}: {command.name}, {kind}, {moment}: {told}", flush=True)
    shutil.rmtree(out, ignore_errors=True)
    return FAILED if told.startswith(FAILED) else f"{kind}: {told.split(',')[0]}"


@dataclass(frozen=True)
class Moment:
    """A fraction of an undisturbed run: of its seconds, or of what it finishes."""

    fraction: float
    of_work: bool

    def __str__(self) -> str:
        return f"at {self.fraction:.0%} of its {'work' if self.of_work else 'seconds'}"

    def wait(self, running: Running, command: Command, out: Path, whole: Undisturbed) -> None:
        """Until it has come, or the command has ended."""
        end = time.monotonic() + self.fraction * whole.seconds[command.name]
        work = self.fraction * whole.kept[command.name]
        while running.process.poll() is None:
            if _kept(command, out) > work if self.of_work else time.monotonic() > end:
                return
            time.sleep(GLANCE)


def _kept(command: Command, out: Path) -> int:
    """While it runs: a checkpoint may be just being replaced."""
    try:
        return command.kept(out)
    except (PoiseError, OSError):
        return 0


def _kill_and_go_on(
    command: Command,
    out: Path,
    number: signal.Signals,
    worker: bool,
    moment: Moment,
    whole: Undisturbed,
    rng: np.random.Generator,
) -> str:
    """Raises AssertionError for whatever is not as it should be."""
    running = Running(command.line(out))
    moment.wait(running, command, out, whole)
    target = _a_worker(running, rng) if worker else running.process.pid
    hit = target is not None and kill(target, number)
    copied = out.with_name(f"{out.name}-stopped")
    died = worker and hit and number != signal.SIGINT  # which workers leave to the main process
    stopped = stopped_runs(command, out, copied) if died else {}
    code = running.wait()
    if worker or code == 0:
        assert code == 0, f"exit code {code}: {running.output[-2000:]}"
        told = "went on" if hit else "had ended"
    else:
        told = _look_at_the_stop(command, out, number, code, running)
        stopped = stopped_runs(command, out, copied)
        kept = command.kept(out)
        again = Running(command.line(out))
        assert again.wait() == 0, again.output[-2000:]
        if command.name in ("evaluate", "benchmark", "policies", "walk") and kept:
            assert f"continuing after {kept} finished" in again.output, again.output
        told += f", {kept} kept"
    result, expected = command.result(out), [whole.result(command, stopped)]
    if died:  # one of the runs; the others were not disturbed
        expected.append(whole.result(command, {}))
    differing = [key for key in expected[0] if result[key] not in [each[key] for each in expected]]
    assert not differing, f"differ: {differing}"
    left = [path.name for path in out.rglob(".*")]
    assert not left, f"left behind: {left}"
    return told


def _look_at_the_stop(
    command: Command, out: Path, number: signal.Signals, code: int, running: Running
) -> str:
    """Exit code, processes, one line of text, and whole files."""
    codes = {-number} if number == signal.SIGKILL else {128 + number, -number}
    assert code in codes, f"exit code {code}: {running.output[-2000:]}"
    left = running.left(ORPHANS if number == signal.SIGKILL else 0.0)
    assert left == 0, f"{left} processes left"
    if code > 0:
        assert running.output.count("poise: stopped; ") == 1, running.output
        assert "Traceback" not in running.output, running.output
    look_at_files(out)
    return "stopped"


def look_at_files(out: Path) -> None:
    """They are whole."""
    for path in out.rglob("*.json"):
        json.loads(path.read_text())
    for path in out.rglob("*.yaml"):
        assert isinstance(yaml.safe_load(path.read_text()), dict), path


def _a_worker(running: Running, rng: np.random.Generator) -> int | None:
    """One of them, as soon as there is one; None if the command ends before."""
    while running.process.poll() is None:
        if workers := running.workers():
            return int(rng.choice(workers))
        time.sleep(GLANCE)
    return None


def stopped_runs(command: Command, out: Path, to: Path) -> dict[str, Path]:
    """Copies of a training's runs as they are now, whose processes have just died."""
    if not (command.name.startswith("train") and out.exists()):
        return {}
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(out, to, ignore=shutil.ignore_patterns("tensorboard"))
    if command.name == "train":
        return {".": to}
    return {folder.name: folder for folder in to.glob("seed-*")}


if __name__ == "__main__":
    sys.exit(main())
