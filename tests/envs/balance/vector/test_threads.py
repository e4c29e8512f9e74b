"""Threads that help."""

import threading
import time

import pytest

from poise.configs.errors import PoiseError
from poise.envs.balance.vector.threads import ThreadTeam


def test_the_work_is_shared():
    """Each number once, 0 in the thread that asks, the others at the same time as it."""
    helpers, seen, meeting = ThreadTeam(), {}, threading.Barrier(3, timeout=10.0)

    def work(number):
        meeting.wait()
        seen[number] = threading.current_thread()

    helpers.distribute(work, 2)
    assert set(seen) == {0, 1, 2} and len(set(seen.values())) == 3
    assert seen[0] is threading.current_thread()
    helpers.close()


@pytest.mark.parametrize("where", [0, 1])
def test_an_error_reaches_the_one_that_asked(where):
    """After all have ended; and the threads can be asked again."""
    helpers, done = ThreadTeam(), []

    def work(number):
        if number == where:
            raise ArithmeticError("too fast")
        time.sleep(0.05)
        done.append(number)

    with pytest.raises(ArithmeticError, match="too fast"):
        helpers.distribute(work, 1)
    assert done == [1 - where]
    helpers.distribute(done.append, 1)
    assert sorted(done[1:]) == [0, 1]
    helpers.close()


@pytest.mark.parametrize("how", ["closed", "forgotten"])
def test_threads_end(how):
    """When they are closed, and when nobody holds the helpers any more."""
    before = set(threading.enumerate())
    helpers = ThreadTeam()
    assert set(threading.enumerate()) == before  # a copy of this process would have none of them
    helpers.distribute(lambda number: None, 2)
    ours = set(threading.enumerate()) - before
    assert len(ours) == 2
    if how == "closed":
        helpers.close()
        for thread in ours:
            thread.join(10.0)
        with pytest.raises(PoiseError, match="close"):
            helpers.distribute(lambda number: None, 1)
    del helpers
    for thread in ours:
        thread.join(10.0)
        assert not thread.is_alive()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_the_dead_are_not_waited_for():
    """An error instead."""
    before = set(threading.enumerate())
    helpers = ThreadTeam()
    helpers.ask(lambda number: 1 // 0, 1)
    for thread in set(threading.enumerate()) - before:
        thread.join(10.0)
    with pytest.raises(PoiseError, match="a thread has ended"):
        helpers.distribute(lambda number: None, 1)
