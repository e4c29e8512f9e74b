"""Integers that several threads read and write."""

from typing import Any

import llvmlite.ir
from numba.core import types
from numba.extending import intrinsic


@intrinsic
def take_turn(typing: Any, numbers: Any, k: Any) -> Any:
    """`numbers[k]` (int), which is one more for whoever asks next in any thread."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(numbers)(context, builder, args[0])
        one = llvmlite.ir.Constant(llvmlite.ir.IntType(64), 1)
        return builder.atomic_rmw("add", builder.gep(array.data, [args[1]]), one, "acq_rel")

    return types.int64(numbers, types.int64), generate


@intrinsic
def look_at(typing: Any, numbers: Any, k: Any) -> Any:
    """`numbers[k]` (int), which other threads write."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(numbers)(context, builder, args[0])
        return builder.load_atomic(builder.gep(array.data, [args[1]]), "acquire", 8)

    return types.int64(numbers, types.int64), generate


@intrinsic
def swap(typing: Any, numbers: Any, k: Any, new: Any) -> Any:
    """`numbers[k]` (int), which is now `new`."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(numbers)(context, builder, args[0])
        return builder.atomic_rmw("xchg", builder.gep(array.data, [args[1]]), args[2], "acq_rel")

    return types.int64(numbers, types.int64, types.int64), generate
