"""training/pictures/report/charts.py and training/pictures/report/time_chart.py."""

from __future__ import annotations

import base64
import csv
import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from poise.training.benchmarking.statistics.fits import fit_logistic
from poise.training.pictures.report.charts import (
    MIDDLE,
    RADIUS,
    Series,
    fall_curves,
    forest,
    level_curves,
    polar,
    rate_series,
)
from poise.training.pictures.report.time_chart import signals_csv, time_plot

ANGLES = np.arange(0.0, 360.0, 90.0)


def one(name: str, index: int, *values: float) -> Series:
    """A series over four directions."""
    y = np.array(values)
    return Series(name, index, ANGLES[: len(y)], y, 0.9 * y, 1.1 * y)


def points(path: ElementTree.Element) -> np.ndarray:
    """Coordinates of a path (n, 2)."""
    pairs = re.findall(r"[ML]([-\d.]+),([-\d.]+)", path.get("d", ""))
    return np.array(pairs, dtype=float)


def of_class(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return [element for element in root.iter() if name in (element.get("class") or "").split()]


def test_directions_are_seen_from_above() -> None:
    """Forward is up, left is left; lengths are in proportion; the limit is drawn."""
    series = [one("a", 0, 1.0, 2.0, 1.0, 2.0)]
    root = ElementTree.fromstring(polar(series, "N·s", (ANGLES, [2.0] * 4)))
    forward, left, backward, right = points(of_class(root, "line")[0]) - np.array(MIDDLE)
    assert forward[0] == pytest.approx(0, abs=0.1) and forward[1] < 0 < backward[1]
    assert left[0] < 0 < right[0] and left[1] == pytest.approx(0, abs=0.1)
    assert abs(left[0]) == pytest.approx(2 * abs(forward[1]), abs=0.2)
    (limit,) = of_class(root, "limit")
    assert np.hypot(*(points(limit) - np.array(MIDDLE)).T) == pytest.approx(-left[0], abs=0.2)
    assert -left[0] <= RADIUS and "a 1 to 2" in root.get("aria-label", "")


def test_a_bound_is_a_hollow_mark_with_a_line_to_where_the_value_is() -> None:
    """Outwards of a lower bound, inwards of an upper one; it is told as one."""
    series = replace(one("a", 0, 1.0, 2.0, 1.0, 2.0), side=np.array([1.0, 0.0, -1.0, 0.0]))
    root = ElementTree.fromstring(polar([series], "N·s"))
    lower, upper = of_class(root, "bound")
    for group, longer in ((lower, True), (upper, False)):
        line, mark = group
        starts, ends = ([float(line.get(f"{axis}{k}", "")) for axis in "xy"] for k in (1, 2))
        radii = [np.hypot(*(np.array(end) - np.array(MIDDLE))) for end in (starts, ends)]
        assert bool(radii[1] > radii[0]) is longer and mark.get("class") == "mark"
    told = [element.text or "" for element in root.iter() if element.tag.endswith("title")]
    first = [text.split(": ")[1].split(" (")[0] for text in told]
    assert first == ["at least 1", "2", "at most 1", "2"]


def test_one_of_many_stands_out() -> None:
    """In its own picture the others are faint, on the same scale."""
    series = [one("a", 0, 1, 1, 1, 1), one("b", 9, 2, 2, 2, 2)]
    root = ElementTree.fromstring(polar(series, "N·s", marked=series[0]))
    assert len(of_class(root, "faint")) == 1 and len(of_class(root, "line")) == 1
    assert [g.get("data-series") for g in of_class(root, "series")] == ["0"]


def test_limits_of_steps_are_drawn_as_far_as_there_is_room() -> None:
    """A line for each, on the scale of the rest; where one is far out it is cut, not bent."""
    series = [one("a", 0, 10.0, 8.0, 10.0, 8.0)]
    near = {"one": (ANGLES, [16.0] * 4), "two": (ANGLES, [20.0, 900.0, 20.0, 20.0])}
    root = ElementTree.fromstring(polar(series, "N·s", (ANGLES, [5.0] * 4), steps=near))
    first, second = (of_class(root, f"n{k}")[0] for k in (1, 2))
    line = points(of_class(root, "line")[0]) - np.array(MIDDLE)
    corners = points(first) - np.array(MIDDLE)
    assert corners[:4] == pytest.approx(line * 1.6 * np.array([[1], [1.25], [1], [1.25]]), abs=0.3)
    assert len(corners) == 5 and corners[4] == pytest.approx(corners[0])  # closed
    assert len(points(second)) == 4 and np.abs(points(second) - MIDDLE).max() < RADIUS
    assert abs(line[0, 1]) > 0.3 * RADIUS  # the far one did not squash it
    assert not of_class(ElementTree.fromstring(polar(series, "N·s")), "steps")


def test_every_series_is_in_a_group_of_its_own() -> None:
    """What the page shows and hides; bands and bars are details."""
    x = np.linspace(0.1, 1.0, 40)
    fits = {name: fit_logistic(x, x < at) for name, at in (("a", 0.5), ("b", 0.05))}
    series = [
        rate_series("a", 0, [0.3, 0.8], [(1, 20), (19, 20)]),
        rate_series("b", 1, [1], [(9, 9)]),
    ]
    root = ElementTree.fromstring(fall_curves(series, fits, "push", (0.1, 1.0)))
    groups = of_class(root, "series")
    assert [g.get("data-series") for g in groups] == ["0", "1"]
    assert len(of_class(groups[0], "line")) == 1 and len(of_class(groups[0], "mark")) == 2
    assert not of_class(groups[1], "line")  # its J50 is a bound
    assert all(
        "whisker" in line.get("class", "")
        for g in of_class(root, "detail")
        for line in g.iter("line")
    )
    rising = points(of_class(groups[0], "line")[0])[:, 1]
    assert rising[0] > rising[-1]  # more falls are higher up


def test_levels_keep_their_order_and_mark_the_standard() -> None:
    """The standard case is shaded, the text says every rate."""
    series = [rate_series("a", 0, [0, 1, 2], [(1, 4), (4, 4), (2, 4)])]
    root = ElementTree.fromstring(level_curves(series, ["0.4", "0.8", "1"], "friction", 1))
    (band,) = of_class(root, "standard")
    mark = of_class(root, "mark")[1].get("transform", "")
    x = float(re.findall(r"[\d.]+", mark)[0])
    assert float(band.get("x", 0)) < x < float(band.get("x", 0)) + float(band.get("width", 0))
    assert "a 0.4: 25%, 0.8: 100%, 1: 50%" in root.get("aria-label", "")


def test_a_forest_has_a_row_for_each() -> None:
    """Values without an interval have no bar."""
    nothing = Series("b", 1, np.zeros(1), np.ones(1), np.array([np.nan]), np.array([np.nan]))
    root = ElementTree.fromstring(forest([one("a", 0, 2.0), nothing], "J50", ".1f"))
    assert len(of_class(root, "mark")) == 2 and len(of_class(root, "whisker")) == 1
    assert root.get("aria-label") == "J50: a 2.0 (1.8 to 2.2); b 1.0."


def signals(n: int = 50) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A trial in which the CoM runs away to the left."""
    t = np.linspace(0.0, 2.0, n)
    far = np.column_stack([0 * t, t**3])
    support = np.tile([[-0.1, 0.1], [-0.15, 0.15]], (n, 1, 1))
    return t, {"com": far, "cop": 0 * far, "capture_point": 2 * far, "support": support,
               "angular_momentum": np.zeros((n, 3)), "torque": 0.5 + 0 * t}  # fmt: skip


def test_a_fall_does_not_flatten_what_came_before() -> None:
    """Metres away is cut off; the support fills a good part of its panel; the push is shaded."""
    t, columns = signals()
    root = ElementTree.fromstring(time_plot(t, columns, 2.0, [(0.5, 0.1), (1.5, 0.1)], "A trial."))
    height = np.ptp(points(of_class(root, "support")[1])[:, 1])
    assert height > 30 and len(of_class(root, "push")) == 8
    com = points(of_class(root, "com")[1])
    assert len(com) < len(t) and np.ptp(com[:, 1]) > height
    bottom = float(root.get("viewBox", "").split()[3])
    assert all(0 <= y <= bottom for path in root.iter("path") for y in points(path)[:, 1])


def test_signals_are_handed_out_in_numbers() -> None:
    """A line for every time with all columns."""
    t, columns = signals(5)
    text = base64.b64decode(signals_csv("trial", t, columns).url.split(",")[1]).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 5 and float(rows[-1]["t"]) == 2.0 and float(rows[-1]["com_y"]) == 8.0
    assert float(rows[0]["support_y_high"]) == 0.15 and float(rows[0]["L_z"]) == 0.0
