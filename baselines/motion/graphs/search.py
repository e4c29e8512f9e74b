"""The cheapest ways through a motion graph that play wanted clips in order."""

from collections.abc import Callable

from poise.configs.errors import ConfigError, shown
from poise.configs.problems import out_of_range

from .layers import Layers
from .motion_graph import MotionGraph, Transition, transition_order
from .paths import Path, PathTask

CHECKS = 200  # of the best path, before the search gives up


def best_paths(
    graph: MotionGraph,
    task: PathTask,
    k: int = 1,
    check: Callable[[Transition], str] | None = None,
) -> list[Path]:
    """The k cheapest paths, the best first; fewer if there are no more.

    A transition costs w K + λ D, a clip on the way λ a second, and of a wanted clip what is left
    out costs λ a second.

    Args:
        graph: the clips and transitions.
        task: what must be done.
        k: at least 1.
        check: says why a transition cannot be made after all, or nothing. It is asked about the
            transitions of the best paths alone; one with a reason is left out and the search begins
            again.

    Raises:
        ConfigError: no way; the text has what can be reached, and what comes nearest.
    """
    _check(graph, task, k)
    known: dict[Transition, str] = {}
    for _ in range(CHECKS):
        left = graph.without({t for t, reason in known.items() if reason})
        layers = Layers(left, task)
        paths = layers.best(k)
        if not paths:
            raise layers.no_way(known)
        used = {s.after for path in paths for s in path.steps if s.after is not None}
        new = sorted(used - set(known) - set(task.arrows.values()), key=transition_order)
        if check is None or not new:
            return paths
        known |= {transition: check(transition) for transition in new}
        if not any(known[transition] for transition in new):
            return paths
    raise ConfigError(f"no way was found after {CHECKS} searches: transitions are refused one by "
                      "one", source="graph")  # fmt: skip


def _check(graph: MotionGraph, task: PathTask, k: int) -> None:
    if k < 1:
        raise out_of_range(k, field="k", least=1)
    if not task.actions:
        raise ConfigError("a path needs an action", field="actions", choices=graph.names)
    for name in (*task.actions, *(name for name, _ in (*task.start, *task.goal))):
        if name not in graph.names:
            raise ConfigError(f"no clip is called {shown(name)}", field="actions",
                              choices=graph.names)  # fmt: skip
