"""Pictures of one trial over time."""

import numpy as np
import pytest

from poise.training.pictures.figures import style
from poise.training.pictures.figures.style import Inline
from poise.training.pictures.figures.time_series import FAR, trial_timeseries
from tests.support.drawings import drawing, points


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


def trial(n=500):
    """Two seconds of a trial: time and all signals."""
    t = np.arange(n) * 0.004
    sway = 0.05 * np.sin(3 * t)
    line = np.stack([sway, 0.5 * sway], axis=1)
    support = np.tile([[-0.1, 0.16], [-0.13, 0.13]], (n, 1, 1))
    torque = np.where((t > 0.5) & (t < 0.8), 1.0, 0.3)
    signals = {"com": line, "cop": 1.5 * line, "capture_point": 2 * line}
    return t, signals | {"support": support, "torque": torque}


def by_label(ax):
    """The artists of the axes by their label."""
    handles, labels = ax.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def test_a_trial_shows_its_signals_against_the_support(tmp_path, figures):
    """Each panel holds one axis of every signal, the support, and the push."""
    t, signals = trial()
    trial_timeseries(tmp_path / "a.png", t, signals, pushes=[(0.5, 0.1), (1.0, 0.2)])
    for axis, ax in enumerate(figures[0].axes[:2]):
        artists = by_label(ax)
        assert set(artists) == {
            "support",
            "capture point",
            "centre of mass",
            "centre of pressure",
            "push",
        }
        np.testing.assert_allclose(artists["centre of mass"].get_ydata(), signals["com"][:, axis])
        reach = artists["support"].get_paths()[0].vertices[:, 1]
        np.testing.assert_allclose([reach.min(), reach.max()], signals["support"][0, axis])
    pushes = [(p.get_x(), p.get_width()) for p in figures[0].axes[2].patches]
    np.testing.assert_allclose(pushes, [(0.5, 0.1), (1.0, 0.2)])


def test_saturation_is_shaded_where_it_is(tmp_path, figures):
    """The torque panel marks the time at the limit, and nothing if there is none."""
    t, signals = trial()
    trial_timeseries(tmp_path / "a.png", t, signals)
    marked = by_label(figures[0].axes[2])["motor at its limit"].get_paths()[0].vertices[:, 0]
    assert marked.min() == pytest.approx(0.5, abs=0.01)
    assert marked.max() == pytest.approx(0.8, abs=0.01)
    trial_timeseries(tmp_path / "a.png", t, signals | {"torque": np.full(t.size, 0.5)})
    assert "motor at its limit" not in by_label(figures[1].axes[2])


def test_a_fall_does_not_flatten_the_rest(tmp_path, figures):
    """A CoM metres away leaves the support readable; without a fall nothing is cut off."""
    t, signals = trial()
    trial_timeseries(tmp_path / "a.png", t, signals)
    bottom, top = figures[0].axes[0].get_ylim()
    assert bottom < -0.1 and 0.16 < top < 0.2
    trial_timeseries(tmp_path / "a.png", t, signals | {"com": signals["com"] + 5 * t[:, None]})
    bottom, top = figures[1].axes[0].get_ylim()
    assert bottom < -0.1 and 0.16 + FAR <= top < 0.16 + FAR + 0.1


def test_gaps_and_missing_signals_are_drawn(tmp_path):
    """NaN (no contact) and a trial with only some signals are fine."""
    t, signals = trial()
    signals["cop"][200:] = np.nan
    signals["support"][200:] = np.nan
    trial_timeseries(tmp_path / "a.png", t, signals)
    trial_timeseries(tmp_path / "b.png", t, {"com": signals["com"]})
    assert (tmp_path / "b.png").stat().st_size > 10_000


def test_the_legend_is_not_cut_off(tmp_path, figures):
    """With every signal, the legend fits into the picture and covers no axes."""
    t, signals = trial()
    trial_timeseries(tmp_path / "a.png", t, signals, pushes=[(0.5, 0.1)])
    for figure in figures:
        box = figure.legends[0].get_window_extent()
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0
        assert not any(box.overlaps(ax.get_tightbbox()) for ax in figure.axes)


def test_unknown_signals_are_refused(tmp_path):
    """A misspelt signal is an error that names the known ones."""
    with pytest.raises(ValueError, match="capture_point"):
        trial_timeseries(tmp_path / "a.png", [0.0, 1.0], {"zmp": np.zeros((2, 2))})
    assert not list(tmp_path.iterdir())


def test_a_page_cuts_off_what_lies_outside_of_the_panels(tmp_path):
    """Nothing is drawn beside them where the CoM runs away; all panels have the push and words."""
    t, signals = trial()
    out, momentum = Inline("A trial."), np.column_stack([t, -t, 0 * t])
    far = signals["com"] + 5 * t[:, None]
    trial_timeseries(out, t, signals | {"com": far, "angular_momentum": momentum},
                     pushes=[(0.5, 0.1)])  # fmt: skip
    assert out.svg.count("<title>push</title>") == 4
    width, height = (float(v) for v in drawing(out.svg).get("viewBox", "").split()[2:])
    every = np.concatenate([points(path) for path in drawing(out.svg).iter("path")])
    assert every.min() >= 0 and (every <= (width, height)).all()
    words = [text.text for text in drawing(out.svg).iter("text")]
    assert {"forward [m]", "left [m]", "L [kg·m²/s]", "peak torque", "time [s]"} <= set(words)
