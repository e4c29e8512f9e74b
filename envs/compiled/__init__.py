"""The tools of kernels: Numba's decorator, blocks, calls by address. A kernel needs no more."""
