"""Small inline SVGs whose colours come from the page's style sheet, so that they follow its theme.

Nothing here sets a colour: every element has a class, and `templates/report.css` says what it
looks like in light and in dark. Lengths are in units of the viewBox, about one pixel on a phone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike

from poise.training.benchmarking.diagnosis.words import towards
from poise.training.pictures.figures.palette import SERIES as MANY

COLOURS = len(MANY)  # classes s0, s1, … of the style sheet
DASHES = ("", "7 3", "2 3")  # of the first eight series, the next eight, …
MARKERS = ("circle", "square", "up", "diamond", "down", "plus")
MARKER_PATHS = {
    "circle": "M-3.2,0a3.2,3.2 0 1,0 6.4,0a3.2,3.2 0 1,0 -6.4,0Z",
    "square": "M-2.9,-2.9h5.8v5.8h-5.8Z",
    "up": "M0,-3.8L3.7,2.8H-3.7Z",
    "diamond": "M0,-4.1L3.5,0L0,4.1L-3.5,0Z",
    "down": "M0,3.8L3.7,-2.8H-3.7Z",
    "plus": "M-1.2,-3.7h2.4v2.5h2.5v2.4h-2.5v2.5h-2.4v-2.5h-2.5v-2.4h2.5Z",
}


class Svg:
    """A drawing that grows element by element.

    Args:
        width, height: of the viewBox.
        label: what the picture shows, for those who do not see it; empty if the text around it
            says so.
    """

    def __init__(self, width: float, height: float, label: str):
        self.width, self.height, self.label = width, height, label
        self._parts: list[str] = []

    def add(self, tag: str, text: str | None = None, **attributes: object) -> None:
        """One element; `class_` is class, and other underscores become hyphens."""
        body = "/>" if text is None else f">{escape(text)}</{tag}>"
        self._parts.append(f"<{tag}{_written(attributes)}{body}")

    @contextmanager
    def group(self, **attributes: object) -> Iterator[None]:
        """A context: all elements that are added inside share these attributes."""
        self._parts.append(f"<g{_written(attributes)}>")
        yield
        self._parts.append("</g>")

    def line(self, x1: float, y1: float, x2: float, y2: float, class_: str) -> None:
        self.add("line", x1=x1, y1=y1, x2=x2, y2=y2, class_=class_)

    def text(self, x: float, y: float, text: str, class_: str = "", **attributes: object) -> None:
        self.add("text", text, x=x, y=y, class_=class_ or None, **attributes)

    def path(
        self, x: ArrayLike, y: ArrayLike, class_: str, close: bool = False, dash: str = ""
    ) -> None:
        """A line through points; it breaks where a point is not finite."""
        pieces, pen = [], "M"
        for px, py in np.column_stack([x, y]):
            if np.isfinite(px) and np.isfinite(py):
                pieces.append(f"{pen}{_number(px)},{_number(py)}")
                pen = "L"
            else:
                pen = "M"
        if pieces:
            d = "".join(pieces) + ("Z" if close else "")
            self.add("path", d=d, class_=class_, stroke_dasharray=dash or None)

    def marker(self, x: float, y: float, index: int, title: str | None = None) -> None:
        """The mark of series `index` at a point; `title` shows when it is pointed at."""
        tip = Markup("<title>{}</title>").format(title) if title else ""
        d, place = MARKER_PATHS[marker(index)], f"{_number(x)},{_number(y)}"
        start = f'<path class="mark" d="{d}" transform="translate({place})">'
        self._parts.append(f"{start}{tip}</path>")

    def render(self, class_: str = "plot") -> Markup:
        """The whole drawing."""
        size = f"0 0 {_number(self.width)} {_number(self.height)}"
        attributes = {"viewBox": size, "class_": class_}
        seen = {"role": "img", "aria_label": self.label} if self.label else {"aria_hidden": "true"}
        attributes |= seen
        return Markup(f"<svg{_written(attributes)}>{''.join(self._parts)}</svg>")


class Chart:
    """A rectangle of a drawing with linear axes.

    Args:
        svg: the drawing.
        box: left, top, right, bottom within it.
        x, y: what the edges stand for: (left, right) and (bottom, top).
    """

    def __init__(
        self,
        svg: Svg,
        box: tuple[float, float, float, float],
        x: tuple[float, float],
        y: tuple[float, float],
    ):
        self.svg, self.box, self.x_range, self.y_range = svg, box, _wide(x), _wide(y)

    def x(self, value: ArrayLike) -> np.ndarray:
        """Abscissae in the drawing."""
        return self._map(value, self.x_range, self.box[0], self.box[2])

    def y(self, value: ArrayLike) -> np.ndarray:
        """Ordinates in the drawing; they grow downwards there."""
        return self._map(value, self.y_range, self.box[3], self.box[1])

    def y_axis(self, ticks: Sequence[float], form: str = "g", title: str = "") -> None:
        """Grid lines with numbers, and the title above the axis, where it needs no turning."""
        left, top, right, _ = self.box
        for tick in ticks:
            y = float(self.y(tick))
            self.svg.line(left, y, right, y, "grid")
            self.svg.text(left - 6, y + 4, number_text(tick, form), "tick end")
        if title:
            self.svg.text(left - 34, top - 9, title, "axis")

    def x_axis(self, ticks: Sequence[float], form: str = "g", title: str = "") -> None:
        """The lower edge with numbers and the title below them."""
        left, _, right, bottom = self.box
        self.svg.line(left, bottom, right, bottom, "edge")
        for tick in ticks:
            x = float(self.x(tick))
            self.svg.line(x, bottom, x, bottom + 4, "edge")
            self.svg.text(x, bottom + 17, number_text(tick, form), "tick middle")
        if title:
            self.svg.text((left + right) / 2, bottom + 35, title, "axis middle")

    @staticmethod
    def _map(value: ArrayLike, ends: tuple[float, float], first: float, last: float) -> np.ndarray:
        fraction = (np.asarray(value, dtype=float) - ends[0]) / (ends[1] - ends[0])
        return first + fraction * (last - first)


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """About `count` round numbers from low to high, of steps 1, 2 or 5 times a power of ten."""
    low, high = _wide((low, high))
    raw = (high - low) / max(count, 1)
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= 0.999 * raw), default=10.0)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(round(k * step, 12)) + 0.0 for k in np.arange(first, last + 1)]  # no −0


def number_text(value: float, form: str) -> str:
    """A number for people: with a real minus, and none before a zero."""
    text = format(value, form)
    return (text if set(text) & set("123456789") else text.lstrip("-")).replace("-", "−")


def right_angle(direction: float) -> str:
    """The name of a right angle, such as "left" for 90; degrees for all others."""
    angle = round(direction)
    return towards(angle) if angle in range(0, 360, 90) else f"{direction:g}°"


def colour(index: int) -> str:
    """Class of series number `index`."""
    return f"s{index % COLOURS}"


def dash(index: int) -> str:
    """Dashes of series number `index`; with the colour they tell 24 series apart."""
    return DASHES[index // COLOURS % len(DASHES)]


def marker(index: int) -> str:
    """Mark of series number `index`: six marks and eight colours repeat together after 24."""
    return MARKERS[index % len(MARKERS)]


def swatch(index: int) -> Markup:
    """The sample of a series for a legend."""
    svg = Svg(30, 12, "")  # the name stands beside it
    with svg.group(class_=f"series {colour(index)}"):
        svg.path([1, 29], [6, 6], "line", dash=dash(index))
        svg.marker(15, 6, index)
    return svg.render("swatch")


def _wide(ends: tuple[float, float]) -> tuple[float, float]:
    """A range that is not empty."""
    low, high = ends
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _written(attributes: Mapping[str, object]) -> str:
    words = []
    for name, value in attributes.items():
        if value is None:
            continue
        name = name if name == "viewBox" else name.removesuffix("_").replace("_", "-")
        text = _number(float(value)) if isinstance(value, (int, float, np.number)) else str(value)
        words.append(f' {name}="{escape(text)}"')
    return "".join(words)
