"""envs/compiled/callbacks.py: compiled code calls Python, whose errors wait."""

import copy
import pickle
import threading

import pytest

from poise.envs.compiled.callbacks import Callback, call_back
from poise.envs.compiled.jit import compiled


@compiled
def call_twice(address: int):
    """What compiled code does with an address."""
    call_back(address)
    call_back(address)


class Counter:
    """Counts calls of `up`, a callback of its own."""

    def __init__(self, fails_at: int = 100):
        self.count, self.fails_at = 0, fails_at
        self.threads: set[str] = set()
        self.callback = Callback(self.up)

    def up(self) -> None:
        self.count += 1
        self.threads = {*self.threads, threading.current_thread().name}
        if self.count >= self.fails_at:
            raise KeyError("too far")


def test_it_is_called_in_the_thread_of_the_caller():
    """With the GIL, that compiled code has released."""
    counter = Counter()
    call_twice(counter.callback.address)
    thread = threading.Thread(
        target=call_twice, args=(counter.callback.address,), name="another thread"
    )
    thread.start()
    thread.join()
    assert counter.count == 4 and len(counter.threads) == 2
    assert "another thread" in counter.threads
    counter.callback.check()


def test_an_error_waits_and_is_raised_once():
    """Compiled code goes on meanwhile."""
    counter = Counter(fails_at=1)
    call_twice(counter.callback.address)
    assert counter.count == 2
    with pytest.raises(KeyError, match="too far"):
        counter.callback.check()
    counter.callback.check()


@pytest.mark.parametrize("way", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_a_copy_calls_its_own_function(way):
    """Also by an address that was copied with it."""
    counter = Counter()
    counter.address = counter.callback.address
    call_twice(counter.address)
    other = way(counter)
    call_twice(other.address)
    assert other.address == other.callback.address != counter.address
    assert (counter.count, other.count) == (2, 4)
