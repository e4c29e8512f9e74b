"""The main job in a minute or, in full, in some: who recovers from which pushes."""

import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from poise.configs.errors import PoiseError
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.results.read import Results, load_results
from poise.training.benchmarking.results.replay import film
from poise.training.running.files import PLOTS
from poise.training.running.stopping import keeps
from poise.training.running.summary import Summary
from poise.training.running.terminal import print_paths

CONTROLLERS = ("momentum-qp", "capture-step", "feedback-step", "residual-torque")
SUITE = "demo"
FULL_CONTROLLERS = (*CONTROLLERS[:3], "residual-step", CONTROLLERS[3])
FULL_SUITES = ("demo-full-envelope", "demo-full-random")
FILMED, VIDEO = 3, "push.mp4"  # how many controllers the video shows, its name


def run_demo(
    out: str | Path,
    *,
    full: bool = False,
    workers: int | None = None,
    seed: int = 0,
    overwrite: bool = False,
    controllers: Sequence[str] | None = None,
    console: Console | None = None,
) -> list[Summary]:
    """Evaluate on the demo's suite, or on both of the full one; returns their summaries.

    `out` gets what `evaluate` writes, of the full demo in a folder for each suite, and else a video
    of the same push with three controllers. It goes on where it was stopped.

    Raises:
        ConfigError, PoiseError: as `evaluate`.
    """
    console, out = console or Console(quiet=True), Path(out)
    keeps(out, f"the finished trials are kept in {out}; the same command goes on")
    names = controllers or (FULL_CONTROLLERS if full else CONTROLLERS)
    folders = {suite: out / Path(suite).stem for suite in FULL_SUITES} if full else {SUITE: out}
    summaries = [
        evaluate(names, suite, out=folder, seed=seed, workers=workers, overwrite=overwrite,
                 console=console)
        for suite, folder in folders.items()
    ]  # fmt: skip
    shown = zip(folders.values(), PLOTS, strict=True) if full else [(out, plot) for plot in PLOTS]
    console.print("\npolar recovery plot and fall probability:")
    print_paths([folder / plot for folder, plot in shown], console)
    if not full:
        _film(load_results(out), console)
    return summaries


def _film(results: Results, console: Console) -> None:
    """Film the hardest push that the best one recovers; where nothing can be drawn, say so."""
    trial = hardest(results)
    if trial is None:
        return
    ranking = results.summary["ranking"]
    names = list(dict.fromkeys([*ranking[:-FILMED:-1], ranking[0]]))  # the best to the right
    path = results.folder / VIDEO
    command = ["poise", "replay", str(results.folder), "--trial", str(trial), "--controllers",
               *names, "--video", str(path)]  # fmt: skip
    try:
        film(results, trial, names, path)
    except PoiseError as error:
        console.print(f"no video: {error}", markup=False, highlight=False)
        return
    console.print("the hardest push that the best one recovers, filmed:")
    print_paths([path], console)
    console.print(shlex.join(command), markup=False, highlight=False, soft_wrap=True)


def hardest(results: Results) -> int | None:
    """The trial of the largest fraction of the ankle limit that the best controller recovers.

    All controllers have met it alike. None where there is no such trial.
    """
    best = results.summary["ranking"][0]
    met = Counter(record.met for record in results.records)
    won = [r for r in results.of(best) if r.recovered and met[r.met] == len(results.controllers)]
    return max(won, key=lambda r: (r.fraction, -r.trial)).trial if won else None
