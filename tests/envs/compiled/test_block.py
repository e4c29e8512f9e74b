"""Blocks: what compiled code reads through an address is what Python holds."""

import copy
import pickle
from dataclasses import dataclass

import numba
import numpy as np
import pytest

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Erased, address_of, call


@dataclass(frozen=True, eq=False)
class Inner(Block):
    """A part of another block."""

    vector: np.ndarray
    count: int


@dataclass(frozen=True, eq=False)
class Outer(Block):
    """One member of each kind."""

    flag: bool
    number: float
    cube: np.ndarray
    inner: Inner
    indices: np.ndarray
    open: np.ndarray


def outer(flag: bool = True, number: float = -2.5, count: int = -7) -> Outer:
    """A block of distinct numbers."""
    return Outer(
        flag=flag,
        number=number,
        cube=np.arange(24.0).reshape(2, 3, 4),
        inner=Inner(np.array([0.5, 0.25]), count),
        indices=np.array([3, 1, 2]),
        open=np.array([True, False]),
    )


@numba.njit
def read(block):
    """Every member, in ways that need its type, its shape and its strides."""
    last = block.cube[1, 2, 3], block.cube[1][:, 2].sum(), block.cube.shape
    inner = block.inner
    return (
        block.flag, block.number, last, inner.vector[1], inner.count, inner.vector.size,
        block.indices[-1], block.open[0], block.open[1],
    )  # fmt: skip


@numba.njit
def write(block, value):
    """Changes arrays in place."""
    block.inner.vector[:] = value
    for i in range(3):
        block.cube[0, i] += block.cube[1, i]


def test_compiled_code_reads_every_kind_of_member():
    """Numbers, arrays with their shapes, and blocks within blocks."""
    last = (23.0, 14.0 + 18.0 + 22.0, (2, 3, 4))
    assert read(outer()) == (True, -2.5, last, 0.25, -7, 2, 2, True, False)
    assert read(outer(flag=False, number=1e300, count=2**40))[:2] == (False, 1e300)
    assert read(outer(count=2**40))[4] == 2**40


def test_arrays_are_shared():
    """What compiled code writes, Python sees, and the other way round."""
    block = outer()
    write(block, 4.0)
    assert block.inner.vector.tolist() == [4.0, 4.0]
    assert np.array_equal(block.cube[0], np.arange(12.0).reshape(3, 4) * 2 + 12)
    block.inner.vector[1] = 9.0
    assert read(block)[3] == 9.0


def test_loops_see_what_they_have_written():
    """Addresses may be kept in registers, contents may not."""

    @numba.njit
    def doubled(block):
        for _ in range(10):
            for i in range(block.inner.vector.shape[0]):
                block.inner.vector[i] = block.inner.vector[i] + block.inner.vector[0]
        return block.inner.vector[0]

    assert doubled(outer()) == 0.5 * 2**10


def test_a_caller_by_address_need_not_know_the_block():
    """Blocks of two kinds look alike to it; each kernel finds its own."""

    @numba.njit
    def call_it(kernel, block):
        call(kernel, block)

    @numba.njit
    def count_up(block):
        block.indices[0] += 1

    @numba.njit
    def fill(block):
        block.vector[0] = 7.0

    block, inner = outer(), outer().inner
    for kernel, what in ((count_up, block), (fill, inner)):
        call_it(address_of(kernel, what), Erased(what))
    assert block.indices[0] == 4 and inner.vector[0] == 7.0
    assert len(call_it.signatures) == 1


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))])
def test_copies_have_memory_of_their_own(duplicate):
    """A copy reads its own arrays, not those of the block it was made from."""
    block = outer()
    other = duplicate(block)
    write(other, 4.0)
    assert read(other)[3] == 4.0 and read(block)[3] == 0.25


@numba.njit
def halve(block):
    """An exception if there is nothing to halve."""
    if block.count == 0:
        raise ZeroDivisionError("nothing to halve")
    block.vector[:] = block.vector / 2.0


@numba.njit
def halve_by_address(address, block):
    """`halve` of the inner block, then of it once more."""
    call(address, block.inner)
    call(address, block.inner)
    return block.inner.vector[0]


def test_kernels_are_called_by_address():
    """As if they were called by name."""
    block = outer()
    assert halve_by_address(address_of(halve, block.inner), block) == 0.125
    assert block.inner.vector.tolist() == [0.125, 0.0625]


def test_exceptions_pass_a_call_by_address():
    """What a kernel raises ends its caller as well, and nothing after it runs."""
    block = outer(count=0)
    with pytest.raises(ZeroDivisionError, match="nothing to halve"):
        halve_by_address(address_of(halve, block.inner), block)
    assert block.inner.vector.tolist() == [0.5, 0.25]


def test_blocks_of_one_kind_share_their_code():
    """Other sizes and values do not compile anew."""
    read(outer())
    compiled = len(read.signatures)
    inner = Inner(np.ones(9), 1)
    bigger = Outer(False, 0.0, np.ones((5, 6, 7)), inner, np.ones(4, int), np.ones(3, bool))
    assert read(bigger)[2][2] == (5, 6, 7) and len(read.signatures) == compiled


@pytest.mark.parametrize("vector", [np.arange(6.0)[::2], [1.0, 2.0], "x", None])
def test_what_cannot_be_held_is_refused(vector):
    """Strided arrays and foreign objects."""
    with pytest.raises(TypeError, match="block"):
        Inner(vector, 1)


def test_an_unknown_member_is_a_typing_error():
    """As an unknown attribute of any other type."""

    @numba.njit
    def wrong(block):
        return block.nothing

    with pytest.raises(numba.TypingError, match="nothing"):
        wrong(outer())


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64, np.int32, np.bool_, np.uint8])
@pytest.mark.parametrize("shape", [(), (3,), (2, 1), (0, 3, 2)])
@pytest.mark.parametrize("writeable", [True, False])
def test_an_array_has_the_type_that_numba_gives_it(
    dtype: type, shape: tuple[int, ...], writeable: bool
) -> None:
    array = np.zeros(shape, dtype=dtype)
    array.flags.writeable = writeable
    kind, _ = Inner(array, 1).numba_type.members["vector"]
    assert kind is numba.typeof(array)


def test_a_masked_array_is_refused() -> None:
    """Compiled code would read what the mask hides."""
    with pytest.raises(numba.core.errors.NumbaTypeError, match="MaskedArray"):
        Inner(np.ma.zeros(3), 1)
