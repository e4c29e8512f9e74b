"""Benchmark pictures: what they show, that they are saved whole, and that they leave no trace."""

import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from poise.training.benchmarking.statistics.fits import LogisticFit, fit_logistic
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.pictures.figures import style
from poise.training.pictures.figures.envelope import polar_envelope
from poise.training.pictures.figures.rates import fall_probability
from poise.training.pictures.figures.series import SIDES, Series

ANGLES = np.arange(8) * 45.0
BLUE = np.array([0x00, 0x72, 0xB2]) / 255


@pytest.fixture
def figures(monkeypatch):
    """The figures that were drawn, for a look at their artists."""
    drawn = []

    class Recorded(style.Figure):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            drawn.append(self)

    monkeypatch.setattr(style, "Figure", Recorded)
    return drawn


def circle(name, radius, width=1.0, index=0):
    """An envelope that is the same in all directions."""
    j50 = np.full(8, float(radius))
    return Series(name, index, ANGLES, j50, j50 - width, j50 + width)


def exact(directions, j50):
    """An envelope with intervals of no width."""
    return Series("a", 0, directions, j50, j50, j50)


def falls(n=200, j50=14.0, seed=0):
    """Trials that fall above about j50."""
    rng = np.random.default_rng(seed)
    impulse = rng.uniform(8, 20, n)
    return impulse, rng.random(n) < 1 / (1 + np.exp(impulse - j50))


def blue_centroid(path):
    """Where the first series lies in the picture: columns right, rows down, in [-1, 1]."""
    image = imread(path)[:, :, :3]
    height, width, _ = image.shape
    image = image[: int(0.9 * height)]  # without the legend
    rows, columns = np.nonzero(np.abs(image - BLUE).max(axis=2) < 0.02)
    return columns.mean() / width * 2 - 1, rows.mean() / height * 2 - 1


@pytest.mark.parametrize("angle, axis, sign", [(0, 1, -1), (90, 0, -1)])
def test_forward_is_up_and_left_is_left(tmp_path, angle, axis, sign):
    """A controller that is strong in one direction bulges there: 0° up, 90° left."""
    j50 = np.where(angle == ANGLES, 20.0, 2.0)
    polar_envelope(tmp_path / "a.png", [exact(ANGLES, j50)])
    assert sign * blue_centroid(tmp_path / "a.png")[axis] > 0.1


def test_envelope_is_closed_whatever_the_order(tmp_path, figures):
    """Directions are sorted, taken modulo 360° and the curve ends where it starts."""
    directions = np.array([270.0, 0.0, -180.0, 90.0])
    j50 = np.array([4.0, 1.0, 3.0, 2.0])
    polar_envelope(tmp_path / "a.png", [exact(directions, j50)])
    (line,) = (x for x in figures[0].axes[0].lines if x.get_label() == "a")
    np.testing.assert_allclose(np.degrees(line.get_xdata()), [0, 90, 180, 270, 360])
    np.testing.assert_allclose(line.get_ydata(), [1, 2, 3, 4, 1])


def test_envelope_shows_bands_limit_and_rings_from_zero(tmp_path, figures):
    """Each controller has its band, the ankle limit its line, and the radius starts at zero."""
    polar_envelope(
        tmp_path / "a.png",
        [circle("momentum-qp", 15), circle("residual", 18, 2, index=1)],
        ankle_limit=(np.arange(0, 360, 5), np.full(72, 21.0)),
    )
    ax = figures[0].axes[0]
    assert {x.get_label() for x in ax.lines} >= {"momentum-qp", "residual", "ankle limit"}
    reach = [band.get_paths()[0].vertices[:, 1] for band in ax.collections]
    assert [(r.min(), r.max()) for r in reach] == [(14, 16), (16, 20)]
    assert ax.get_ylim()[0] == 0 and ax.get_ylim()[1] >= 21
    *rings, outer = [text.get_text() for text in ax.get_yticklabels()]
    assert outer.endswith(" N·s") and all(float(ring) > 0.0 for ring in rings)


def test_envelope_shows_what_steps_can_stop(tmp_path, figures):
    """A line for each number of steps, inside the rings."""
    lines = {
        "one": (ANGLES, np.full(len(ANGLES), 30.0)),
        "two": (ANGLES, np.full(len(ANGLES), 38.0)),
    }
    polar_envelope(tmp_path / "a.png", [circle("a", 15)], step_limits=lines)
    ax = figures[0].axes[0]
    assert {x.get_label() for x in ax.lines} >= {"a", "one", "two"}
    assert ax.get_ylim()[1] >= 38


