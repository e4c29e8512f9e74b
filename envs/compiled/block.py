"""Named arrays and numbers that compiled code reads through one address.

A named tuple costs a call some 0.2 µs for each of its arrays, and every function that takes one
compiles all of them. A `Block` is handed over as a pointer: its arrays' addresses and sizes, and
its numbers, lie one after the other in memory, and only what a function uses is read.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Self, get_origin, get_type_hints

import llvmlite.ir
import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np import numpy_support
from numba.np.arrayobj import populate_array

from .copies import portable
from .memory import guarded_zeros

#: in a block: a number that compiled code writes, which is an array of one entry
Number = Annotated[np.ndarray, 1]
Integer = Annotated[np.ndarray, 1, np.int64]


@dataclass(frozen=True, eq=False)
class Block:
    """Base of frozen dataclasses of arrays, floats, ints, bools and other blocks.

    Numbers are copied when the block is made; arrays are shared, so writing into them is seen by
    both sides. A block must outlive the compiled calls that use it: it holds its arrays.
    """

    def __post_init__(self) -> None:
        words: list[int] = []
        members = []
        for field in fields(self):
            kind, content = _words(getattr(self, field.name))
            members.append((field.name, kind, len(words)))
            words += content
        memory = np.array(words, dtype=np.int64)
        object.__setattr__(self, "_memory", memory)
        object.__setattr__(self, "_address", memory.ctypes.data)
        object.__setattr__(self, "_type", BlockType(type(self).__name__, tuple(members)))

    @classmethod
    def allocate(cls, sizes: Mapping[str, int] | None = None, **members: Any) -> Self:
        """A block of these members, and of zeros for every other array, whose shape is annotated.

        `Annotated[np.ndarray, "nv+1", 3]` is (nv + 1, 3), of which `sizes` has nv; "6nc" is six
        times nc. A type at the end is that of the numbers, which are floats by default.
        """
        for name, kind in get_type_hints(cls, include_extras=True).items():
            if name not in members and get_origin(kind) is Annotated:
                *shape, last = kind.__metadata__
                typed = isinstance(last, type)
                shape += [] if typed else [last]
                lengths = tuple(_length(part, sizes or {}) for part in shape)
                members[name] = guarded_zeros(lengths, last if typed else float)
        return cls(**members)

    @property
    def address(self) -> int:
        """The address at which compiled code finds the members."""
        return self._address  # type: ignore[attr-defined]

    @property
    def numba_type(self) -> "BlockType":
        """Numba's type: two blocks of one type are read by the same code."""
        return self._type  # type: ignore[attr-defined]

    def replace_number(self, name: str, value: float) -> None:
        """Exchange a number between two calls of compiled code, in place."""
        kind, word = self.numba_type.members[name]
        assert kind == types.float64, name  # arrays and blocks stay what they are
        object.__setattr__(self, name, value)
        self._memory[word] = np.float64(value).view(np.int64)  # type: ignore[attr-defined]

    def replace_block(self, name: str, block: "Block") -> None:
        """Exchange a block for another one of its type between two calls of compiled code."""
        kind, word = self.numba_type.members[name]
        assert kind == block.numba_type, name
        object.__setattr__(self, name, block)
        self._memory[word] = block.address  # type: ignore[attr-defined]

    def members(self) -> tuple[Any, ...]:
        """The fields' values, in order."""
        return tuple(getattr(self, field.name) for field in fields(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(portable(member) for member in self.members())

    def __copy__(self) -> Any:
        return type(self)(*self.members())


def _length(part: int | str, sizes: Mapping[str, int]) -> int:
    """The number that a part of an annotated shape stands for."""
    if isinstance(part, int):
        return part
    found = re.fullmatch(r"(\d*)([a-z]+)([+-]\d+)?", part)
    if found is None:
        raise ValueError(f"not a length: {part!r}")
    return int(found[1] or 1) * sizes[found[2]] + int(found[3] or 0)


def _words(value: Any) -> tuple[types.Type, list[int]]:
    """Numba's type of a field, and its 64-bit words."""
    if isinstance(value, Block):
        return value.numba_type, [value.address]
    if isinstance(value, np.ndarray):
        if not value.flags.c_contiguous or not value.flags.aligned:
            raise TypeError("a block holds contiguous arrays only")
        return _array_type(value), [value.ctypes.data, *value.shape]
    if isinstance(value, (bool, np.bool_)):
        return types.boolean, [int(value)]
    if isinstance(value, (int, np.integer)):
        return types.int64, [int(value)]
    if isinstance(value, float):
        return types.float64, [int(np.float64(value).view(np.int64))]
    raise TypeError(f"a block cannot hold {value!r}")


def _array_type(array: np.ndarray) -> types.Type:
    """Numba's type of a contiguous array. `numba.typeof` takes 5 µs, which a block has for each."""
    if type(array) is not np.ndarray:
        return numba.typeof(array)
    return _contiguous(array.dtype, array.ndim, not array.flags.writeable)


@cache
def _contiguous(dtype: np.dtype, dimensions: int, readonly: bool) -> types.Array:
    return types.Array(numpy_support.from_dtype(dtype), dimensions, "C", readonly=readonly)


class BlockType(types.Type):
    """Numba's type of a block: its name, and (name, type, first word) of each member."""

    def __init__(self, title: str, members: tuple[tuple[str, types.Type, int], ...]):
        self.members = {name: (kind, word) for name, kind, word in members}
        super().__init__(f"{title}({', '.join(f'{name}: {kind}' for name, kind, _ in members)})")


@register_model(BlockType)
class BlockModel(models.OpaqueModel):
    """A pointer."""


@typeof_impl.register(Block)
def _typeof_block(block: Any, context: Any) -> BlockType:
    return block.numba_type


@unbox(BlockType)
def _unbox_block(kind: BlockType, block: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(block, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class BlockAttributes(AttributeTemplate):
    """Types of a block's members."""

    key = BlockType

    def generic_resolve(self, kind: BlockType, name: str) -> types.Type | None:
        return kind.members[name][0] if name in kind.members else None


@lower_getattr_generic(BlockType)
def _member(context: Any, builder: Any, kind: BlockType, block: Any, name: str) -> Any:
    member, first = kind.members[name]
    words = builder.bitcast(block, llvmlite.ir.IntType(64).as_pointer())

    def word(k: int) -> Any:
        loaded = builder.load(cgutils.gep_inbounds(builder, words, first + k))
        # never written after the block was made: loops need not read it again
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(member, BlockType):
        return builder.inttoptr(word(0), block.type)
    if isinstance(member, types.Array):
        return _array(context, builder, member, word)
    if member == types.float64:
        return builder.bitcast(word(0), llvmlite.ir.DoubleType())
    if member == types.boolean:
        return builder.trunc(word(0), llvmlite.ir.IntType(1))
    return word(0)


def _array(context: Any, builder: Any, kind: types.Array, word: Any) -> Any:
    """Return a borrowed array, whose references are not counted."""
    array = context.make_array(kind)(context, builder)
    item = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    shape = [word(1 + k) for k in range(kind.ndim)]
    stride: Any = context.get_constant(types.intp, item)
    strides: list[Any] = []
    for size in reversed(shape):
        strides.insert(0, stride)
        stride = builder.mul(stride, size, flags=["nsw"])
    data = builder.inttoptr(word(0), array.data.type)
    populate_array(array, data, shape, strides, item, meminfo=None)
    return array._getvalue()
