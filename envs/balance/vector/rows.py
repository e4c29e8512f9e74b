"""Blocks of several environments as rows of common arrays."""

from collections.abc import Sequence
from typing import Any, TypeVar

from poise.envs.compiled.block import Block
from poise.envs.compiled.memory import guarded_zeros

B = TypeVar("B", bound=Block)


def in_rows(blocks: Sequence[B]) -> tuple[dict[str, Any], list[B]]:
    """Return blocks with the values of `blocks`, and the arrays that they are the rows of.

    The arrays are named as the members: (n,) of a mutable number, (n, …) of an array, a dictionary
    of a block. All members must be one of these.
    """
    columns: dict[str, Any] = {}
    rows: list[dict[str, Any]] = [{} for _ in blocks]
    for name, first in blocks[0].named().items():
        values = [block.named()[name] for block in blocks]
        if isinstance(first, Block):
            columns[name], parts = in_rows(values)
        else:
            array = guarded_zeros((len(blocks), *first.shape), first.dtype.type)
            for part, value in zip(array, values, strict=True):
                part[...] = value
            columns[name] = array[:, 0] if name in blocks[0].mutable else array
            parts = list(array)
        for row, part in zip(rows, parts, strict=True):
            row[name] = part
    return columns, [type(block)(**row) for block, row in zip(blocks, rows, strict=True)]
