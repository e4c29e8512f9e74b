"""Kernels that are called by their addresses."""

import importlib
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from poise.configs.errors import PoiseError

from .block import Block, BlockType
from .jit import compiled


@dataclass(frozen=True, eq=False)
class Erased(Block):
    """Another block, of which a caller by address knows no more than where it lies.

    A kernel that calls others by address is compiled once, whatever they work on.
    """

    inner: Block

    def __post_init__(self) -> None:
        object.__setattr__(self, "_address", self.inner.address)
        object.__setattr__(self, "_type", BlockType("Erased", ()))


class Address(int):
    """Where the function `kernel` lies, compiled for blocks of the type `kind`.

    In another process it lies elsewhere: what is pickled is its name, and the type.
    """

    kernel: Any
    kind: BlockType

    def __deepcopy__(self, memo: dict[int, Any]) -> "Address":
        return self

    def __copy__(self) -> "Address":
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        function = self.kernel.py_func
        module, name = function.__module__, function.__qualname__
        if getattr(sys.modules.get(module), name, None) is not self.kernel:
            raise PoiseError(f"cannot be pickled: {name!r} is no compiled function of {module!r}")
        return _address, (module, name, self.kind)


def _address(module: str, name: str, kind: BlockType) -> Address:
    """The address of a module's function, in this process."""
    return _compiled(getattr(importlib.import_module(module), name), kind)


def _compiled(kernel: Any, kind: BlockType) -> Address:
    kernel.compile((kind,))
    result = kernel.overloads[kind,]
    address = Address(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
    address.kernel, address.kind = kernel, kind
    return address


def address_of(kernel: Any, block: Block) -> Address:
    """The address of the compiled function `kernel(block)`, which returns nothing, for `call`.

    A function called by its address is compiled apart from its caller: neither waits for the
    other, and it is not optimised once more within all that it is called from.
    """
    return _compiled(kernel, block.numba_type)


@intrinsic
def call(typing: Any, address: Any, block: Any) -> Any:
    """`kernel(block)` by the address of the compiled function; its exceptions go on.

    The block may also be given by its address.
    """
    kind = block if isinstance(block, BlockType) else types.voidptr

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention = context.call_conv
        function = convention.get_function_type(types.none, (kind,))
        kernel = builder.inttoptr(args[0], function.as_pointer())
        pointer = args[1]
        if kind is types.voidptr:
            pointer = builder.inttoptr(pointer, context.get_value_type(kind))
        status, _ = convention.call_function(builder, kernel, types.none, (kind,), [pointer])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.void(address, block), generate


class CompiledStep(NamedTuple):
    """A policy step: `kernel`, by its address, `ticks` times with `block`. It must not raise."""

    kernel: int
    block: Block
    ticks: int = 1

    def row(self) -> tuple[int, int, int]:
        """What `play` reads."""
        return int(self.kernel), self.block.address, self.ticks

    def play(self) -> None:
        """Take the step."""
        play_one(*self.row())


@compiled
def play_one(kernel: int, block: int, ticks: int):
    """Call `kernel` `ticks` times."""
    for _ in range(ticks):
        call(kernel, block)


@dataclass(frozen=True, eq=False)
class Calls(Block):
    """Kernels and the block that each works on, for `call_all`; made by `calls_of`."""

    table: np.ndarray  # (n, 2) int: addresses of kernels and of blocks

    pairs: ClassVar[tuple[tuple[Address, Block], ...]] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return calls_of, (self.pairs,)

    def __copy__(self) -> "Calls":
        return calls_of(self.pairs)


def calls_of(pairs: Iterable[tuple[Address, Block]]) -> Calls:
    """Calls of kernels by address (see `address_of`), each with its block, in order."""
    pairs = tuple(pairs)
    rows = [(int(address), block.address) for address, block in pairs]
    calls = Calls(np.array(rows, dtype=np.int64).reshape(len(rows), 2))
    object.__setattr__(calls, "pairs", pairs)
    return calls


@compiled
def call_all(calls: Calls):
    """All the calls, one after the other."""
    for i in range(calls.table.shape[0]):
        call(calls.table[i, 0], calls.table[i, 1])
