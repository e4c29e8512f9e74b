"""Steps that threads share out: each is played whole, in order, by one thread at a time."""

import time
from dataclasses import dataclass
from threading import Barrier, Thread

import numpy as np
import pytest

from poise.configs.errors import PoiseError
from poise.envs.balance.vector.scheduler import MANY, StepSchedule
from poise.envs.balance.vector.threads import ThreadTeam
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.compiled.jit import compiled


@dataclass(frozen=True, eq=False)
class Log(Block):
    """What a step has seen."""

    ticks: np.ndarray  # (1,) int: played
    busy: np.ndarray  # (1,) int: whether a thread is at it
    clashes: np.ndarray  # (1,) int: ticks begun while another one ran
    work: np.ndarray  # (1,)
    effort: int


@compiled
def tick(log: Log):
    """Take a while."""
    log.clashes[0] += log.busy[0]
    log.busy[0] = 1
    before = log.ticks[0]
    for i in range(log.effort):
        log.work[0] = np.sin(log.work[0] + i)
    log.ticks[0] = before + 1
    log.busy[0] = 0


def counted(ticks, effort=2000):
    """A step that counts."""
    log = Log(*(np.zeros(1, dtype=np.int64) for _ in range(3)), np.zeros(1), effort)
    return CompiledStep(address_of(tick, log), log, ticks)


def test_one_step():
    """Alone it is played `ticks` times."""
    step = counted(3)
    step.play()
    assert step.block.ticks[0] == 3


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("per_thread", [1, MANY, 3 * MANY])
def test_every_step_is_played_whole(threads, per_thread):
    """With as few steps as threads and with many; the last ones are shared out tick by tick."""
    steps = [counted(1 + k % 5) for k in range(per_thread * threads)]
    turns = StepSchedule(np.array([step.row() for step in steps]), threads)
    split = len(turns.done)
    assert (split > 0) == (threads > 1 and per_thread >= MANY)
    rounds = 30
    for _ in range(rounds):
        turns.begin()
        helpers = [Thread(target=turns.play, args=(k,)) for k in range(1, threads)]
        for helper in helpers:
            helper.start()
        turns.play(0)
        for helper in helpers:
            helper.join()
    for step in steps:
        assert step.block.ticks[0] == rounds * step.ticks
        assert step.block.clashes[0] == 0


def test_a_tick_is_one_threads():
    """Also where threads reach for the same steps all the time."""
    threads, rounds, ticks = 4, 10, 20_000
    steps = [counted(ticks, effort=3) for _ in range(MANY * threads)]
    turns = StepSchedule(np.array([step.row() for step in steps]), threads)
    turns.ends[:] = 0  # all but those that are split have been played
    start, end = Barrier(threads), Barrier(threads)

    def help_out(thread):
        for _ in range(rounds):
            if thread == 0:
                turns.begin()
            start.wait()
            turns.play(thread)
            end.wait()

    helpers = [Thread(target=help_out, args=(k,)) for k in range(1, threads)]
    for helper in helpers:
        helper.start()
    help_out(0)
    for helper in helpers:
        helper.join()
    split = steps[-len(turns.done) :]
    assert [step.block.ticks[0] for step in split] == [rounds * ticks] * len(split)
    assert not any(step.block.clashes[0] for step in split)


def test_a_thread_alone_plays_all():
    """The queues of threads that never come are emptied, and all ticks taken."""
    steps = [counted(2) for _ in range(3 * MANY)]
    turns = StepSchedule(np.array([step.row() for step in steps]), 3)
    turns.begin()
    turns.play(1)
    assert [step.block.ticks[0] for step in steps] == [2] * len(steps)


ENOUGH = 10_000  # rounds within which a helper finds a core even where other jobs hold them


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("pause", [0.0, 0.02])
def test_helpers_stay_for_the_next_call(threads, pause, monkeypatch):
    """Called again at once they are still there; after a pause they are woken. All is played."""
    steps = [counted(2) for _ in range(2 * MANY * threads)]
    turns, helpers = StepSchedule(np.array([step.row() for step in steps]), threads), ThreadTeam()
    woken, ask = [], helpers.ask
    monkeypatch.setattr(helpers, "ask", lambda work, k: (woken.append(k), ask(work, k)))
    rounds = 0
    waits = threads > 1 and pause == 0.0
    while rounds < 30 or (waits and len(woken) == rounds * (threads - 1) < ENOUGH):
        turns.play_all(helpers)
        time.sleep(pause)
        rounds += 1
    assert [step.block.ticks[0] for step in steps] == [2 * rounds] * len(steps)
    assert not any(step.block.clashes[0] for step in steps)
    assert set(woken) == set(range(1, threads))
    if waits:
        assert len(woken) < rounds * (threads - 1)
    if threads > 1 and pause > 0.0:
        assert len(woken) > threads - 1
    helpers.close()


def test_other_steps_than_those_that_a_helper_waits_for():
    """It comes once it has waited long enough; each of two kinds of turns is played in full."""
    helpers, kinds = ThreadTeam(), []
    for count in (4, 9):
        steps = [counted(3) for _ in range(count)]
        kinds.append((steps, StepSchedule(np.array([step.row() for step in steps]), 2)))
    for _ in range(10):
        for _, turns in kinds:
            turns.play_all(helpers)
    for steps, _ in kinds:
        assert [step.block.ticks[0] for step in steps] == [30] * len(steps)
    helpers.close()


def test_an_interrupt_leaves_no_helper_at_work(monkeypatch):
    """What the caller did not play its helper has, before the interrupt goes on."""
    steps = [counted(2) for _ in range(4)]
    turns, helpers = StepSchedule(np.array([step.row() for step in steps]), 2), ThreadTeam()

    def interrupt(thread):
        raise KeyboardInterrupt

    monkeypatch.setattr(turns, "play", interrupt)
    with pytest.raises(KeyboardInterrupt):
        turns.play_all(helpers)
    assert [step.block.ticks[0] for step in steps] == [2] * len(steps)
    helpers.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_helper_that_died_is_not_waited_for():
    """As in the copy of a process: an error instead."""
    helpers = ThreadTeam()
    helpers.ask(lambda number: 1 // 0, 1)
    step = counted(1)
    turns = StepSchedule(np.array([step.row()] * 2), 2)
    with pytest.raises(PoiseError, match="a thread has ended"):
        turns.play_all(helpers)
