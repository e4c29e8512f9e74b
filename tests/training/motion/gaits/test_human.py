"""training/motion/gaits/knee_moment.py: the band that knees are compared with."""

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.training.motion.gaits.knee_moment import KneeMoment, load_knee_moment


def test_the_packaged_band_says_where_it_is_from():
    band = load_knee_moment()
    mean, half = band.curves()
    assert "Winter" in band.source and "coarse" in band.source
    assert mean.shape == half.shape == (51,)
    assert mean[0] == band.mean[0] and mean[-1] == band.mean[-1]
    assert 0.3 < mean.max() < 0.8 and np.all(half > 0.0)


def test_curves_are_linear_between_the_points():
    mean, half = KneeMoment("x", (0.0, 50.0, 100.0), (0.0, 1.0, 0.0), (0.2, 0.4, 0.2)).curves()
    assert mean[10] == pytest.approx(0.4) and half[10] == pytest.approx(0.28)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("stance: [0, 100]", "stance: must be as long as mean and half_width, two points or more"),
        ("stance: [0, 50, 40]", "stance: must rise from 0 to 100"),
        ("half_width: [0.1, -0.1, 0.1]", "half_width: must not be negative"),
    ],
)
def test_a_bad_band_is_refused(tmp_path, change, said):
    lines = {"source": "source: x", "stance": "stance: [0, 50, 100]", "mean": "mean: [0, 1, 0]",
             "half_width": "half_width: [0.1, 0.1, 0.1]"}  # fmt: skip
    lines[change.split(":")[0]] = change
    path = tmp_path / "band.yaml"
    path.write_text("\n".join(lines.values()))
    with pytest.raises(ConfigError, match=said):
        load_knee_moment(path)
