"""Ctrl-C and SIGTERM: a command unwinds within half a second, or its process is ended.

Python runs its signal handlers between byte codes. A long native call, such as a compilation by
LLVM, delays them, and an exception inside a callback is lost. The C handler, however, writes to
the wake-up descriptor at once, and a thread waits there. All files are written atomically, so
ending the process loses at most its last trial.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from types import FrameType
from typing import TypeAlias

Handler: TypeAlias = Callable[[int, FrameType | None], object]  # of a signal
SIGNALS = (signal.SIGINT, signal.SIGTERM)
GRACE = 0.5  # [s] to unwind
RESTARTS = "the same command starts from the beginning"
_END = b"\0"  # no signal has this number
_kept: list[tuple[Path, str]] = []  # of the running command
_asked: list[int] = []  # signals received
_starting = threading.Lock()  # held while processes are started


class Stopped(KeyboardInterrupt):
    """A signal requested the command to stop."""


def keeps(path: Path, words: str) -> None:
    """Set the message of a stop from now on: what is kept, once `path` exists, and how to continue.

    The first call, that of the outermost caller, takes precedence.
    """
    _kept.append((path, words))


def stop_message() -> str:
    """Return the line printed after a stop."""
    words = [words for path, words in _kept if path.exists()]
    return f"poise: stopped; {words[0] if words else RESTARTS}"


def stop_code() -> int | None:
    """Return the exit code of a stopped command, or None."""
    return 128 + _asked[0] if _asked else None


@contextmanager
def stoppable() -> Iterator[None]:
    """Make SIGINT and SIGTERM raise `Stopped` inside, and end the process if it does not unwind.

    A second signal ends the process at once. A signal that is ignored, as in a background job of a
    shell, stays ignored. Outside the main thread, which alone can have handlers, nothing changes.
    """
    _kept.clear()
    _asked.clear()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with ExitStack() as stack:
        stack.enter_context(_watched())
        stack.callback(setattr, sys, "unraisablehook", sys.unraisablehook)
        sys.unraisablehook = partial(_unraisable, sys.unraisablehook)
        for number in SIGNALS:
            before = signal.getsignal(number)
            if before not in (signal.SIG_IGN, None):
                stack.callback(signal.signal, number, before)
                signal.signal(number, _raise)
        yield


def exit_at_once(code: int) -> None:
    """Make a signal end this process with `code` from now on, when all work is written."""
    for number in SIGNALS:
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, lambda number, frame: os._exit(code))


def ignore_stops() -> None:
    """Ignore signals during the interpreter's shutdown.

    There Python removes its handlers, and a signal would look like a kill.
    """
    for number in SIGNALS:
        if signal.getsignal(number) is not None:
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals while processes are started inside, until all are registered.

    The started processes do not receive Ctrl-C; this process alone handles it.
    """
    resource_tracker.ensure_running()  # its start would undo the block
    came: list[int] = []
    with _starting, _handled_by(lambda number, frame: came.append(number)) as before:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for number in came:
        before[number](number, None)


@contextmanager
def _handled_by(handler: Handler) -> Iterator[dict[int, Handler]]:
    """Replace Python's signal handlers by `handler` inside, if this is the main thread."""
    main = threading.current_thread() is threading.main_thread()
    found = {number: signal.getsignal(number) for number in SIGNALS if main}
    before: dict[int, Handler] = {number: old for number, old in found.items() if callable(old)}
    try:
        for number in before:
            signal.signal(number, handler)
        yield before
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def _raise(number: int, frame: FrameType | None) -> None:
    _asked.append(number)
    raise Stopped(signal.Signals(number).name)


def _unraisable(
    otherwise: Callable[[sys.UnraisableHookArgs], object], lost: sys.UnraisableHookArgs
) -> None:
    """End the process on a stop that is lost in a callback.

    Otherwise it would continue without the callback's result: LLVM would run a kernel without code.
    """
    if isinstance(lost.exc_value, Stopped):
        end_now(_asked[0])
    otherwise(lost)


@contextmanager
def _watched() -> Iterator[None]:
    """Run a thread that receives signals while the main thread is busy."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    thread = threading.Thread(target=_watch, args=(read,), name="stopping", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.write(write, _END)
        thread.join()
        os.close(read)
        os.close(write)


def _watch(read: int) -> None:
    while (byte := os.read(read, 1)) != _END:
        if byte[0] in SIGNALS:
            second, _, _ = select.select([read], [], [], GRACE)
            if not second or os.read(read, 1) != _END:
                _starting.acquire(timeout=GRACE)  # half-started processes would print errors
                end_now(byte[0])
            return


def end_now(number: int) -> None:
    """End this process and all its children at once."""
    children = multiprocessing.active_children()
    for child in children:
        child.kill()
    for child in children:
        child.join(0.1)
    with contextlib.suppress(OSError):
        if sys.stdout is not None and sys.stdout.isatty():
            os.write(1, b"\x1b[?25h")  # a progress bar hides the cursor
        os.write(2, f"{stop_message()}\n".encode())
    os._exit(128 + number)
