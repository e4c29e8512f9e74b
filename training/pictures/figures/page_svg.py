"""Matplotlib's drawings as SVG for a page, in the colours of its style sheet.

Matplotlib's own SVG backend is not used: it names clip paths and marks by ids, which must be unique
in a page of many pictures, writes colours that no theme changes, and takes twice the time and the
room. Nothing is clipped here: what is drawn ends where its axes end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup, escape
from matplotlib.backend_bases import GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Transform

from .palette import themed

if TYPE_CHECKING:
    from matplotlib.font_manager import FontProperties
    from matplotlib.text import Text

POINTS = 72.0  # in an inch: a unit of the drawing is one of them
ANCHORS = {"left": None, "center": "middle", "right": "end"}
COMMANDS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C",
            Path.CLOSEPOLY: "Z"}  # fmt: skip


def tag(series: int | None = None, detail: bool = False, tip: str = "") -> str:
    """The `gid` of an artist: in a page it becomes a group that the style sheet and script know.

    Args:
        series: number of the series that it belongs to: a button hides it, and brings it forward.
        detail: whether it is hidden where there are many series.
        tip: is shown when the artist is pointed at.
    """
    classes = (["series"] if series is not None else []) + (["detail"] if detail else [])
    title = Markup("<title>{}</title>").format(tip) if tip else ""
    return f"<g{_written({'class': ' '.join(classes) or None, 'data-series': series})}>{title}"


class PageCanvas(FigureCanvasAgg):
    """Measures text as for a PNG file, and draws for a page."""

    def svg(self, label: str, class_: str) -> Markup:
        """Return the picture as an svg element; `label` says what it shows, see `style.Inline`."""
        self.figure.patch.set_visible(False)
        for ax in self.figure.axes:
            ax.patch.set_visible(False)
        renderer = PageRenderer(self)
        self.figure.draw(renderer)
        size = "0 0 " + " ".join(_number(length) for length in renderer.get_canvas_width_height())
        seen = {"role": "img", "aria-label": label} if label else {"aria-hidden": "true"}
        opened = f"<svg{_written({'viewBox': size, 'class': class_, **seen})}>"
        return Markup(f"{opened}{''.join(renderer.parts)}</svg>")


class PageRenderer(RendererBase):
    """Turns what Matplotlib draws into elements of an SVG.

    Attributes:
        parts: the elements so far.
    """

    def __init__(self, canvas: PageCanvas):
        super().__init__()
        self.parts: list[str] = []
        self._groups: list[int | None] = []  # where each open one begins, if it is written
        self._metrics = canvas.get_renderer()
        self._size = tuple(POINTS * float(inches) for inches in canvas.figure.get_size_inches())

    def get_canvas_width_height(self) -> tuple[float, float]:
        return self._size[0], self._size[1]

    def get_text_width_height_descent(self, *args: Any) -> tuple[float, float, float]:
        return self._metrics.get_text_width_height_descent(*args)

    def open_group(self, s: str, gid: str | None = None) -> None:
        self._groups.append(None if gid is None else len(self.parts) + 1)
        if gid is not None:
            self.parts.append(gid)  # of `tag`

    def close_group(self, s: str) -> None:
        begin = self._groups.pop()
        if begin == len(self.parts):  # an empty one
            self.parts.pop()
        elif begin is not None:
            self.parts.append("</g>")

    def draw_path(
        self, gc: GraphicsContextBase, path: Path, transform: Transform, rgbFace: Any = None
    ) -> None:
        downwards = transform + Affine2D().scale(1.0, -1.0).translate(0.0, self._size[1])
        pieces = [
            COMMANDS[code] + ("" if code == Path.CLOSEPOLY else " ".join(map(_number, points)))
            for points, code in path.iter_segments(downwards)
        ]
        paint = _fill(gc, rgbFace) | _stroke(gc)
        if pieces and paint != {"fill": "none"}:
            self.parts.append(f"<path{_written({'d': ''.join(pieces), **paint})}/>")

    def draw_text(
        self, gc: GraphicsContextBase, x: float, y: float, s: str, prop: FontProperties,
        angle: float, ismath: Any = False, mtext: Text | None = None,
    ) -> None:  # fmt: skip
        anchor = None
        if mtext is not None and angle == 0.0:  # its ends depend on the font of the page
            anchor = ANCHORS[mtext.get_horizontalalignment()]
            x = mtext.get_transform().transform(mtext.get_unitless_position())[0]
        x, y = round(float(x), 1), round(float(y), 1)
        turned = f"rotate({-angle:g} {x:g} {y:g})" if angle else None
        weight = None if prop.get_weight() in ("normal", 400) else prop.get_weight()
        written = _written({
            "x": x, "y": y, "fill": themed(gc.get_rgb()), "font-size": prop.get_size_in_points(),
            "font-weight": weight, "text-anchor": anchor, "transform": turned,
        })  # fmt: skip
        self.parts.append(f"<text{written}>{escape(s)}</text>")


def _fill(gc: GraphicsContextBase, face: Any) -> dict[str, object]:
    if face is None or (len(face) > 3 and face[3] == 0.0):
        return {"fill": "none"}
    alpha = gc.get_alpha() if gc.get_forced_alpha() or len(face) < 4 else face[3]
    return {"fill": themed(face), "fill-opacity": None if alpha == 1.0 else round(alpha, 2)}


def _stroke(gc: GraphicsContextBase) -> dict[str, object]:
    colour, width = gc.get_rgb(), gc.get_linewidth()
    alpha = gc.get_alpha() if gc.get_forced_alpha() else colour[3]
    if not width or not alpha:
        return {}
    dashes = gc.get_dashes()[1]
    return {
        "stroke": themed(colour),
        "stroke-width": None if width == 1.0 else round(width, 2),
        "stroke-opacity": None if alpha == 1.0 else round(alpha, 2),
        "stroke-dasharray": None if dashes is None else " ".join(map(_number, np.ravel(dashes))),
    }


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _written(attributes: dict[str, object]) -> str:
    return "".join(
        f' {name}="{escape(f"{value:g}" if isinstance(value, float) else str(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
