"""Commands as processes, and all that they start, found by a mark in their environment."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MARK = "POISE_ENDURANCE"
LIMIT = 300.0  # [s] after which a command hangs


class Running:
    """A `poise` command in a session of its own; `output` is what it has written, at its end."""

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str] | None = None):
        self.mark = uuid.uuid4().hex
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "poise_command", *arguments],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env={**os.environ, **(environment or {}), MARK: self.mark},
            start_new_session=True, preexec_fn=heed_interrupts,
        )  # fmt: skip
        self.output = ""

    def wait(self, seconds: float = LIMIT) -> int:
        """The exit code; raises TimeoutExpired, and nothing is left then."""
        try:
            self.output, _ = self.process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            for process in self.all():
                kill(process, signal.SIGKILL)
            raise
        return self.process.returncode

    def all(self) -> list[int]:
        """Every process that the command has started and that still lives, itself included."""
        return [process for process in _processes() if self._is_mine(process)]

    def workers(self) -> list[int]:
        """Those that play and train."""
        return [
            process
            for process in self.all()
            if b"spawn_main" in _read(process, "cmdline") and process != self.process.pid
        ]

    def left(self, seconds: float) -> int:
        """How many processes live on after the command for that long."""
        end = time.monotonic() + seconds
        while (count := len(self.all())) and time.monotonic() < end:
            time.sleep(0.02)
        return count

    def _is_mine(self, process: int) -> bool:
        return f"{MARK}={self.mark}".encode() in _read(process, "environ")


def heed_interrupts() -> None:
    """A shell that starts its jobs in the background has them, and their children, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def kill(process: int, number: int) -> bool:
    """Send a signal; whether there was a process to take it."""
    try:
        os.kill(process, number)
    except ProcessLookupError:
        return False
    return True


def _processes() -> list[int]:
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def _read(process: int, name: str) -> bytes:
    """A file of /proc; empty for a process that has ended, and for those of others."""
    try:
        return Path(f"/proc/{process}/{name}").read_bytes()
    except OSError:
        return b""
