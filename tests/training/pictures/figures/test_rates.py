"""training/pictures/figures/rates.py and series.py, as pages show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.training.benchmarking.statistics.fits import fit_logistic
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.pictures.figures.envelope import polar_envelope
from poise.training.pictures.figures.rates import (
    fall_probability,
    forest,
    level_curves,
    phase_curves,
)  # fmt: skip
from poise.training.pictures.figures.series import Series, rate_series, series
from poise.training.pictures.figures.style import Inline
from tests.support.drawings import drawing, groups, marks, middle, points

ANGLES = np.arange(0.0, 360.0, 90.0)


def around(name: str, index: int, *values: float) -> Series:
    """A series over four directions."""
    y = np.array(values)
    return Series(name, index, ANGLES, y, 0.9 * y, 1.1 * y)


def test_a_bound_is_hollow_in_every_picture_and_told_as_one() -> None:
    """With an arrow to where the value is: outwards of a lower bound, inwards of an upper one."""
    sides = np.array([1.0, 0.0, -1.0, 0.0])
    found = replace(around("a", 0, 10.0, 20.0, 10.0, 20.0), side=sides)
    polar, flat = Inline(), Inline()
    polar_envelope(polar, [found])
    phase_curves(flat, [replace(found, x=np.array([0.1, 0.3, 0.5, 0.7]))])
    for out, form in ((polar, "g"), (flat, ".1f")):
        told = [f"a: at least {10:{form}}",  # without an interval, which would contradict it
                f"a: {20:{form}} ({18:{form}} to {22:{form}})",
                f"a: at most {10:{form}}"]  # fmt: skip
        lower, known, upper = (marks(out)[text] for text in told)
        for mark in (lower, upper):
            assert mark.get("fill") == "var(--card)" and mark.get("stroke") == "var(--s0)"
        assert known.get("fill") == "var(--s0)" and len(marks(out)) == 3  # two are told alike
        arrows = [g for g in groups(out) if len(g) == 2 and g[0].tag == "path"]
        assert len(arrows) == 2
    zero, up = (middle(marks(polar)[text]) for text in ("a: at most 10", "a: at least 10"))
    (out_tip, in_tip) = (points(group[0])[-1] for group in groups(polar)
                         if len(group) == 2 and group[0].tag == "path")  # fmt: skip
    assert out_tip[1] < up[1] - 5.0 and in_tip[1] < zero[1] - 5.0  # forward and from behind: up


def test_directions_are_seen_from_above() -> None:
    """Forward is up, left is left; lengths are in proportion; the limits have their dashes."""
    out = Inline()
    limit = (ANGLES, [2.0] * 4)
    polar_envelope(out, [around("a", 0, 1.0, 2.0, 1.0, 2.0)], ankle_limit=limit)
    line = next(group[0] for group in groups(out) if group[0].get("stroke-width") == "2")
    forward, left, backward, right, again = points(line)
    centre = 0.5 * (forward + backward)
    assert forward[0] == pytest.approx(centre[0], abs=0.1) and forward[1] < backward[1]
    assert left[0] < right[0] and left[1] == pytest.approx(centre[1], abs=0.1)
    assert centre[0] - left[0] == pytest.approx(2 * (centre[1] - forward[1]), abs=0.3)
    np.testing.assert_allclose(again, forward)
    dashed = [p for p in drawing(out.svg).iter("path") if p.get("stroke") == "var(--ink)"]
    assert [p.get("stroke-dasharray") is not None for p in dashed] == [True]
    reach = np.linalg.norm(points(dashed[0]) - centre, axis=1)
    np.testing.assert_allclose(reach, centre[0] - left[0], atol=0.2)


def test_limits_of_steps_are_cut_not_bent() -> None:
    """Where one is far out its line ends."""
    out, far = Inline(), {"two": (ANGLES, [20.0, 900.0, 20.0, 20.0])}
    polar_envelope(out, [around("a", 0, 10.0, 8.0, 10.0, 8.0)], step_limits=far)
    width, height = (float(v) for v in drawing(out.svg).get("viewBox", "").split()[2:])
    dotted = [p for p in drawing(out.svg).iter("path") if p.get("stroke") == "var(--muted)"]
    (line,) = (points(p) for p in dotted if p.get("stroke-dasharray"))
    assert len(line) == 4 and (line > 0).all() and (line < (width, height)).all()


def test_one_of_many_stands_out() -> None:
    """In its own picture the others are faint, and there are no words."""
    out, found = Inline(width=2.2), [around("a", 0, 1, 1, 1, 1), around("b", 9, 2, 2, 2, 2)]
    polar_envelope(out, found, marked="a")
    assert {group.get("data-series") for group in groups(out)} == {"0"}
    faint = [p for p in drawing(out.svg).iter("path") if p.get("stroke-opacity") == "0.4"]
    assert len(faint) == 1 and not list(drawing(out.svg).iter("text"))


def test_falls_have_bins_intervals_and_curves() -> None:
    """More falls are higher up; what is only a bound has no curve; intervals are details."""
    x, out = np.linspace(0.1, 1.0, 40), Inline()
    trials = {"a": (x, x < 0.5), "b": (x, x < 0.05)}
    fits = {name: fit_logistic(*pair) for name, pair in trials.items()}
    fall_probability(out, trials, fits, bins=4)
    lines = {group.get("data-series"): points(group[0]) for group in groups(out)
             if group[0].get("fill") == "none" and group[0].get("stroke-width") == "2"}  # fmt: skip
    assert set(lines) == {"0"} and lines["0"][0, 1] > lines["0"][-1, 1]
    ends = wilson_interval(10, 10)
    assert f"a: 100% ({ends.low:.0%} to {ends.high:.0%})" in marks(out)
    bars = [group for group in groups(out, "detail")]
    assert [group.get("data-series") for group in bars] == ["0"] * 4 + ["1"] * 4


def test_levels_keep_their_order_and_mark_the_standard() -> None:
    """The standard level is shaded, a minus is one."""
    out = Inline()
    found = rate_series("a", 0, [0, 1, 2], [(1, 4), (4, 4), (2, 4)])
    level_curves(out, [found], ["-0.4", "0.8", "1"], 1)
    band = next(p for p in drawing(out.svg).iter("path") if p.get("fill-opacity") == "0.12")
    places = [middle(mark) for mark in marks(out).values()]
    assert points(band)[:, 0].min() < places[1][0] < points(band)[:, 0].max() < places[2][0]
    assert places[1][1] < places[2][1] < places[0][1]  # 100, 50, 25 %
    assert "−0.4" in [text.text for text in drawing(out.svg).iter("text")]


def test_a_forest_has_a_row_for_each_the_first_on_top() -> None:
    """Values without an interval have no bar."""
    out, nothing = Inline(), (0.0, 1.0, np.nan, np.nan)
    rows = [series("a", 0, [(0.0, 2.0, 1.8, 2.2)]), series("b", 1, [nothing])]
    forest(out, rows, "J50", ".1f")
    a, b = (middle(marks(out)[text]) for text in ("a: 2.0 (1.8 to 2.2)", "b: 1.0"))
    assert a[1] < b[1] and b[0] < a[0] and len(list(groups(out, "detail"))) == 1


def test_j50_over_the_phase_is_in_its_place() -> None:
    """Zero is the lower edge, the abscissa is the phase."""
    out = Inline()
    phase_curves(out, [series("walk", 0, [(0.25, 20.0, 19.0, 21.0), (0.75, 10.0, 9.0, 11.0)])])
    high, low = (middle(mark) for mark in marks(out).values())
    edge = max(points(p)[:, 1].max() for p in drawing(out.svg).iter("path")
               if p.get("stroke") == "var(--rule)")  # fmt: skip
    assert edge - high[1] == pytest.approx(2.0 * (edge - low[1]), abs=0.3)
    words = {text.text: float(text.get("x", 0)) for text in drawing(out.svg).iter("text")}
    assert high[0] == pytest.approx(words["0.25"], abs=0.2)


def test_rows_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="one shape"):
        Series("a", 0, ANGLES, np.zeros(4), np.zeros(4), np.zeros(3))