def test_limits_far_out_do_not_squash_the_envelope(tmp_path, figures):
    """What is many times as far out as all else is cut off."""
    far = {"two": (ANGLES, np.full(len(ANGLES), 400.0))}
    polar_envelope(tmp_path / "a.png", [circle("a", 15)], step_limits=far)
    assert 2.0 * 15 < figures[0].axes[0].get_ylim()[1] < 4.0 * 15


def test_envelope_with_a_missing_direction(tmp_path):
    """A direction without a figure is a gap, not an error."""
    found = circle("a", 15)
    found.y[2] = found.low[2] = found.high[2] = np.nan
    polar_envelope(tmp_path / "a.png", [found])
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_bounds_are_hollow_and_point_to_where_j50_is(tmp_path, figures):
    """Outwards where more was recovered than was tried, inwards where less; inside the rings."""
    sides = np.array([SIDES[b] for b in (None, "lower", None, "upper", None, None, None, None)])
    bounds = replace(circle("a", 15), side=sides)
    polar_envelope(tmp_path / "a.png", [bounds, circle("b", 4, index=1)])
    ax = figures[0].axes[0]
    hollow = [x for x in ax.lines if x.get_markerfacecolor() == "white" and len(x.get_xdata())]
    assert [np.degrees(x.get_xdata()[0]) for x in hollow] == pytest.approx([45.0, 135.0])
    assert {x.get_ydata()[0] for x in hollow} == {15.0}
    (out, inwards) = ax.texts[-2:]
    assert out.xy[1] > 15.5 and inwards.xy[1] < 14.5 and ax.get_ylim()[1] > out.xy[1]
    assert "hollow: only a bound" in [text.get_text() for text in figures[0].legends[0].get_texts()]


def test_a_picture_of_too_few_trials_says_so(tmp_path, figures):
    """Also where nothing at all is drawn."""
    nothing = np.full(8, np.nan)
    polar_envelope(tmp_path / "a.png", [exact(ANGLES, nothing)], note="None.")
    assert figures[0].axes[0].get_title().endswith("None.")


@pytest.mark.parametrize("count", [1, 5])
def test_the_legend_lies_beside_the_data_and_in_the_picture(tmp_path, figures, count):
    """However many controllers there are, the legend covers no axes and is not cut off."""
    names = [f"a controller with a name {k}" for k in range(count)]
    polar_envelope(
        tmp_path / "a.png", [circle(name, 10 + k, index=k) for k, name in enumerate(names)]
    )
    fall_probability(tmp_path / "b.png", {name: falls(seed=k) for k, name in enumerate(names)})
    for figure in figures:
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == names
        box = legend.get_window_extent()
        assert not any(box.overlaps(ax.get_tightbbox()) for ax in figure.axes)
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0


def test_text_stays_in_the_picture(tmp_path, figures):
    """Titles and labels do not run over the edge, nor into each other."""
    polar_envelope(tmp_path / "a.png", [circle("a", 10)])
    title = figures[0].get_suptitle() and figures[0]._suptitle.get_window_extent()
    assert title.y1 <= figures[0].bbox.y1
    assert not title.overlaps(figures[0].axes[0].title.get_window_extent())


def test_series_differ_without_colour(tmp_path):
    """Eight colours, six markers, then 48 different pairs."""
    looks = [style.look(k) for k in range(8)]
    assert len({x.colour for x in looks}) == 8 and len({x.marker for x in looks}) == 6
    every = [style.look(k) for k in range(48)]
    assert len({(look.colour, look.marker) for look in every}) == 48
    assert style.look(48) == looks[0]


def dots(ax):
    """Where the marks are."""
    return [(x.get_xdata()[0], x.get_ydata()[0]) for x in ax.lines if len(x.get_xdata()) == 1]


def test_dots_are_falls_with_wilson_bars(tmp_path, figures):
    """With few distinct impulses each is a dot at its rate of falls, with its Wilson interval."""
    impulse = np.repeat([10.0, 14.0], [10, 20])
    recovered = np.r_[np.ones(9), 0, np.ones(5), np.zeros(15)]
    fall_probability(tmp_path / "a.png", {"a": (impulse, recovered)})
    ax = figures[0].axes[0]
    assert dots(ax) == [(10.0, 0.1), (14.0, 0.75)]
    ends = [bar.get_segments()[0][:, 1] for bar in ax.collections]
    np.testing.assert_allclose(ends, [wilson_interval(1, 10), wilson_interval(15, 20)])


