"""Policy steps that compiled code plays by their addresses, many of them in several threads."""

import os
import time

import numpy as np

from poise.configs.errors import PoiseError
from poise.envs.compiled.atomics import look_at, swap, take_turn
from poise.envs.compiled.calls import call, play_one
from poise.envs.compiled.jit import compiled

from .threads import ThreadTeam

SPLIT = 1  # steps for each thread that are shared out tick by tick at the end
MANY = 6  # steps for each thread from which on that is worth its while
# Looks of a helper for its next call before it sleeps: 0.25 ms here, what Python takes between two
# batches. To sleep and be woken costs 0.1 ms.
PATIENCE = 1_500_000
AWAY, WAITING, CALLED = 0, 1, 2  # a helper plays or sleeps, looks for a call, has one
LINE = 8  # integers that a cache line holds


NOTHING = np.zeros((0, 3), dtype=np.int64)  #: no steps


class StepSchedule:
    """A schedule of `steps` (n, 3), rows of `CompiledStep`, for `threads` threads.

    A thread plays those of its own queue, which stay in its cache from call to call, then helps the
    others; at last all of them play some steps tick by tick, so that none waits for a whole step
    of another one.
    """

    def __init__(self, steps: np.ndarray, threads: int):
        n = len(steps)
        split = SPLIT * threads if threads > 1 and n >= MANY * threads else 0
        self.steps = steps
        self.ends = np.arange(threads + 1) * (n - split) // threads  # of the queues
        self.turns = np.zeros(threads, dtype=np.int64)  # next of each queue
        self.done = np.zeros(split, dtype=np.int64)  # ticks of the steps that are split
        self.taken = np.zeros(split, dtype=np.int64)  # 1 while a thread plays one of their ticks
        # of each helper, in a line of its own: AWAY, WAITING or CALLED; 1 once it has finished
        self.calls = np.zeros(LINE * threads, dtype=np.int64)
        self.finished = np.zeros(LINE * threads, dtype=np.int64)
        self._process = os.getpid()  # that the threads are of

    def __reduce__(self) -> tuple[object, ...]:
        if len(self.steps):
            raise PoiseError("turns hold addresses: copy the environments that they are of")
        return StepSchedule, (NOTHING, len(self.turns))

    def begin(self) -> None:
        """Run all steps once more; in a forked process no helper runs or waits yet."""
        if self._process != os.getpid():
            self._process = os.getpid()
            self.calls[:] = AWAY
            self.taken[:] = 0
        self.turns[:] = self.ends[:-1]
        self.done[:] = 0

    def play(self, thread: int) -> None:
        """A thread's part; returns when what is left is in the hands of others."""
        play(self.steps, self.ends, self.turns, self.done, self.taken, thread)

    def play_all(self, helpers: ThreadTeam) -> None:
        """Every step once, in this thread and as many `helpers` as there are threads."""
        self.begin()
        called = range(1, min(len(self.turns), len(self.steps)))
        for thread in called:
            if not call_waiting(self.calls, self.finished, thread):
                helpers.ask(self._stay, thread)
        try:
            self.play(0)
        finally:
            for thread in called:
                while not has_finished(self.finished, thread):
                    helpers.expect_alive()
                    time.sleep(0.0)  # its turn, if there are fewer cores than threads

    def _stay(self, thread: int) -> None:
        """A helper's part of this call, and of those that follow soon enough."""
        stay(
            self.steps, self.ends, self.turns, self.done, self.taken, thread,
            self.calls, self.finished,
        )  # fmt: skip


@compiled
def play(
    steps: np.ndarray, ends: np.ndarray, turns: np.ndarray,
    done: np.ndarray, taken: np.ndarray, thread: int,
):  # fmt: skip
    """Play a thread's part of a `StepSchedule`."""
    queues, split = turns.shape[0], done.shape[0]
    for i in range(queues):
        queue = (thread + i) % queues
        k = take_turn(turns, queue)
        while k < ends[queue + 1]:
            play_one(steps[k, 0], steps[k, 1], steps[k, 2])
            k = take_turn(turns, queue)
    first = steps.shape[0] - split
    while True:
        least, found = np.int64(0), -1
        for i in range(split):  # the one that is most behind
            ticks = look_at(done, i)
            if ticks < steps[first + i, 2] and look_at(taken, i) == 0:
                if found < 0 or ticks < least:
                    least, found = ticks, i
        if found < 0:
            return
        if swap(taken, found, 1) == 0:
            if done[found] < steps[first + found, 2]:
                call(steps[first + found, 0], steps[first + found, 1])
                done[found] += 1
            swap(taken, found, 0)


@compiled
def call_waiting(calls: np.ndarray, finished: np.ndarray, thread: int):
    """Call a helper; False if it is away, and has to be woken."""
    swap(finished, LINE * thread, 0)
    return swap(calls, LINE * thread, CALLED) == WAITING


@compiled
def has_finished(finished: np.ndarray, thread: int):
    """Return whether a helper has finished its part; polls for a while."""
    for _ in range(PATIENCE):
        if look_at(finished, LINE * thread) == 1:
            return True
    return False


@compiled
def stay(
    steps: np.ndarray, ends: np.ndarray, turns: np.ndarray, done: np.ndarray,
    taken: np.ndarray, thread: int, calls: np.ndarray, finished: np.ndarray,
):  # fmt: skip
    """Run, and wait for the next call without the GIL; returns when there was none for a while."""
    while True:
        play(steps, ends, turns, done, taken, thread)
        swap(calls, LINE * thread, WAITING)  # first: a caller that reads "finished" may call
        swap(finished, LINE * thread, 1)
        for _ in range(PATIENCE):
            if look_at(calls, LINE * thread) == CALLED:
                break
        if swap(calls, LINE * thread, AWAY) != CALLED:
            return
