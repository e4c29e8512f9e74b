"""Mutable numbers of blocks: Python and compiled code read and write the same memory by name."""

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, replace
from typing import Any

import numba
import numpy as np
import pytest

from poise.envs.compiled.block import Block
from poise.envs.compiled.copies import portable
from poise.envs.compiled.mutable import Mutable


@dataclass(eq=False)
class Timer(Block):
    """A number of each kind beside what cannot be assigned."""

    values: np.ndarray
    clock: Mutable[float]
    steps: Mutable[int]
    running: Mutable[bool]
    dt: float


@dataclass(frozen=True, eq=False)
class Owner(Block):
    """A block that is not mutable itself."""

    timer: Timer


@numba.njit
def tick(timer):
    """Write all three, each from what it was."""
    timer.clock += timer.dt
    timer.steps = 2 * timer.steps + 1
    timer.running = not timer.running
    return timer.clock, timer.steps, timer.running


@numba.njit
def tick_inner(owner):
    """The same through another block, twice in a loop."""
    for _ in range(2):
        tick(owner.timer)
    return owner.timer.clock


def timer() -> Timer:
    """Numbers that differ from each other."""
    return Timer(np.zeros(2), 1.5, 3, True, 0.25)


def numbers(block: Timer) -> tuple[float, int, bool]:
    """What Python reads."""
    return block.clock, block.steps, block.running


def test_compiled_code_and_python_see_each_others_numbers() -> None:
    block = timer()
    assert tick(block) == (1.75, 7, False) == numbers(block)
    block.clock, block.steps, block.running = -4.0, 2**40, True
    assert tick(block) == (-3.75, 2**41 + 1, False) == numbers(block)
    assert tick_inner(Owner(block)) == -3.25 == block.clock


def test_numbers_are_pythons_own() -> None:
    assert [type(number) for number in numbers(timer())] == [float, int, bool]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))])
def test_a_deep_copy_goes_on_by_itself(duplicate) -> None:
    block = timer()
    other = duplicate(block)
    tick(other)
    assert numbers(other) == (1.75, 7, False) and numbers(block) == (1.5, 3, True)


@pytest.mark.parametrize("duplicate", [copy.copy, lambda b: b.replace(dt=0.25)])
def test_a_shallow_copy_shares_numbers_as_it_shares_arrays(duplicate) -> None:
    block = timer()
    other = duplicate(block)
    tick(block)
    other.values[0] = 9.0
    assert numbers(other) == (1.75, 7, False) and block.values[0] == 9.0


def test_a_replacement_that_would_share_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="clock"):
        replace(timer(), dt=1.0)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))])
def test_blocks_that_share_a_number_share_it_in_their_copies(duplicate) -> None:
    first = timer()
    second = Timer(np.zeros(2), 0.0, first.memory_of("steps"), False, 1.0)
    tick(first)
    assert second.steps == 7
    others = duplicate([portable(first), portable(second)])
    tick(others[0])
    assert others[1].steps == 15 and second.steps == 7


def test_rows_of_one_array_are_numbers_of_several_blocks() -> None:
    rows = np.zeros(3)
    blocks = [Timer(np.zeros(1), rows[i : i + 1], i, False, 0.5) for i in range(3)]
    tick(blocks[1])
    assert rows.tolist() == [0.0, 0.5, 0.0]
    rows[2] = 7.0
    assert blocks[2].clock == 7.0


@pytest.mark.parametrize("name", ["dt", "values", "clocks", "_address"])
def test_nothing_else_is_assigned(name: str) -> None:
    block = timer()
    with pytest.raises(FrozenInstanceError, match=name):
        setattr(block, name, 1.0)


def test_nothing_else_is_assigned_in_compiled_code() -> None:
    @numba.njit
    def fixed(block):
        block.dt = 1.0

    @numba.njit
    def unknown(block):
        block.clocks = 1.0

    with pytest.raises(numba.TypingError, match="'dt' of Timer.* is not mutable"):
        fixed(timer())
    with pytest.raises(numba.TypingError, match="clocks"):
        unknown(timer())


@pytest.mark.parametrize(
    ("name", "value"),
    [("clock", "1"), ("clock", None), ("steps", 1.5), ("steps", np.zeros(1)), ("running", 2.0),
     ("running", 3)],
)  # fmt: skip
def test_a_number_of_another_type_is_refused(name: str, value: object) -> None:
    block = timer()
    with pytest.raises(TypeError, match=name):
        setattr(block, name, value)
    assert numbers(block) == (1.5, 3, True)


@pytest.mark.parametrize("array", [np.zeros(2), np.zeros(1, np.float32), np.zeros(())])
def test_a_shared_array_has_one_entry_of_the_type(array: np.ndarray) -> None:
    with pytest.raises(TypeError, match="clock"):
        Timer(np.zeros(2), array, 0, False, 1.0)


def test_allocated_numbers_are_zero_and_cleared_ones_too() -> None:
    block = Timer.allocate(values=np.ones(2), steps=4, dt=0.5)
    assert numbers(block) == (0.0, 4, False)
    tick(block)
    block.clear()
    assert numbers(block) == (0.0, 0, False) and block.values.tolist() == [0.0, 0.0]
    assert block.dt == 0.5


def test_a_member_does_not_hide_a_method() -> None:
    """A dataclass would take the method for the member's default."""
    with pytest.raises(TypeError, match=r"Hiding\.replace"):
        type("Hiding", (Block,), {"__annotations__": {"replace": float}})


def test_annotations_may_be_postponed() -> None:
    made = type("Late", (Block,), {"__annotations__": {"steps": "Mutable[int]"}})
    late: Any = dataclass(eq=False)(made)
    assert late(3).steps == 3


def test_a_frozen_block_has_no_mutable_number() -> None:
    @dataclass(frozen=True, eq=False)
    class Frozen(Block):
        clock: Mutable[float]

    with pytest.raises(TypeError, match="frozen"):
        Frozen(1.0)


@pytest.mark.parametrize("kind", [Mutable[str], "Mutable[str]"])
def test_other_annotations_are_refused(kind: object) -> None:
    with pytest.raises(TypeError, match="Mutable"):
        type("Wrong", (Block,), {"__annotations__": {"clock": kind}})
