"""The process that plays cases: it may hang or die, and another one takes its place."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

from poise.baselines.warmup import prepare

from . import memory
from .kinds import NAMES, Kind, kind
from .playing import MEBIBYTES, Outcome, play
from .values import Json

BATCH = 100  # cases that hypothesis draws at a time
SHRINKING = 15.0  # [s] to look for a smaller case of a new fault
ARENAS = 256.0  # [MiB] of address space that threads reserve and do not use
SETTINGS = settings(
    max_examples=BATCH,
    database=None,
    deadline=None,
    phases=(Phase.generate, Phase.shrink),
    suppress_health_check=list(HealthCheck),
    report_multiple_bugs=False,
)
Tell = Callable[[str, Any], None]


class Fault(Exception):
    """A fault that was not known: hypothesis looks for a smaller case of it."""


def serve(connection: Connection, stacks: str) -> None:
    """Play turns until None comes. Where the process is, `stacks` shows when it is asked."""
    _quiet()
    os.chdir(tempfile.gettempdir())
    with open(stacks, "w") as file:
        faulthandler.enable(file)
        faulthandler.register(signal.SIGUSR1, file, all_threads=False)
        while (turn := connection.recv()) is not None:
            _take(connection, *turn)


def _quiet() -> None:
    """Nothing that libraries print is seen."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.dup2(nowhere, sys.stderr.fileno())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this one


def _take(connection: Connection, name: str, first: int, seconds: float, known: set[str]) -> None:
    """A turn of one kind, of so many seconds or a little more."""

    def tell(what: str, value: Any) -> None:
        connection.send((what, value))

    played, number = kind(name), first
    _warm_up(played, tell)
    memory.bound(MEBIBYTES + ARENAS)
    tell("ready", None)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        _batch(played, number, end, known, tell)
        number += 1
    tell("over", number)


def _warm_up(played: Kind, tell: Tell) -> None:
    """The first cases load and compile what the others use; a fault will be met again."""
    if played.name in _warm or played.name not in NAMES:
        return
    if not _warm:
        from .worlds import warm_up  # loads MuJoCo

        prepare("contacts", "planner", "walking")
        warm_up()

    @seed(0)
    @settings(SETTINGS, max_examples=5, phases=(Phase.generate,))
    @given(played.cases)
    def some(case: Json) -> None:
        tell("case", (played.name, case))
        play(played, case)

    _warm.add(played.name)
    try:
        some()
    except Exception as error:  # `play` raises nothing: no case could be drawn
        tell("broken", f"{type(error).__name__}: {error}")
        raise


_warm: set[str] = set()


def _batch(played: Kind, number: int, end: float, known: set[str], tell: Tell) -> None:
    """Cases of one seed; stops at `end`, and after a new fault was made small."""
    found: list[str] = []
    until = [end]

    @seed(number)
    @settings(SETTINGS)
    @given(played.cases)
    def test(case: Json) -> None:
        if time.monotonic() > until[0]:
            return
        tell("case", (played.name, case))
        outcome: Outcome = play(played, case)
        tell("outcome", outcome)
        if not outcome.good and (outcome.what in found or not (found or outcome.what in known)):
            if not found:
                found.append(outcome.what)
                until[0] = time.monotonic() + SHRINKING
            raise Fault(outcome.what)

    try:
        test()
    except Exception as error:
        if not found:  # not a case's fault
            tell("broken", f"{type(error).__name__}: {error}")
            raise
    known.update(found)


def stack(path: Path) -> str:
    """The innermost line of this project in what a process has left in its file of stacks."""
    lines = path.read_text().splitlines() if path.exists() else []
    own = [line.strip() for line in lines if "/poise/" in line or "File" in line]
    inside = [line for line in own if "site-packages" not in line and "/tests/" not in line]
    return (inside or own or ["nowhere known"])[0]
