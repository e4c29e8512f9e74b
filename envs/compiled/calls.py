"""Kernels that are called by their addresses."""

import importlib
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from poise.configs.errors import PoiseError

from .block import Block, BlockType
from .jit import compiled

B = TypeVar("B", bound=Block)


@dataclass(frozen=True, eq=False)
class Erased(Block):
    """Another block, of which a caller by address knows no more than where it lies.

    A kernel that calls others by address is compiled once, whatever they work on.
    """

    inner: Block

    def __post_init__(self) -> None:
        object.__setattr__(self, "_address", self.inner.address)
        object.__setattr__(self, "_type", BlockType("Erased", ()))


class Kernel(int, Generic[B]):
    """The address of a compiled function that takes one block, a `B`, and returns nothing.

    A block that holds the address says in its field what the function works on, as in
    `Kernel[Search]`. `kernel` is the function and `kind` Numba's type of the block. The function
    lies elsewhere in another process: its name and the type are what is pickled.
    """

    kernel: Any
    kind: BlockType

    def __deepcopy__(self, memo: dict[int, Any]) -> "Kernel[B]":
        return self

    def __copy__(self) -> "Kernel[B]":
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        if not self:
            return Kernel, (0,)
        function = self.kernel.py_func
        module, name = function.__module__, function.__qualname__
        if getattr(sys.modules.get(module), name, None) is not self.kernel:
            raise PoiseError(f"cannot be pickled: {name!r} is no compiled function of {module!r}")
        return _address, (module, name, self.kind)


def _address(module: str, name: str, kind: BlockType) -> Kernel:
    """The address of a module's function, in this process."""
    return _compiled(getattr(importlib.import_module(module), name), kind)


@cache  # Numba looks for 20 µs whether it has compiled the function already
def _compiled(kernel: Any, kind: BlockType) -> Kernel:
    kernel.compile((kind,))
    result = kernel.overloads[kind,]
    if result.signature.return_type not in (types.none, types.float64):
        name, given = kernel.py_func.__qualname__, result.signature.return_type
        raise TypeError(f"{name} returns {given}: nothing or a float can be called by its address")
    address: Kernel = Kernel(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
    address.kernel, address.kind = kernel, kind
    return address


NO_KERNEL: Kernel = Kernel(0)  #: stands in a block that calls no function, or not yet


def address_of(kernel: Any, block: B) -> Kernel[B]:
    """The address of the compiled function `kernel(block)`, for `call`, or `value_of` for a float.

    A function called by its address is compiled apart from its caller: neither waits for the
    other, and it is not optimised once more within all that it is called from.
    """
    return _compiled(kernel, block.numba_type)


def _calling(returned: types.Type, address: Any, block: Any) -> Any:
    """Signature and code of a call by address, whose exceptions go on."""
    kind = block if isinstance(block, BlockType) else types.voidptr

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention = context.call_conv
        function = convention.get_function_type(returned, (kind,))
        kernel = builder.inttoptr(args[0], function.as_pointer())
        pointer = args[1]
        if kind is types.voidptr:
            pointer = builder.inttoptr(pointer, context.get_value_type(kind))
        status, value = convention.call_function(builder, kernel, returned, (kind,), [pointer])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value() if returned == types.none else value

    return returned(address, block), generate


@intrinsic
def call(typing: Any, address: Any, block: Any) -> Any:
    """`kernel(block)` by the address of the compiled function; its exceptions go on.

    The block may also be given by its address.
    """
    return _calling(types.none, address, block)


@intrinsic
def call_named(typing: Any, function: Any, address: Any, block: Any) -> Any:
    """`function(block)` by its address: as `call`, which names what is called.

    Nothing of `function` is compiled here; whoever made the block took the address of this one.
    """
    _, generate = _calling(types.none, address, block)

    def without_function(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return generate(context, builder, signature, args[1:])

    return types.none(function, address, block), without_function


@intrinsic
def value_of(typing: Any, address: Any, block: Any) -> Any:
    """The float that `kernel(block)` returns, otherwise as `call`."""
    return _calling(types.float64, address, block)


@dataclass(frozen=True, eq=False)
class Program(Block):
    """Kernels that are called one after the other, each with a block of its own, see `of`."""

    rows: np.ndarray  # (n, 2) int: the addresses of a kernel and of its block; 0, 0: nothing

    @classmethod
    def of(cls, calls: Iterable[tuple[Any, Block] | None]) -> "Program":
        """A program of (kernel, block) pairs; None leaves a row free."""
        return cls._linked(tuple(each and (address_of(*each), each[1]) for each in calls))

    @classmethod
    def _linked(cls, calls: tuple[tuple[Kernel, Block] | None, ...]) -> "Program":
        rows = [(int(call[0]), call[1].address) if call else (0, 0) for call in calls]
        program = cls(np.array(rows, dtype=np.int64).reshape(-1, 2))
        object.__setattr__(program, "_calls", calls)  # it keeps the blocks
        return program

    def blocks(self) -> list[Any]:
        """The blocks of its kernels, in order."""
        return [call[1] for call in self._calls if call]  # type: ignore[attr-defined]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self)._linked, (self._calls,)  # type: ignore[attr-defined]

    def __copy__(self) -> "Program":
        return self._linked(self._calls)  # type: ignore[attr-defined]


@compiled
def run(program: Program):
    """Call all kernels of `program` in order."""
    rows = program.rows
    for i in range(rows.shape[0]):
        if rows[i, 0] != 0:
            call(rows[i, 0], rows[i, 1])


class CompiledStep(NamedTuple):
    """A policy step: `kernel`, by its address, `ticks` times with `block`. It must not raise."""

    kernel: Kernel
    block: Block
    ticks: int = 1

    def row(self) -> tuple[int, int, int]:
        """Return the addresses of the kernel and of its block, and how often `play` calls it."""
        return int(self.kernel), self.block.address, self.ticks

    def play(self) -> None:
        """Take the step."""
        play_one(*self.row())

    def play_tick(self) -> None:
        """Take the next one of its ticks."""
        play_one(int(self.kernel), self.block.address, 1)


@compiled
def play_one(kernel: int, block: int, ticks: int):
    """Call `kernel` `ticks` times."""
    for _ in range(ticks):
        call(kernel, block)
