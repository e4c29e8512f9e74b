"""training/pictures/report/svg.py."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from poise.training.pictures.report.svg import (
    Chart,
    Svg,
    colour,
    dash,
    marker,
    number_text,
    swatch,
    ticks,
)


def test_a_drawing_is_valid_and_escaped() -> None:
    """Texts and attributes with < & and quotes are written so that XML reads them back."""
    name = 'a <b> & "c"'
    svg = Svg(20, 10, name)
    with svg.group(class_="series s0", data_series="0"):
        svg.text(1, 2, name, "tick", font_size=3)
        svg.marker(3, 4, 0, name)
    root = ElementTree.fromstring(svg.render())
    assert root.get("aria-label") == name and root.get("viewBox") == "0 0 20 10"
    (group,) = root
    assert group.get("data-series") == "0"
    assert group[0].text == name and group[0].get("font-size") == "3"
    assert group[1][0].tag == "title" and group[1][0].text == name


def test_a_path_breaks_where_there_is_nothing() -> None:
    """NaN lifts the pen; a path of nothing is not drawn."""
    svg = Svg(10, 10, "")
    svg.path([0, 1, 2, 3], [0, 1, np.nan, 3], "line")
    svg.path([np.nan], [0.0], "line")
    assert svg.render().count("<path") == 1
    assert 'd="M0,0L1,1M3,3"' in svg.render()
    assert 'aria-hidden="true"' in svg.render()  # without a label it is no picture of its own


def test_axes_map_ends_to_edges() -> None:
    """The ordinate grows downwards in the drawing."""
    chart = Chart(Svg(100, 100, ""), (10, 20, 90, 80), (0.0, 4.0), (-1.0, 1.0))
    assert chart.x([0, 4]).tolist() == [10, 90] and chart.y([-1, 0, 1]).tolist() == [80, 50, 20]
    flat = Chart(Svg(1, 1, ""), (0, 0, 1, 1), (3.0, 3.0), (0.0, 1.0))
    assert flat.x(3.0) == 0.5


@pytest.mark.parametrize(
    ("low", "high", "count", "expected"),
    [
        (0.0, 1.0, 5, [0, 0.2, 0.4, 0.6, 0.8, 1]),
        (-0.12, 0.13, 3, [-0.1, 0, 0.1]),
        (9.7, 18.6, 5, [10, 12, 14, 16, 18]),
        (0.0, 3000.0, 3, [0, 1000, 2000, 3000]),
    ],
)
def test_ticks_are_round(low: float, high: float, count: int, expected: list[float]) -> None:
    """Steps of 1, 2 or 5 times a power of ten, inside the range, and no −0."""
    found = ticks(low, high, count)
    assert found == pytest.approx(expected)
    assert "−0" not in [number_text(value, "g") for value in found]


def test_looks_tell_24_series_apart() -> None:
    """Colour, dash and mark together do not repeat before."""
    looks = {(colour(k), dash(k), marker(k)) for k in range(24)}
    assert len(looks) == 24
    assert all(colour(k) in swatch(k) for k in range(24))
