"""Threads that wait for work, without the futures and locks of an executor."""

import os
import threading
import weakref
from collections.abc import Callable
from queue import SimpleQueue
from typing import TypeAlias

from poise.configs.errors import PoiseError

Raised: TypeAlias = SimpleQueue[BaseException | None]  # what the work of helpers has raised
#: what a helper is asked: work, its number, where what it raised goes; None: to end
Call: TypeAlias = tuple[Callable[[int], None], int, Raised | None] | None


class ThreadTeam:
    """Threads that share some work with the one that asks for it; they start when first asked.

    A copy, and what a forked process has of it, starts threads of its own.
    """

    def __init__(self) -> None:
        self._calls: list[SimpleQueue[Call]] = []
        self._threads: list[threading.Thread] = []
        self._end = weakref.finalize(self, _end, self._calls)
        self._process = os.getpid()  # that the threads are of

    def __reduce__(self) -> tuple[object, ...]:
        return ThreadTeam, ()

    def distribute(self, work: Callable[[int], None], helpers: int) -> None:
        """`work(0)` in this thread, `work(1)`, `work(2)`… in some helpers; returns when all have.

        Raises what one of them raised, PoiseError if they have been closed or have died.
        """
        done: Raised = SimpleQueue()
        asked = range(1, helpers + 1)
        for k in asked:
            self.ask(work, k, done)
        try:
            work(0)
        finally:
            errors = [done.get() for _ in asked]
        for error in errors:
            if error is not None:
                raise error

    def ask(self, work: Callable[[int], None], helper: int, done: Raised | None = None) -> None:
        """`work(helper)` in helper 1, 2…, once it is free; what it raised, or None, goes to `done`.

        Raises PoiseError if they have been closed or have died.
        """
        if not self._end.alive:
            raise PoiseError("the threads have ended: close() comes last")
        if self._process != os.getpid():  # a fork has none of them
            self._process = os.getpid()
            self._calls.clear()
            self._threads.clear()
        self.expect_alive()
        while len(self._calls) < helper:
            self._calls.append(SimpleQueue())
            arguments = (self._calls[-1],)
            thread = threading.Thread(target=_serve, args=arguments, name="poise", daemon=True)
            self._threads.append(thread)
            thread.start()
        self._calls[helper - 1].put((work, helper, done))

    def expect_alive(self) -> None:
        """Raises PoiseError if a helper has died."""
        if not all(thread.is_alive() for thread in self._threads):
            raise PoiseError("a thread has ended that was to help")

    def close(self) -> None:
        """End the threads."""
        self._end()


def _serve(calls: "SimpleQueue[Call]") -> None:
    while (call := calls.get()) is not None:
        work, number, done = call
        try:
            work(number)
            error: BaseException | None = None
        except BaseException as caught:  # the thread that asked raises it
            error = caught
        if done is not None:
            done.put(error)
        elif error is not None:
            raise error
        del call, work, done, error  # nothing is kept until the next call


def _end(calls: "list[SimpleQueue[Call]]") -> None:
    for each in calls:
        each.put(None)
