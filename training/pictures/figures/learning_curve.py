"""J50 of a policy over its environment steps of training."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.ticker import EngFormatter

from poise.training.running.columns import J50_MEAN

from .palette import GREY
from .style import headline, legend_below, look, saved_figure

DASHES = ((0, (6, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)), (0, (3, 4)))  # of what does not learn
Point = tuple[int, float, float, float]  # environment steps; J50, its interval's ends


def learning_curve(
    path: str | Path,
    runs: Mapping[str, Sequence[Point]],
    others: Mapping[str, float] | None = None,
    *,
    note: str = "",
) -> None:
    """Mean J50 over environment steps, a line for each run.

    Args:
        path: PNG file to write.
        runs: name → (steps, J50, low, high) of its policies, in any order; [low, high] is drawn as
            a band.
        others: name → J50 of what does not learn, each a horizontal line.
        note: a sentence below the title.

    Raises:
        PoiseError: the file cannot be written.
    """
    with saved_figure(path, 7.2, 4.8) as figure:
        ax = figure.add_subplot()
        for k, (name, points) in enumerate(runs.items()):
            steps, j50, low, high = zip(*sorted(points), strict=True)
            style = look(k)
            ax.fill_between(steps, low, high, color=style.colour, alpha=0.2, lw=0)
            ax.plot(steps, j50, color=style.colour, ls=style.line, marker=style.marker, label=name)
            ax.lines[-1].set_clip_on(False)  # its last marker lies on the frame
        for k, (name, level) in enumerate((others or {}).items()):
            ax.axhline(level, color=GREY, lw=1.3, ls=DASHES[k % len(DASHES)], label=name)
        ax.set_xlim(left=0)
        ax.set_ylim(bottom=0)
        ax.xaxis.set_major_formatter(EngFormatter(sep=""))
        ax.set_xlabel("environment steps")
        ax.set_ylabel(J50_MEAN.heading)
        said = "J50: half of the pushes are recovered. Band: 95 % interval."
        headline(figure, "Recovered impulse while it learns", said, note)
        legend_below(figure)
