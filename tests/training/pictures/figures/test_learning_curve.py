"""training/pictures/figures/learning_curve.py: what is drawn of runs and of what does not learn."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from poise.training.pictures.figures import learning_curve as module
from poise.training.pictures.figures.learning_curve import learning_curve

CURVE = [(2000, 14.0, 13.0, 15.5), (1000, 12.0, 11.0, 13.0)]


def test_points_are_in_the_order_of_their_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line over environment steps with its band, and a level line for what does not learn."""
    figures: list[Figure] = []
    legend_below = module.legend_below
    monkeypatch.setattr(module, "legend_below", lambda f: [figures.append(f), legend_below(f)])
    learning_curve(tmp_path / "a.png", {"runs/a": CURVE}, {"momentum-qp": 9.5}, note="Only so.")
    (ax,) = figures[0].axes
    line, level = ax.lines
    assert np.array_equal(line.get_xydata(), [[1000, 12], [2000, 14]])
    assert set(np.asarray(level.get_ydata())) == {9.5}
    (band,) = ax.collections
    assert band.get_datalim(ax.transData).bounds == (1000.0, 11.0, 1000.0, 4.5)
    assert "Only so." in ax.get_title(loc="left") and ax.get_ylim()[0] == 0
    assert [line.get_label(), level.get_label()] == ["runs/a", "momentum-qp"]
    assert imread(tmp_path / "a.png").shape[2] == 4