def test_bins_hold_all_trials_evenly(tmp_path, figures):
    """Many distinct impulses make the wanted number of dots, rising with the impulse."""
    fall_probability(tmp_path / "a.png", {"a": falls(n=100)}, bins=5)
    x, y = zip(*dots(figures[0].axes[0]), strict=True)
    assert len(x) == 5 and np.all(np.diff(x) > 0)
    assert np.mean(y) == pytest.approx(1 - falls(n=100)[1].mean())


def test_the_curve_is_the_fit(tmp_path, figures):
    """The curve is 1 − P(recover), and the legend names J50."""
    trials = falls()
    fit = fit_logistic(*trials)
    fall_probability(tmp_path / "a.png", {"a": trials}, {"a": fit})
    curve = max(figures[0].axes[0].lines, key=lambda x: len(x.get_xdata()))
    np.testing.assert_allclose(curve.get_ydata(), 1 - fit.probability(curve.get_xdata()))
    assert curve.get_ydata()[0] < curve.get_ydata()[-1]
    assert figures[0].legends[0].get_texts()[0].get_text() == f"a: J50 = {fit.j50:.2f}"
    assert "fraction" in figures[0].axes[0].get_xlabel()


def test_a_bound_has_no_curve(tmp_path, figures):
    """A J50 that is only a bound is written as one, without a made-up curve."""
    impulse = np.linspace(8, 12, 30)
    fit = fit_logistic(impulse, np.ones(30))
    fall_probability(tmp_path / "a.png", {"a": (impulse, np.ones(30))}, {"a": fit})
    assert figures[0].legends[0].get_texts()[0].get_text() == "a: J50 ≥ 12.00"
    assert max(len(x.get_xdata()) for x in figures[0].axes[0].lines) <= 2
    assert "fraction" in figures[0].axes[0].get_xlabel()


def test_the_same_figures_give_the_same_file(tmp_path):
    """No date or random number goes into the picture."""
    for name in ("a.png", "b.png"):
        polar_envelope(tmp_path / name, [circle("a", 15)])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_failed_drawing_leaves_the_old_file(tmp_path):
    """Bad data raise before anything is written; no part file stays behind."""
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    with pytest.raises(ValueError, match="shape"):
        polar_envelope(path, [circle("a", 1)], ankle_limit=(ANGLES, [1.0]))
    with pytest.raises(ValueError, match="shape"):
        fall_probability(path, {"a": ([1.0, 2.0], [1])})
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_missing_folders_are_made_and_no_part_file_stays(tmp_path):
    """A picture may go into a folder that does not exist yet."""
    polar_envelope(tmp_path / "new" / "a.png", [circle("a", 15)])
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["a.png"]
    assert (tmp_path / "new" / "a.png").read_bytes().startswith(b"\x89PNG")


def test_settings_of_the_user_are_left_alone(tmp_path):
    """Drawing changes no matplotlib setting, even if it fails."""
    with matplotlib.rc_context({"font.size": 7.5, "axes.grid": False, "axes.titlesize": 31.0}):
        before = dict(matplotlib.rcParams)
        polar_envelope(tmp_path / "a.png", [circle("a", 15)])
        with pytest.raises(ValueError):
            polar_envelope(tmp_path / "a.png", [circle("a", 1)], ankle_limit=(ANGLES, [1.0]))
        assert dict(matplotlib.rcParams) == before


def test_pyplot_is_never_imported(tmp_path):
    """Plotting needs no pyplot and so touches no global figure or display."""
    code = (
        "import sys, numpy as np\n"
        "from poise.training.pictures.figures import envelope, series, time_series\n"
        "s = series.series('a', 0, [(90.0 * k, 1.0, 1.0, 2.0) for k in range(4)])\n"
        f"envelope.polar_envelope({str(tmp_path / 'a.png')!r}, [s])\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_any_name_and_any_fit_is_drawn(tmp_path):
    """A name that looks like TeX is only a name; a fit may come from a summary."""
    name, fit = r"runs/$\lost$", LogisticFit(14.0, 12.0, 1.0, None, 200, 100)
    fall_probability(tmp_path / "a.png", {name: falls()}, {name: fit}, xlabel="J/m")
    assert (tmp_path / "a.png").exists()
