"""Named arrays and numbers that compiled code reads through one address.

A named tuple costs a call some 0.2 µs for each of its arrays, and every function that takes one
compiles all of them. A `Block` is handed over as a pointer: its arrays' addresses and sizes, and
its numbers, lie one after the other in memory, and only what a function uses is read.
"""

import re
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, InitVar
from functools import cache
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Self, get_origin, get_type_hints

import llvmlite.ir
import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.errors import TypingError
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np import numpy_support
from numba.np.arrayobj import populate_array

from .copies import portable
from .memory import guarded_zeros
from .mutable import MutableMember, mutable_dtype


class Block:
    """Base of dataclasses of arrays, floats, ints, bools and other blocks.

    Numbers are copied when the block is made; arrays are shared, so writing into them is seen by
    both sides. A number that changes is a `Mutable[float]`, `Mutable[int]` or `Mutable[bool]`:
    `block.clock += dt` in Python and in compiled code. Nothing else can be assigned. A block
    is `@dataclass(eq=False)` if it has such numbers, else `@dataclass(frozen=True, eq=False)`.
    To a dataclass such a number is an `InitVar`: `dataclasses.replace`, which could only copy it,
    raises a ValueError, and the block's own `replace` shares it.

    A block must outlive the compiled calls that use it: it holds its arrays.
    """

    mutable: ClassVar[dict[str, MutableMember]] = {}  #: the mutable numbers by name

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        own = {}
        for name, kind in get_annotations(cls).items():
            if hasattr(Block, name):
                raise TypeError(f"{cls.__name__}.{name}: every block has something of this name")
            if (dtype := mutable_dtype(kind)) is not None:
                own[name] = MutableMember(name, dtype)
                setattr(cls, name, own[name])
        numbers: dict[str, Any] = {name: InitVar(each.dtype) for name, each in own.items()}
        cls.__annotations__ = {**get_annotations(cls), **numbers}
        cls.mutable = {**cls.mutable, **own}

    def __setattr__(self, name: str, value: Any) -> None:
        if "_address" in vars(self) and name not in self.mutable:
            raise FrozenInstanceError(f"cannot assign {name!r} of {type(self).__name__}")
        super().__setattr__(name, value)

    def __post_init__(self, *numbers: Any) -> None:
        if self.mutable and type(self).__dataclass_params__.frozen:  # type: ignore[attr-defined]
            raise TypeError(f"{type(self).__name__} has mutable numbers, and is frozen")
        for name, number in zip(self.mutable, numbers, strict=True):
            setattr(self, name, number)
        words: list[int] = []
        members: list[tuple[str, types.Type, int]] = []
        for name, value in self.named().items():
            kind, content = _words(value)
            if name in self.mutable:
                kind, content = MutableType(kind.dtype), content[:1]
            members.append((name, kind, len(words)))
            words += content
        memory = np.array(words, dtype=np.int64)
        object.__setattr__(self, "_memory", memory)
        object.__setattr__(self, "_address", memory.ctypes.data)
        object.__setattr__(self, "_type", BlockType(type(self).__name__, tuple(members)))

    @classmethod
    def allocate(cls, sizes: Mapping[str, int] | None = None, **members: Any) -> Self:
        """A block of these members, and of zeros for every other mutable number and array.

        The shape of such an array is annotated: `Annotated[np.ndarray, "nv+1", 3]` is (nv + 1, 3),
        of which `sizes` has nv; "6nc" is six times nc. A type at the end is that of the numbers,
        which are floats by default.
        """
        for name, kind in get_type_hints(cls, include_extras=True).items():
            if name in cls.mutable:
                members.setdefault(name, 0)
            elif name not in members and get_origin(kind) is Annotated:
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

    def named(self) -> dict[str, Any]:
        """The fields' values by name; for a mutable number the array (1,) that holds it."""
        held = vars(self)
        names = type(self).__dataclass_fields__  # type: ignore[attr-defined]
        return {name: held[name] for name in names}

    def members(self) -> tuple[Any, ...]:
        """The values of `named`, in order."""
        return tuple(self.named().values())

    def mutable_values(self) -> dict[str, float]:
        """The values of all mutable numbers by name."""
        return {name: getattr(self, name) for name in self.mutable}

    def replace(self, **changes: Any) -> Self:
        """A block with these members, which shares all others: mutable numbers, too."""
        return type(self)(**{**self.named(), **changes})

    def clear(self) -> None:
        """Write zeros into all mutable numbers and arrays, not those of blocks within it."""
        for value in self.members():
            if isinstance(value, np.ndarray):
                value[...] = 0

    def memory_of(self, name: str) -> Any:
        """The memory of a mutable number, an array (1,): another block may be made with it."""
        assert name in self.mutable, name
        return vars(self)[name]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(portable(member) for member in self.members())

    def __copy__(self) -> Any:
        return type(self)(*self.members())


def named_entries(kind: type[Block]) -> tuple[Any, ...]:
    """Members of a block whose first one is an array of zeros, and all others are its entries.

    Code that needs a vector takes the array, and code that needs one entry its name.
    """
    names = list(kind.mutable)
    values = guarded_zeros(len(names))
    return values, *(values[i : i + 1] for i in range(len(names)))


def _length(part: int | str, sizes: Mapping[str, int]) -> int:
    """The number that a part of an annotated shape stands for."""
    if isinstance(part, int):
        return part
    found = re.fullmatch(r"(\d*)([a-z]+)([+-]\d+)?", part)
    if found is None:
        raise ValueError(f"not a length: {part!r}")
    return int(found[1] or 1) * sizes[found[2]] + int(found[3] or 0)


def _words(value: Any) -> tuple[Any, list[int]]:
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


class MutableType(types.Type):
    """Numba's type of a mutable number in a block, which holds its address."""

    def __init__(self, dtype: types.Type):
        self.dtype = dtype
        super().__init__(f"Mutable({dtype})")


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
        if name not in kind.members:
            return None
        member = kind.members[name][0]
        return member.dtype if isinstance(member, MutableType) else member


@lower_getattr_generic(BlockType)
def _member(context: Any, builder: Any, kind: BlockType, block: Any, name: str) -> Any:
    member, first = kind.members[name]

    def word(k: int) -> Any:
        return _word(builder, block, first + k)

    if isinstance(member, MutableType):
        place = _place(context, builder, member, word(0))
        return context.unpack_value(builder, member.dtype, place)
    if isinstance(member, BlockType):
        return builder.inttoptr(word(0), block.type)
    if isinstance(member, types.Array):
        return _array(context, builder, member, word)
    if member == types.float64:
        return builder.bitcast(word(0), llvmlite.ir.DoubleType())
    if member == types.boolean:
        return builder.trunc(word(0), llvmlite.ir.IntType(1))
    return word(0)


@lower_setattr_generic(BlockType)
def _assign(context: Any, builder: Any, signature: Any, args: Any, name: str) -> None:
    member, first = signature.args[0].members[name]
    if not isinstance(member, MutableType):
        raise TypingError(f"{name!r} of {signature.args[0]} is not mutable")
    place = _place(context, builder, member, _word(builder, args[0], first))
    context.pack_value(builder, member.dtype, args[1], place)


def _word(builder: Any, block: Any, k: int) -> Any:
    """The 64-bit word k of a block, which is never written after the block was made."""
    words = builder.bitcast(block, llvmlite.ir.IntType(64).as_pointer())
    loaded = builder.load(cgutils.gep_inbounds(builder, words, k))
    # so loops need not read it again
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


def _place(context: Any, builder: Any, kind: MutableType, address: Any) -> Any:
    """A pointer to a mutable number."""
    return builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer())


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
