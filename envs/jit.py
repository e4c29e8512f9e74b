"""The one Numba decorator of this package."""

import numba

#: Compiled without the GIL, cached on disk, NumPy's rules for division by zero. Sums may be
#: reordered (SIMD), but NaN and infinity keep their meaning: checks rely on them.
compiled = numba.njit(
    nogil=True,
    cache=True,
    error_model="numpy",
    fastmath={"contract", "reassoc", "nsz", "arcp"},
)
