"""Processes of this machine that do jobs, one at a time each.

A worker that dies, killed or out of memory, costs only what it was at: another one does that again,
once. Who else works goes on undisturbed, and what is done stays done.
"""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

from poise.configs.errors import PoiseError, PoiseWarning

from .stopping import uninterrupted

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
# A new process would search the current folder before the libraries; instead it is sent `sys.path`.
FOR_CHILDREN = (*THREADS, "PYTHONSAFEPATH")
OUT_OF_MEMORY = errno.ENOMEM  # exit code of a worker
UNGUARDED = 97  # of one that would start workers itself while it imports the user's script
PATIENCE = 5.0  # [s] for a worker to end by itself
ADVICE = "what is finished is kept: run the same command again to go on, with fewer --workers"
GUARD = (
    "processes import the script that starts them: put what it does under "
    "`if __name__ == '__main__':`"
)
Job = TypeVar("Job")
Result = TypeVar("Result")


def end_if_imported() -> None:
    """End this process if it is one that is only importing the script that has started it.

    It would start processes of its own, which multiprocessing refuses in thirty lines.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(UNGUARDED)


class WorkerPool:
    """Up to `count` processes, started when there are jobs; they stay for the next ones."""

    def __init__(self, count: int):
        self.count = count
        self.workers: list[Worker] = []

    def each(
        self, function: Callable[[Job], Result], jobs: Sequence[Job]
    ) -> Iterator[tuple[Job, Result]]:
        """Yield each job with `function(job)`, in the order that they end in; both are pickled.

        Raises PoiseError when two workers have died of a job, and what the function raises.
        """
        waiting = deque(Task(function, job) for job in jobs)
        for _ in range(len(waiting)):
            task, result = self._next(waiting)
            self._hand_out(waiting)  # before the caller takes its time
            yield task.job, result

    def end(self) -> None:
        """Let the workers end by themselves, those that are at nothing."""
        for worker in self.workers:
            worker.connection.close()
        for worker in self.workers:
            worker.process.join(0.0 if worker.task else PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End the workers at once, whatever they are at."""
        for worker in self.workers:
            worker.process.kill()
        for worker in self.workers:
            worker.process.join()
            worker.connection.close()
        self.workers.clear()

    def _next(self, waiting: deque[Task[Job, Result]]) -> tuple[Task[Job, Result], Result]:
        """The next task that is done, with its result."""
        while True:
            self._hand_out(waiting)
            busy = {worker.connection: worker for worker in self.workers if worker.task}
            ready = multiprocessing.connection.wait(list(busy))
            worker = busy[ready[0]]  # type: ignore[index]
            task, worker.task = worker.task, None
            assert task is not None  # it is busy
            try:
                answer = worker.connection.recv_bytes()
            except (EOFError, OSError):
                self.workers.remove(worker)
                death = worker.death()
                if worker.process.exitcode == UNGUARDED:
                    raise PoiseError(GUARD) from None
                task.deaths += 1
                if task.deaths > 1:
                    raise PoiseError(
                        f"{death}, as did another at the same work; {ADVICE}"
                    ) from None
                tell(f"{death}: another one does its work again")
                waiting.appendleft(task)
                continue
            done, value, where = pickle.loads(answer)
            if not done:
                raise value from WorkerTraceback(where)
            return task, value

    def _hand_out(self, waiting: deque[Task]) -> None:
        """Give tasks to the idle, and to new workers while there are fewer than `count`."""
        for worker in [worker for worker in self.workers if not worker.task]:
            if waiting:
                worker.give(waiting.popleft())
        while waiting and len(self.workers) < self.count:
            with uninterrupted():
                self.workers.append(Worker())
            self.workers[-1].give(waiting.popleft())


@dataclass(eq=False)
class Task(Generic[Job, Result]):
    """A job, and how many workers have died of it."""

    function: Callable[[Job], Result]
    job: Job
    deaths: int = 0


class Worker:
    """A process, the way to it, and what it is at."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.task: Task | None = None
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,))
        self.process.start()
        theirs.close()  # the worker alone holds it: its death is the end of the pipe

    def give(self, task: Task) -> None:
        """Let it do the task."""
        self.task = task
        content = pickle.dumps((task.function, task.job))
        try:
            self.connection.send_bytes(content)
        except OSError:
            pass  # it is dead, which the answer tells

    def death(self) -> str:
        """The way it has died, in words."""
        self.process.join(PATIENCE)
        self.process.kill()
        self.process.join()
        self.connection.close()
        code = self.process.exitcode or 0
        if code == OUT_OF_MEMORY:
            return "a worker process has died: out of memory"
        if code < 0:
            cause = " (out of memory?)" if -code == signal.SIGKILL else ""
            return f"a worker process has died by {signal.Signals(-code).name}{cause}"
        return f"a worker process has died with code {code}"


class WorkerTraceback(Exception):
    """Tells where in the worker an error was raised."""


def tell(text: str) -> None:
    """A line on the standard error; a progress bar moves on below it."""
    print(f"poise: {text}", file=sys.stderr, flush=True)


def single_threaded() -> AbstractContextManager[None]:
    """Processes started inside use one thread each for linear algebra; sums keep their order."""
    return environment(dict.fromkeys(FOR_CHILDREN, "1"))


@contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Inside, the environment of this process has these variables."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(connection: multiprocessing.connection.Connection) -> None:
    """Does tasks until the main process closes the pipe, or ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore", PoiseWarning)  # the main process has said it
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):  # the main process has closed the pipe, or died
        while True:
            connection.send_bytes(_answer(connection.recv_bytes()))


def _answer(content: bytes) -> bytes:
    """The pickled result, or what was raised."""
    try:
        function, job = pickle.loads(content)
        return pickle.dumps((True, function(job), ""))
    except MemoryError:
        os._exit(OUT_OF_MEMORY)
    except Exception as error:
        return pickle.dumps((False, _portable(error), traceback.format_exc()))


def _portable(error: Exception) -> Exception:
    """The error, or one of the same words if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # a controller from outside may raise anything
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _end_with_parent() -> None:
    """A killed main process leaves no orphans."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)
