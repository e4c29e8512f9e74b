"""Memory that compiled code writes to."""

import math

import numpy as np

GAP = 64  # 512 bytes: more than a vector loop handles at once


def guarded_zeros(shape: int | tuple[int, ...], dtype: np.dtype | type = float) -> np.ndarray:
    """Zeros with unused room on both sides, for whatever compiled code writes to.

    A vector loop first looks how far apart its arrays lie, and where one follows another within a
    few dozen numbers, as small arrays of one heap may, it adds up one by one instead: the last
    bit of a result would depend on where the arrays happen to lie.
    """
    size = math.prod(shape) if isinstance(shape, tuple) else shape
    return np.zeros(size + 2 * GAP, dtype=dtype)[GAP : GAP + size].reshape(shape)
