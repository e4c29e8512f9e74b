"""Cases that go wrong in the way that an environment variable names: they try the fuzzer itself."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from poise.configs.errors import PoiseError

from .values import Json

WAY = "POISE_FUZZ_FAULT"


def cases() -> st.SearchStrategy[Json]:
    """Numbers; those from 10 on go wrong."""
    return st.integers(0, 1000)


def play(case: Json, folder: Path) -> None:
    """Go wrong."""
    if case < 5:
        raise PoiseError("refused")
    if case >= 10:
        ways = {"traceback": _raise, "crash": os.abort, "hang": _hang, "memory": _fill,
                "half-written": lambda: (folder / "a.part").touch()}  # fmt: skip
        ways[os.environ[WAY]]()


def _raise() -> None:
    raise KeyError("a")


def _hang() -> None:
    while True:
        pass


def _fill() -> None:
    np.ones(400_000_000)
