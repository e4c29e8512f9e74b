"""Mutable numbers of blocks: read and written by name in Python and in compiled code."""

from typing import Annotated, Any, TypeVar, get_args, get_origin

import numpy as np

from .memory import guarded_zeros

T = TypeVar("T", float, int, bool)

_MUTABLE = "mutable"

#: a member of a `Block` that changes: `Mutable[float]`, `Mutable[int]` or `Mutable[bool]`
Mutable = Annotated[T, _MUTABLE]


def mutable_dtype(kind: Any) -> type | None:
    """float, int or bool of the annotation `Mutable[...]`; None: it is another annotation.

    Raises:
        TypeError: it is `Mutable` of something else.
    """
    if isinstance(kind, str) and kind.startswith("Mutable"):  # of a module with postponed ones
        kind = {"Mutable[float]": Mutable[float], "Mutable[int]": Mutable[int],
                "Mutable[bool]": Mutable[bool]}.get(kind, Mutable[str])  # fmt: skip
    if get_origin(kind) is not Annotated or _MUTABLE not in kind.__metadata__:
        return None
    dtype: type = get_args(kind)[0]
    if dtype not in (float, int, bool):
        raise TypeError(f"Mutable[{dtype}]: of float, int, bool only")
    return dtype


class MutableMember:
    """The Python side of a mutable number: what `block.name` reads, and assigning writes.

    The number lies in an array (1,) of its own, which the block holds. A block that is made with
    such an array in place of a number shares it.
    """

    def __init__(self, name: str, dtype: type):
        self.name, self.dtype = name, dtype

    def __get__(self, block: Any, owner: type | None = None) -> Any:
        if block is None:
            raise AttributeError(self.name)  # so dataclasses find no default
        return vars(block)[self.name].item()

    def __set__(self, block: Any, value: Any) -> None:
        held = vars(block)
        if self.name in held:
            held[self.name][0] = self._checked(value)
        elif isinstance(value, np.ndarray):
            if value.shape != (1,) or value.dtype != self.dtype or not value.flags.writeable:
                raise TypeError(f"{self.name}: not an array (1,) of {self.dtype.__name__}")
            held[self.name] = value
        else:
            held[self.name] = guarded_zeros(1, self.dtype)
            held[self.name][0] = self._checked(value)

    def _checked(self, value: Any) -> Any:
        """The number, unless it would be rounded or is none."""
        fits = {float: (float, int, np.floating, np.integer), int: (int, np.integer, np.bool_),
                bool: (bool, np.bool_, int)}[self.dtype]  # fmt: skip
        if not isinstance(value, fits) or (self.dtype is bool and value not in (0, 1)):
            raise TypeError(f"{self.name} is of {self.dtype.__name__}: {value!r}")
        return value
