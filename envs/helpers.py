"""Threads that wait for work, without the futures and locks of an executor."""

import threading
import weakref
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from .errors import PoiseError


class Helpers:
    """Threads that share some work with the one that asks for it; they start when first asked."""

    def __init__(self) -> None:
        self._calls: list[SimpleQueue[Any]] = []
        self._end = weakref.finalize(self, _end, self._calls)

    def share(self, work: Callable[[int], None], helpers: int) -> None:
        """`work(0)` in this thread, `work(1)`, `work(2)`… in some helpers; returns when all have.

        Raises what one of them raised, PoiseError if they have been closed.
        """
        if helpers > 0 and not self._end.alive:
            raise PoiseError("the threads have ended: close() comes last")
        while len(self._calls) < helpers:
            self._calls.append(SimpleQueue())
            arguments = (self._calls[-1],)
            threading.Thread(target=_serve, args=arguments, name="poise", daemon=True).start()
        done: SimpleQueue[BaseException | None] = SimpleQueue()
        asked = self._calls[:helpers]
        for k, calls in enumerate(asked):
            calls.put((work, k + 1, done))
        try:
            work(0)
        finally:
            errors = [done.get() for _ in asked]
        for error in errors:
            if error is not None:
                raise error

    def close(self) -> None:
        """End the threads."""
        self._end()


def _serve(calls: "SimpleQueue[Any]") -> None:
    while (call := calls.get()) is not None:
        work, number, done = call
        try:
            work(number)
            done.put(None)
        except BaseException as error:  # the thread that asked raises it
            done.put(error)
        del call, work, done  # nothing is kept until the next call


def _end(calls: "list[SimpleQueue[Any]]") -> None:
    for each in calls:
        each.put(None)
