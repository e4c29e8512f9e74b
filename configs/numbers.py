"""Numbers that a caller hands over, looked at before anything is computed with them."""

from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np

from .errors import ConfigError
from .problems import Problem, out_of_range


def real_array(value: Any) -> np.ndarray | None:
    """`value` as an array of real numbers, of its own type; None for what is none.

    Text, complex numbers, dates and objects are none, nor is what cannot be turned into an array.
    """
    try:
        array = np.asarray(value)
    except Exception:  # an object's own __array__ may raise whatever it likes
        return None
    return array if array.dtype.kind in "biuf" else None


def finite_array(value: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    """`value` as finite floats of this shape; None for what they are not."""
    array = real_array(value)
    if array is None or array.shape != shape:
        return None
    numbers = array.astype(float)
    return numbers if np.isfinite(numbers).all() else None


def whole_number(value: Any, least: int, field: str, source: str | None = None) -> int:
    """`value` as an int; raises ConfigError unless it is a whole number of at least `least`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Integral):
        found = type(value).__name__
        raise Problem("type", source, field, expected="a whole number", value=found)
    if value < least:
        raise out_of_range(int(value), field, source, least=least)
    return int(value)


def whole_steps(
    time: float, step: float, field: str, source: str | None = None, least: int = 1
) -> int:
    """Return the number of steps of `step` in `time`, both in [s].

    Raises ConfigError unless it is whole and at least `least`.
    """
    count = round(time / step)
    if count < least or abs(count * step - time) > 1e-9:
        problem = f"{time} s is not a whole number of steps of {step} s"
        raise ConfigError(problem, source=source, field=field)
    return count


def seed_number(seed: Any, field: str = "seed") -> int | None:
    """A seed of `reset`; raises ConfigError unless it is None or a whole number from 0 on."""
    return None if seed is None else whole_number(seed, 0, field, "reset")


def option_mapping(options: Any) -> dict[Any, Any]:
    """A copy of the options of `reset`; raises ConfigError unless they are a mapping or None."""
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        found = type(options).__name__
        raise Problem("type", "reset", "options", expected="a mapping", value=found)
    return dict(options)
