"""The long run: turns of all kinds in a process that is watched, and what was found, kept."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import signal
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .child import serve, stack
from .playing import SECONDS, Outcome
from .values import Json

FOUND = Path(__file__).parent / "found"
WAITING = 30.0  # [s] that a case may wait for something without computing
LOADING = 300.0  # [s] for the first cases of a kind, which load and compile
LIFE = 20  # turns of a process


@dataclass
class Count:
    """Of one kind."""

    cases: int = 0
    verdicts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    mebibytes: float = 0.0
    seconds: float = 0.0

    def add(self, outcome: Outcome) -> None:
        self.cases += 1
        self.verdicts[outcome.verdict] += 1
        self.mebibytes = max(self.mebibytes, outcome.mebibytes)
        self.seconds = max(self.seconds, outcome.seconds)

    def join(self, other: Count) -> None:
        """Count what the other has counted."""
        self.cases += other.cases
        for verdict, number in other.verdicts.items():
            self.verdicts[verdict] += number
        self.mebibytes = max(self.mebibytes, other.mebibytes)
        self.seconds = max(self.seconds, other.seconds)


class Runner:
    """Plays turns, one child process at a time; `counts` and `faults` say what came of it."""

    def __init__(self, seed: int, found: Path = FOUND):
        self.counts: dict[str, Count] = defaultdict(Count)
        self.faults: dict[str, tuple[str, Json, Outcome]] = {}  # what → kind, case, outcome
        self._found, self._seed, self._turns = found, seed * 1_000_000, 0
        self._folder = tempfile.TemporaryDirectory(prefix="poise-fuzz-stacks-")
        self._child: Any = None
        self._connection: Any = None

    @property
    def _stacks(self) -> Path:
        return Path(self._folder.name) / "stacks"

    def turn(self, kind: str, seconds: float) -> None:
        """Play cases of a kind for so long."""
        if self._child is None or self._turns % LIFE == 0:
            self._start()
        self._turns += 1
        self._connection.send((kind, self._seed, seconds, set(self.faults)))
        self._seed += 1000
        self._watch(kind)

    def close(self) -> None:
        """End the process."""
        if self._child is not None:
            self._child.kill()
            self._child.join()
            self._connection.close()
            self._child = None

    def _start(self) -> None:
        self.close()
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        arguments = (theirs, str(self._stacks))
        self._child = context.Process(target=serve, args=arguments, daemon=True)
        self._child.start()
        theirs.close()

    def _watch(self, kind: str) -> None:
        """Read what the child says until its turn is over, or it is."""
        case: Json = None
        since, used, loading = time.monotonic(), self._used(), True
        while True:
            try:
                if not self._connection.poll(0.25):
                    waited, computed = time.monotonic() - since, self._used() - used
                    late = computed > SECONDS or waited > WAITING
                    if waited > LOADING if loading else late:
                        return self._hung(kind, case)
                    continue
                what, value = self._connection.recv()
            except (EOFError, ConnectionResetError):
                return self._died(kind, case)
            since, used = time.monotonic(), self._used()
            if what == "over":
                return None
            if what == "broken":
                raise RuntimeError(f"{kind}: {value}")
            loading = loading and what != "ready"
            if what == "case":
                case = value[1]
            elif what == "outcome":
                self._note(kind, case, value)

    def _used(self) -> float:
        """Seconds of the processor that the child has used; by the clock where nobody counts."""
        try:
            fields = Path(f"/proc/{self._child.pid}/stat").read_text().rsplit(")", 1)[1].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        except OSError:
            return time.monotonic()

    def _hung(self, kind: str, case: Json) -> None:
        os.kill(self._child.pid, signal.SIGUSR1)
        time.sleep(0.5)
        self.close()
        self._note(kind, case, Outcome("hang", f"hang of {kind}: {stack(self._stacks)}"))

    def _died(self, kind: str, case: Json) -> None:
        self._child.join()
        what = f"crash of {kind} ({self._child.exitcode}): {stack(self._stacks)}"
        self.close()
        self._note(kind, case, Outcome("crash", what))

    def _note(self, kind: str, case: Json, outcome: Outcome) -> None:
        """Count it, and keep the smallest case of every fault."""
        self.counts[kind].add(outcome)
        if outcome.good:
            return
        known = self.faults.get(outcome.what)
        if known is None:
            print(f"found: {outcome.verdict}: {outcome.what}", flush=True)
        if known is None or _size(case) < _size(known[1]):
            self.faults[outcome.what] = kind, case, outcome
            keep(self._found, kind, case, outcome)


def _size(case: Json) -> tuple[int, str]:
    text = json.dumps(case)
    return len(text), text


def keep(folder: Path, kind: str, case: Json, outcome: Outcome) -> Path:
    """Write a case so that `tests/integration/test_fuzz.py` plays it again."""
    digest = hashlib.sha256(outcome.what.encode()).hexdigest()[:8]
    path = folder / f"{kind}-{outcome.verdict}-{digest}.json"
    entry = {"kind": kind, "what": outcome.what, "case": case}
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(entry, indent=1) + "\n")
    return path


def table(counts: dict[str, Count]) -> str:
    """What came of all kinds, and their sum."""
    columns = ("traceback", "hang", "crash", "memory")
    head = f"{'kind':14}{'cases':>8}{'worked':>8}{'refused':>8}"
    lines = [head + "".join(f"{name:>10}" for name in columns) + f"{'largest':>12}{'longest':>9}"]
    total = Count()
    for name, count in counts.items():
        lines.append(_line(name, count, columns))
        total.join(count)
    return "\n".join([*lines, _line("all", total, columns)])


def _line(name: str, count: Count, columns: Sequence[str]) -> str:
    verdicts = count.verdicts
    line = f"{name:14}{count.cases:8}{verdicts['worked']:8}{verdicts['refused']:8}"
    line += "".join(f"{verdicts[column]:10}" for column in columns)
    return line + f"{count.mebibytes:8.0f} MiB{count.seconds:7.1f} s"
