"""The check of an action: a number in [−1, 1] for each of its names."""

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import real_array


def checked_action(action: object, names: tuple[str, ...]) -> np.ndarray:
    """Return `action` as numbers (len(names),).

    Raises ConfigError naming the entries: all for a wrong shape, else those out of bounds.
    """
    vector = real_array(action)
    if vector is None:
        raise ConfigError(
            f"must be numbers of shape {(len(names),)}, not {shown(action)}: {', '.join(names)}",
            field="action",
        )
    if vector.shape != (len(names),):
        raise ConfigError(
            f"has shape {vector.shape}, expected {(len(names),)}: {', '.join(names)}",
            field="action",
        )
    vector = vector.astype(float, copy=False)
    good = np.abs(vector) <= 1.0 + 1e-6  # NaN is not
    if not good.all():
        bad = [f"{names[i]} is {vector[i]:g}" for i in np.flatnonzero(~good)]
        raise ConfigError(f"must lie in [-1, 1], but {', '.join(bad)}", field="action")
    return vector
