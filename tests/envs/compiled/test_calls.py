"""Kernels called by their addresses, and programs of them."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program, address_of, run, value_of
from poise.envs.compiled.jit import compiled


@dataclass(frozen=True, eq=False)
class Cell(Block):
    """A number."""

    value: np.ndarray  # (1,)


@dataclass(frozen=True, eq=False)
class Machine(Block):
    """A program, as a member of another block."""

    program: Program


@compiled
def double(cell: Cell):
    cell.value[0] *= 2.0


@compiled
def increase(cell: Cell):
    cell.value[0] += 1.0


@compiled
def whole(cell: Cell):
    return 1


@compiled
def half(cell: Cell) -> float:
    return 0.5 * cell.value[0]


@compiled
def start(machine: Machine):
    run(machine.program)


@compiled
def ask(kernel: int, block: int) -> float:
    return value_of(kernel, block)


def cell(value: float) -> Cell:
    return Cell(np.array([value]))


def test_a_program_calls_its_kernels_in_order() -> None:
    """Each with its own block, from Python and from within a block; a free row is left out."""
    one, two = cell(3.0), cell(5.0)
    program = Program.of([(double, one), (increase, one), (increase, two)])
    run(program)
    assert one.value[0] == 7.0 and two.value[0] == 6.0
    start(Machine(program))
    assert one.value[0] == 15.0 and two.value[0] == 7.0
    run(Program.of(()))
    assert Program.of([None, (double, one)]).rows[0].tolist() == [0, 0]


def test_a_program_keeps_its_blocks() -> None:
    """They live as long as it does, though only their addresses lie in it."""
    kept = np.array([1.0])
    program = Program.of([(double, Cell(kept))])
    for _ in range(100):  # whatever takes the place of a block that was dropped
        cell(9.0)
        run(program)
    assert kept[0] == 2.0**100


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))])
def test_copies_of_programs_have_addresses_of_their_own(way) -> None:
    """A copy calls the same kernels, of copied blocks (those of a shallow copy are shared)."""
    one = cell(1.0)
    machine = Machine(Program.of([(double, one), None]))
    other = way(machine)
    start(other)
    start(other)
    assert one.value[0] == (4.0 if way is copy.copy else 1.0)
    assert other.program.rows.shape == (2, 2)


def test_a_kernel_may_return_a_float() -> None:
    """Or nothing; whatever else is refused before it is called."""
    block = cell(3.0)
    assert ask(int(address_of(half, block)), block.address) == 1.5
    with pytest.raises(TypeError, match="whole returns .*: nothing or a float"):
        address_of(whole, block)


def test_a_kernel_is_looked_up_once_for_each_type() -> None:
    """Blocks are made anew between ticks: an address that is known is not asked of Numba again."""
    address = address_of(double, cell(1.0))
    assert address_of(double, cell(2.0)) is address
    assert address_of(increase, cell(1.0)) != address
