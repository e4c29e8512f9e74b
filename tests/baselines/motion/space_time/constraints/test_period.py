"""When constraints hold: times, phases, planted feet; the clip's time, without what leads to it."""

import numpy as np
import pytest

from poise.baselines.motion.space_time.constraints.constraint import Period, When, period_frames
from poise.configs.errors import ConfigError
from tests.support.scenes import DT, LEAD, swaying

FIRST = round(LEAD / DT)  # frame of the clip's time 0


@pytest.mark.parametrize(
    ("period", "first", "last"),
    [
        ("always", 0, 12),
        ((0.1, 0.2), 3, 6),
        ((0.09, 0.21), 3, 6),
        (When(at=0.31), 9, 9),
        (When(phase=(0.25, 0.5)), 3, 6),
        (When(contact="left"), 0, 4),
        (When(contact="right"), 0, 12),
        (When(contact="both"), 0, 4),
    ],
)
def test_frames(period: Period, first: int, last: int) -> None:
    scene = swaying()
    assert scene.duration == pytest.approx(12 * DT)
    scene.planted[FIRST + 5 :, scene.sides["left"]] = False
    frames = period_frames(period, scene)
    assert frames.tolist() == list(range(FIRST + first, FIRST + last + 1))


def test_what_has_no_frames() -> None:
    scene = swaying()
    scene.planted[:, scene.sides["left"]] = False
    for period, text in (
        (When(at=0.6), r"period: has no frames: \[0.6, 0.6\] s of a clip from 0 to 0.40 s"),
        ((-0.2, -0.1), "period: has no frames"),
        ((0.2, 0.1), "period: ends before it begins"),
        (When(contact="left"), "period.contact: the feet 'left' are never planted"),
    ):
        with pytest.raises(ConfigError, match=text):
            period_frames(period, scene)


def test_frames_of_a_part() -> None:
    """Of every third frame: the nearest one to a time is among them."""
    part = swaying().part(np.arange(0, 25, 3))
    assert part.dt == pytest.approx(3 * DT)
    assert period_frames(When(at=0.2), part).tolist() == [4]
    assert period_frames((0.1, 0.2), part).tolist() == [3, 4]
