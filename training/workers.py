"""Trials played by a few processes. Each builds the players once and then plays what it is given.

A trial's outcome depends on nothing but the trial, so that it is the same, bit for bit, whichever
process plays it and whatever it has played before.
"""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any

from poise.baselines.allowance import carried
from poise.envs.errors import PoiseError
from poise.envs.robot import load_robot

from .players import Player, load_player
from .trials import Outcome, Trial, run_trial

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
# A new process would search the current folder before the libraries; instead it is sent `sys.path`.
FOR_CHILDREN = (*THREADS, "PYTHONSAFEPATH")

DIED = (
    "a worker process has died (out of memory?); what is finished is kept: "
    "run the same command again to go on, with fewer --workers"
)

_players: list[Player] = []  # of this worker process


class Workers:
    """A pool of processes that play trials with the same controllers; use as a context.

    Args:
        controllers: names as `load_player` takes them.
        robot: name or path of the robot.
        overrides: arguments of the environments.
        count: number of processes.
    """

    def __init__(
        self, controllers: Sequence[str], robot: str, overrides: dict[str, Any], count: int
    ):
        self.arguments = (tuple(controllers), str(robot), overrides)
        self.count = count

    def __enter__(self) -> "Workers":
        self._open = ExitStack()
        self._open.enter_context(single_threaded())
        self.pool = process_pool(self.count, carried(_load), self.arguments)
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.pool.shutdown(wait=error is None, cancel_futures=True)
        self._open.close()

    def play(self, trials: Sequence[Trial]) -> Iterator[tuple[Trial, list[Outcome]]]:
        """Each trial with the outcome of every controller, as they are done.

        Raises:
            PoiseError: a process has died.
        """
        with without_interrupt():
            futures = {self.pool.submit(_play, trial): trial for trial in trials}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            raise PoiseError(DIED) from None


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started inside use one thread each for linear algebra; sums keep their order."""
    before = {name: os.environ.get(name) for name in FOR_CHILDREN}
    os.environ.update(dict.fromkeys(FOR_CHILDREN, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def process_pool(
    count: int, load: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
) -> ProcessPoolExecutor:
    """Fresh processes that leave Ctrl-C to this one and end with it; each calls `load` first."""
    return ProcessPoolExecutor(
        count,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start,
        initargs=(load, arguments),
    )


def end_processes(pool: ProcessPoolExecutor) -> None:
    """End the pool's processes at once: its own `shutdown` waits for what they are at."""
    for process in list((pool._processes or {}).values()):
        process.kill()


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Processes started inside never see Ctrl-C: the main process alone answers it."""
    resource_tracker.ensure_running()  # its start would undo the block
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _start(load: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if load is not None:
        load(*arguments)


def _load(controllers: tuple[str, ...], robot: str, overrides: dict[str, Any]) -> None:
    loaded = load_robot(robot)
    _players[:] = [load_player(name, loaded, **overrides) for name in controllers]


def _end_with_parent() -> None:
    """A killed main process leaves no orphans."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)


def _play(trial: Trial) -> list[Outcome]:
    return [run_trial(player, trial) for player in _players]
