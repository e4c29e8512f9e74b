"""Values of every sort, as plain JSON, so that a case can be written to a file and read back.

What JSON cannot hold is a mapping with one key that begins with "$"; `decode` makes it.
"""

from __future__ import annotations

import base64
import datetime
import decimal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

Json = Any
NUMBERS: list[Json] = [
    *(0, 1, -1, 2, 3, 10, 255, 10**9, 10**200, 2**31, 2**63 - 1, 2**64, -(2**63)),
    *(0.0, -0.0, 0.1, 0.5, -0.5, 1.5, 1e-9, 1e-300, 5e-324, 1e6, 1e38, 1e154, 1e300, -1e300),
    *({"$float": "nan"}, {"$float": "inf"}, {"$float": "-inf"}, {"$power": [10, 4000]}),
]
TEXTS: list[Json] = [
    *("", " ", "a", "humanoid", "compact", "torso", "pelvis", "momentum-qp", "capture-step"),
    *("residual", "standing", "squat", "zero", "nosuch:Class", "nosuch.yaml", "../..", ".", "/"),
    *("/dev/null/a", "1", "1e3", "nan", "true", "null", "\u00e9\u4e2d", "\ud800", "\u0000", "a\nb"),
    *("square", "half-sine", "impulse", "x" * 300, "x" * 70_000, "%s%n", "{}", "*", "[", "a:b:c"),
]


def _raises(*_: object, **__: object) -> Any:
    raise RuntimeError("this object refuses\nwith two lines")


class _Array:
    __array__ = _raises


class _Number:
    __float__ = __index__ = __int__ = _raises


class _Iterator:
    __iter__ = __len__ = __getitem__ = _raises


class _Silent:
    __repr__ = __str__ = _raises


class _Equal:
    __eq__ = __hash__ = _raises


def _own_member() -> list[Any]:
    own: list[Any] = []
    own.append(own)
    return own


def _own_value() -> dict[str, Any]:
    own: dict[str, Any] = {}
    own["push"] = own
    return own


OBJECTS: dict[str, Callable[[], Any]] = {
    "object": object,
    "class": lambda: dict,
    "function": lambda: _raises,
    "array raises": _Array,
    "number raises": _Number,
    "iterator raises": _Iterator,
    "text raises": _Silent,
    "comparison raises": _Equal,
    "own member": _own_member,
    "own value": _own_value,
    "generator": lambda: (i for i in range(3)),
    "complex": lambda: 1j,
    "date": lambda: datetime.date(2026, 11, 23),
    "decimal": lambda: decimal.Decimal("1e5000"),
    "path": lambda: Path("nowhere.yaml"),
    "float32": lambda: np.float32(0.5),
    "int64": lambda: np.int64(3),
    "nan array": lambda: np.full(21, np.nan),
    "complex array": lambda: np.ones(4, dtype=complex),
    "object array": lambda: np.array([None, {}, "a"], dtype=object),
    "text array": lambda: np.array(["a", "1.0"]),
    "bool array": lambda: np.ones(4, dtype=bool),
    "dates": lambda: np.array(["2026-11-23"], dtype="datetime64[D]"),
    "structured array": lambda: np.zeros(2, dtype=[("a", float), ("b", int)]),
    "empty array": lambda: np.zeros((0, 3)),
    "enormous array": lambda: np.broadcast_to(0.0, (2**40,)),
    "masked array": lambda: np.ma.masked_array(np.zeros(4), mask=True),
    "zero-size text": lambda: np.array("", dtype="U0"),
    "bytes": lambda: b"\xff\x00",
    "memoryview": lambda: memoryview(b"1234"),
    "set": lambda: {1, 2},
    "range": lambda: range(2**62),
}
MAKERS: dict[str, Callable[[Any], Any]] = {
    "$float": float,
    "$power": lambda pair: pair[0] ** pair[1],
    "$bytes": base64.b64decode,
    "$object": lambda name: OBJECTS[name](),
    "$tuple": lambda items: tuple(decode(item) for item in items),
    "$array": lambda items: np.array(items, dtype=float),
    "$pairs": lambda pairs: {_key(decode(key)): decode(value) for key, value in pairs},
}


def _key(value: Any) -> Any:
    """A key of a dictionary, of what can be one."""
    return tuple(value) if isinstance(value, list) else value


def decode(value: Json) -> Any:
    """The Python value that the JSON stands for; objects are new ones with every call."""
    if isinstance(value, list):
        return [decode(item) for item in value]
    if not isinstance(value, dict):
        return value
    if len(value) == 1:
        (name,) = value
        if name in MAKERS:
            return MAKERS[name](value[name])
    return {key: decode(item) for key, item in value.items()}


def packed(content: bytes) -> Json:
    """Bytes as JSON."""
    return {"$bytes": base64.b64encode(content).decode()}


plain_leaves = st.one_of(
    st.sampled_from([None, True, False]),
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS),
    st.integers(-3, 40),
    st.floats(-2.0, 2.0),
)
leaves = st.one_of(
    plain_leaves,
    st.sampled_from(sorted(OBJECTS)).map(lambda name: {"$object": name}),
    st.lists(st.floats(-1.0, 1.0), max_size=25).map(lambda items: {"$array": items}),
    st.sampled_from([{"$tuple": [0.0, 1.0]}, {"$power": [10, 5000]}]),
    st.just({"$pairs": [[1, 2], [None, 3], [{"$tuple": [1]}, 4]]}),
)


def values(keys: Sequence[str] = (), plain: bool = False) -> st.SearchStrategy[Json]:
    """Values of every sort; mappings have some of these keys. `plain`: what YAML has, too."""
    names = st.sampled_from([*keys, "a", ""])

    def nested(inner: st.SearchStrategy[Json]) -> st.SearchStrategy[Json]:
        return st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=4)

    return st.recursive(plain_leaves if plain else leaves, nested, max_leaves=6)
