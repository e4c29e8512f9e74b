"""Worker processes of this machine, each of which runs one job at a time.

If a worker dies, killed or out of memory, another worker repeats its job, once. Other workers and
finished results are unaffected.
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
# A new process would search the current folder before the libraries; it receives `sys.path`.
FOR_CHILDREN = (*THREADS, "PYTHONSAFEPATH")
OUT_OF_MEMORY = errno.ENOMEM  # exit code of a worker
UNGUARDED = 97  # of a worker that would start workers while importing the user's script
PATIENCE = 5.0  # [s] for a worker to exit
ADVICE = "finished work is kept: run the same command again with fewer --workers to continue"
GUARD = (
    "worker processes import the script that starts them: put its code under "
    "`if __name__ == '__main__':`"
)
Job = TypeVar("Job")
Result = TypeVar("Result")


def end_if_imported() -> None:
    """End this process if it is a worker that is importing the user's script.

    Otherwise the script would start workers itself, and multiprocessing would fail with a long
    traceback.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(UNGUARDED)


class WorkerPool:
    """Up to `count` processes, started on demand and reused."""

    def __init__(self, count: int):
        self.count = count
        self.workers: list[Worker] = []

    def each(
        self, function: Callable[[Job], Result], jobs: Sequence[Job]
    ) -> Iterator[tuple[Job, Result]]:
        """Yield each job with `function(job)`, in order of completion; both are pickled.

        Raises PoiseError when two workers have died on one job, and whatever the function raises.
        """
        waiting = deque(PendingJob(function, job) for job in jobs)
        for _ in range(len(waiting)):
            task, result = self._next(waiting)
            self._hand_out(waiting)  # workers run while the caller handles the result
            yield task.job, result

    def end(self) -> None:
        """Let idle workers exit, then kill the others."""
        for worker in self.workers:
            worker.connection.close()
        for worker in self.workers:
            worker.process.join(0.0 if worker.task else PATIENCE)
        self.kill()

    def kill(self) -> None:
        """Kill all workers at once."""
        for worker in self.workers:
            worker.process.kill()
        for worker in self.workers:
            worker.process.join()
            worker.connection.close()
        self.workers.clear()

    def _next(
        self, waiting: deque[PendingJob[Job, Result]]
    ) -> tuple[PendingJob[Job, Result], Result]:
        """Return the next completed task with its result."""
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
                        f"{death}, as did another on the same work; {ADVICE}"
                    ) from None
                tell(f"{death}: its work is repeated")
                waiting.appendleft(task)
                continue
            done, value, where = pickle.loads(answer)
            if not done:
                raise value from WorkerTraceback(where)
            return task, value

    def _hand_out(self, waiting: deque[PendingJob]) -> None:
        """Assign tasks to idle workers, and to new ones up to `count`."""
        for worker in [worker for worker in self.workers if not worker.task]:
            if waiting:
                worker.give(waiting.popleft())
        while waiting and len(self.workers) < self.count:
            with uninterrupted():
                self.workers.append(Worker())
            self.workers[-1].give(waiting.popleft())


@dataclass(eq=False)
class PendingJob(Generic[Job, Result]):
    """A job, and the number of workers that have died on it."""

    function: Callable[[Job], Result]
    job: Job
    deaths: int = 0


class Worker:
    """A process, its connection and its current task."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.task: PendingJob | None = None
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,))
        self.process.start()
        theirs.close()  # only the worker holds it: its death closes the pipe

    def give(self, task: PendingJob) -> None:
        """Start the task in the worker."""
        self.task = task
        content = pickle.dumps((task.function, task.job))
        try:
            self.connection.send_bytes(content)
        except OSError:
            pass  # the worker is dead; reading its answer reports that

    def death(self) -> str:
        """Return how the worker died, in words."""
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
    """The traceback of an error raised in a worker."""


def tell(text: str) -> None:
    """Print a line to the standard error, above any progress bar."""
    print(f"poise: {text}", file=sys.stderr, flush=True)


def single_threaded() -> AbstractContextManager[None]:
    """Limit linear algebra of processes started inside to one thread, so sums keep their order."""
    return environment(dict.fromkeys(FOR_CHILDREN, "1"))


@contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables of this process inside the context."""
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
    """Run tasks until the main process closes the pipe or ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore", PoiseWarning)  # the main process has printed it
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):  # the main process has closed the pipe, or died
        while True:
            connection.send_bytes(_answer(connection.recv_bytes()))


def _answer(content: bytes) -> bytes:
    """Return the pickled result or exception."""
    try:
        function, job = pickle.loads(content)
        return pickle.dumps((True, function(job), ""))
    except MemoryError:
        os._exit(OUT_OF_MEMORY)
    except Exception as error:
        return pickle.dumps((False, _portable(error), traceback.format_exc()))


def _portable(error: Exception) -> Exception:
    """Return the error, or a RuntimeError with its text if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # an external controller may raise anything
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _end_with_parent() -> None:
    """End this process together with its parent, so that a kill leaves no orphans."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)
