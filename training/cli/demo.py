"""The main job in a few minutes: three controllers, and what a policy on two of them gains."""

from pathlib import Path

from rich.console import Console

from poise.training.evaluation.evaluate import evaluate
from poise.training.running.files import PLOTS
from poise.training.running.stopping import ANEW, keeps
from poise.training.running.summary import Summary
from poise.training.running.terminal import print_paths
from poise.training.trials.agents import SHIPPED

CONTROLLERS = ("momentum-qp", SHIPPED, "capture-step", "residual-step", "feedback-step")
SUITES = ("demo-envelope", "demo-random")


def demo(
    out: str | Path,
    *,
    workers: int | None = None,
    seed: int = 0,
    controllers: tuple[str, ...] = CONTROLLERS,
    console: Console | None = None,
) -> list[Summary]:
    """Evaluate on both suites of the demo; returns their summaries.

    An earlier demo in `out` is replaced.

    Raises:
        ConfigError, PoiseError: as `evaluate`.
    """
    console = console or Console(quiet=True)
    summaries = []
    keeps(Path(out), ANEW)  # it replaces what there is
    for suite in SUITES:
        summary = evaluate(
            controllers,
            suite,
            out=Path(out) / Path(suite).stem,
            seed=seed,
            workers=workers,
            overwrite=True,
            console=console,
        )
        summaries.append(summary)
    console.print("\npolar recovery plot and fall probability:")
    folders = [Path(out) / Path(suite).stem for suite in SUITES]
    print_paths([f / plot for f, plot in zip(folders, PLOTS, strict=True)], console)
    return summaries
