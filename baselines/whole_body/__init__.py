"""The momentum QP: tasks, contacts and limits, as the papers write it and compiled."""

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "Bounds",
    "Rows",
    "build",
]

if TYPE_CHECKING:
    from poise.baselines.whole_body.formulation import build
    from poise.baselines.whole_body.limits.limit import Bounds
    from poise.baselines.whole_body.tasks.task import Rows
else:
    __getattr__, __dir__ = lazy(__name__, __file__)
