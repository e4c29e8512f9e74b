"""The look of every picture of Poise, and how it is saved. No pyplot, no global backend."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from poise.configs.files import write_atomic

# Okabe and Ito's palette: told apart with any colour vision. Line and marker repeat what the colour
# says, for prints in grey.
BLUE, ORANGE, GREEN, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9"
AMBER = "#E69F00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY)  # in the order in which they are given
MANY = (*SERIES, "#6250B5", "#B3263E")  # where there is room for more: violet and crimson
INK, GREY, PALE = "#222222", "#767676", "#E4E4E4"

RC: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib, has ξ, η and ·
    "font.size": 11,
    "text.color": INK,
    "axes.titlesize": 13,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 10,
    "axes.labelsize": 11,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.facecolor": "white",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": PALE,
    "grid.linewidth": 0.8,
    "grid.linestyle": "-",
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 10,
    "ytick.labelsize": 10,
    "lines.linewidth": 2.0,
    "lines.markersize": 5.5,
    "legend.frameon": False,
    "legend.fontsize": 10.5,
    "legend.columnspacing": 1.6,
    "figure.constrained_layout.h_pad": 0.09,  # [in]
    "figure.constrained_layout.w_pad": 0.09,
    "figure.facecolor": "white",
    "figure.titlesize": 13,
    "figure.titleweight": "bold",
    "text.usetex": False,
    "text.parse_math": False,  # a $ in the name of a run folder is a $
}


class Look(NamedTuple):
    """Colour, line and marker of one series."""

    colour: str
    line: str
    marker: str


def look(index: int) -> Look:
    """Look of the series number `index`; the first is the baseline.

    Colours repeat after six, with other markers; after 36 everything repeats.
    """
    lines = ("-", "-", "--", "-.", (0, (4, 1, 1, 1, 1, 1)), ":")
    markers = ("o", "s", "^", "D", "v", "P")
    k, turn = index % len(SERIES), index // len(SERIES)
    other = (k + turn) % len(SERIES)
    return Look(SERIES[k], lines[other], markers[other])  # type: ignore[arg-type]


@contextmanager
def saved_figure(path: str | Path, width: float, height: float) -> Iterator[Figure]:
    """A figure to draw on, [in], saved as a PNG when the block ends well.

    The file appears complete or not at all, and the same drawing gives the same bytes.

    Raises:
        PoiseError: the file cannot be written.
    """
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(width, height), dpi=160, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        yield figure
        buffer = BytesIO()
        canvas.print_png(buffer, metadata={"Software": "poise"})
    write_atomic(path, buffer.getvalue())


def legend_below(figure: Figure, axes: Axes | None = None, columns: int = 3) -> None:
    """One legend under all axes, never over the data, in as many columns as fit the width.

    It lists the entries of `axes`, or of all axes, each label once.
    """
    handles: dict[str, Artist] = {}
    for ax in [axes] if axes is not None else figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    for count in range(min(columns, len(handles)), 0, -1):
        legend = figure.legend(
            list(handles.values()), list(handles), loc="outside lower center", ncols=count
        )
        if count == 1 or legend.get_window_extent().width < 0.97 * figure.bbox.width:
            break
        legend.remove()
