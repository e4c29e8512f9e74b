"""Threads that wait for work, without the futures and locks of an executor."""

import threading
import weakref
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any


class Helpers:
    """`count` threads that share some work with the one that asks for it."""

    def __init__(self, count: int):
        self._calls: list[SimpleQueue[Any]] = [SimpleQueue() for _ in range(count)]
        for calls in self._calls:
            threading.Thread(target=_serve, args=(calls,), name="poise", daemon=True).start()
        self._end = weakref.finalize(self, _end, self._calls)

    def share(self, work: Callable[[int], None], helpers: int) -> None:
        """`work(0)` in this thread, `work(1)`, `work(2)`… in some helpers; returns when all have.

        Raises what one of them raised.
        """
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
