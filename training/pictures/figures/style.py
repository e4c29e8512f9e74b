"""The look of every picture of Poise, and how it is saved. No pyplot, no global backend."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.transforms import IdentityTransform

from poise.configs.files import write_atomic

from .page_svg import POINTS, PageCanvas
from .palette import GREY, INK, PALE, SERIES

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


INLINE = 5.4  # width of a picture in a page, unless it says otherwise [in]


class Look(NamedTuple):
    """Colour, line and marker of one series."""

    colour: str
    line: str
    marker: str


def look(index: int) -> Look:
    """Return the look of the series number `index`; the first is the baseline.

    Colours repeat after eight, with other markers; after 48 everything repeats.
    """
    lines = ("-", "-", "--", "-.", (0, (4, 1, 1, 1, 1, 1)), ":")
    markers = ("o", "s", "^", "D", "v", "P")
    k, turn = index % len(SERIES), index // len(SERIES)
    other = (k + turn) % len(lines)
    return Look(SERIES[k], lines[other], markers[other])  # type: ignore[arg-type]


class Inline:
    """Where a picture goes that is part of a page; title and legend are then the page's.

    Args:
        label: what the picture shows, for those who do not see it; empty if the text beside it
            says so.
        width: of the picture [in]; its height keeps the proportion, its letters their size.
        class_: of the svg element.

    Attributes:
        svg: the picture, once it is drawn.
    """

    def __init__(self, label: str = "", width: float = INLINE, class_: str = "plot"):
        self.label, self.width, self.class_ = label, width, class_
        self.svg = Markup()


Out = str | Path | Inline  # a PNG file, or a part of a page


@contextmanager
def saved_figure(out: Out, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure [in], saved as a PNG or put into a page when the block succeeds.

    A file appears complete or not at all, and the same drawing gives the same bytes.

    Raises:
        PoiseError: the file cannot be written.
    """
    with matplotlib.rc_context(RC):
        if isinstance(out, Inline):
            size = out.width, out.width / width * height
            figure = Figure(figsize=size, dpi=POINTS, layout="constrained")
            page = PageCanvas(figure)
            yield figure
            out.svg = page.svg(out.label, out.class_)
            return
        figure = Figure(figsize=(width, height), dpi=160, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        yield figure
        buffer = BytesIO()
        canvas.print_png(buffer, metadata={"Software": "poise"})
    write_atomic(out, buffer.getvalue())


def sample(colour: str, line: object = "", marker: Any = "") -> Markup:
    """Return how a line with its marks looks, for a legend of a page; its name stands beside it."""
    return _sample(Line2D([1, 15, 29], [6] * 3, color=colour, ls=line, lw=1.9,
                          marker=marker, markevery=[1]))  # fmt: skip


def area_sample(**look: Any) -> Markup:
    """Return how an area of this look is filled, for a legend of a page."""
    return _sample(Rectangle((5, 1), 20, 10, **look))


def _sample(artist: Artist) -> Markup:
    out = Inline("", 30.0 / POINTS, "swatch")
    with saved_figure(out, 30.0, 12.0) as figure:
        figure.set_layout_engine("none")
        artist.set_transform(IdentityTransform())  # in points
        figure.add_artist(artist)
    return out.svg


def headline(figure: Figure, title: str, *notes: str, centred: bool = False) -> None:
    """The title of a picture with notes below it; empty ones do not count. A page has its own."""
    if isinstance(figure.canvas, PageCanvas):
        return
    if not any(notes):
        figure.axes[0].set_title(title)
        return
    figure.suptitle(title, **({} if centred else {"x": 0.01, "ha": "left"}))
    figure.axes[0].set_title("\n".join(filter(None, notes)), loc="center" if centred else "left",
                             color=GREY, size=10, weight="normal")  # fmt: skip


def legend_below(figure: Figure, axes: Axes | None = None, columns: int = 3) -> None:
    """One legend under all axes, never over the data, in as many columns as fit the width.

    It lists the entries of `axes`, or of all axes, each label once. A page has its own.
    """
    if isinstance(figure.canvas, PageCanvas):
        return
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
