"""The compiled code that an environment's step needs, made ready once.

``python -m poise.baselines.warmup`` compiles all parts: `make setup` does so.
"""

from collections.abc import Callable

from poise.envs.compiled.warmup import fill_cache

from .extras import load_extra, missing_extra, registered

KERNELS = "poise.baselines.environments.kernels"  # the module that lists the kernels
PARTS = ("assembly", "steps", "solver")  # two processes have as much to do
#: the other parts, in such an order that two processes have as much to do
FURTHER = ("planner", "contacts", "walking", "sensing", "whole", "rows")
NAMES = {  #: of the parts, in the line that says what is compiled
    "assembly": "the momentum QP",
    "steps": "physics",
    "solver": "the QP solver",
    "planner": "planned steps",
    "contacts": "changing contacts",
    "walking": "walking",
    "sensing": "sensors and estimators",
    "whole": "servos that take over",
    "rows": "tasks and limits",
}


def prepare(*further: str) -> None:
    """Fill the cache of compiled kernels if it is cold: some twenty seconds on two cores, once.

    `further` parts of `environments/kernels.py` follow, for ten more; they use the kernels of
    the first.
    """
    fill_cache(KERNELS, NAMES, PARTS, further)


def of_extras() -> list[Callable[[], None]]:
    """Functions that compile what the installed extras add, of the group ``poise.warmup``."""
    names = [name for name in registered("warmup") if missing_extra("warmup", name) is None]
    return [load_extra("warmup", name) for name in names]


if __name__ == "__main__":
    prepare(*FURTHER)
    for each in of_extras():
        each()
