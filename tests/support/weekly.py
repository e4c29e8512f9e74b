"""Values of a test of which the daily suite plays some."""

from collections.abc import Iterable
from typing import Any

import pytest


def daily(values: Iterable[Any], number: int = 1) -> list[Any]:
    """Return `values` for `parametrize`: the first `number` as they are, the rest marked weekly."""
    first, rest = list(values)[:number], list(values)[number:]
    several = [value if isinstance(value, tuple) else (value,) for value in rest]
    return [*first, *(pytest.param(*each, marks=pytest.mark.weekly) for each in several)]
