"""The compiled code that an environment's step needs, made ready once."""

from poise.envs.compiled.warmup import fill_cache

KERNELS = "poise.baselines.environments.kernels"  # the module that lists the kernels
PARTS = ("assembly", "steps", "solver")  # two processes have as much to do


def prepare(*further: str) -> None:
    """Fill the cache of compiled kernels if it is cold: some twenty seconds on two cores, once.

    `further` parts of `environments/kernels.py` follow, for ten more; they use the kernels of
    the first.
    """
    fill_cache(KERNELS, PARTS, further)
