"""training/motion/following/rehearsal.py: steps that fail are slower, or walked."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import RobotClip, write_robot_clip
from poise.baselines.motion.retargeting.retarget import Holds, Rehearsed
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip, retarget_clip
from poise.training.motion.following import rehearsal as rehearsals
from poise.training.motion.following.rehearsal import rehearsal
from tests.support.captures import make
from tests.support.physics import robot_named

ROBOT = robot_named("humanoid")


@pytest.fixture(autouse=True, scope="module")
def few() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rehearsals, "STARTS", 2)
        yield


@pytest.fixture(scope="module")
def said() -> list[str]:
    """What is said of the trial of `made`."""
    return []


@pytest.fixture(scope="module")
def made(said: list[str]) -> RetargetedClip:
    """A walk with steps of its own."""
    return retarget_clip(make("walk")[0], ROBOT, holds=rehearsal(ROBOT, said=said.append))


def tried(holds: Callable[[RobotClip, str], bool]) -> Holds:
    """Trials that fail at once where this is False."""
    return lambda made, controller: Rehearsed(float(holds(made, controller)))


def test_a_motion_that_is_kept_holds(made: RetargetedClip, said: list[str]) -> None:
    assert made.held and not made.walker and made.clip.planted is not None
    assert said == ["trying it: motion-step, 2 starts"]


def test_a_controller_that_steps_on_its_own_does_not_hold(
    made: RetargetedClip, tmp_path: Path
) -> None:
    """Nor does one that falls."""
    clip = made.clip
    timid = tmp_path / "timid.yaml"
    timid.write_text("base: motion-step\nperform:\n  margin: 0.0\n  margin_both: 0.0\n")
    assert rehearsal(ROBOT)(clip, str(timid)).share == 0.0
    weak = tmp_path / "weak.yaml"
    weak.write_text("base: motion-step\nperform:\n  gain: 0.0\n  margin: 9.0\n  margin_both: 9.0\n")
    assert 0.0 <= rehearsal(ROBOT)(clip, str(weak)).share < 1.0


@pytest.mark.weekly
def test_what_does_not_hold_is_slower_and_in_the_end_walked() -> None:
    """By a planner that takes the clip's own steps."""
    clip = make("walk")[0].at_speed(0.9)
    asked: list[RobotClip] = []

    def second(made: RobotClip, controller: str) -> bool:
        asked.append(made)
        return len(asked) > 1

    fastest = retarget_clip(clip, ROBOT)
    slower = retarget_clip(clip, ROBOT, holds=tried(second))
    assert len(asked) == 2 and slower.held
    assert 0.7 <= slower.stride * slower.tempo <= fastest.stride * fastest.tempo
    walked = retarget_clip(clip, ROBOT, holds=tried(lambda made, controller: controller == "walk"))
    assert walked.walker == "walk" and walked.held and not walked.bound


def test_a_walk_that_does_not_hold_is_slower(tmp_path: Path) -> None:
    """Its commands and its time alike, down to 0.7 of the clip's, then with arms that balance the
    robot."""
    clip, paces = make("circle")[0], []

    def third(made: RobotClip, controller: str) -> bool:
        assert made.commands is not None and controller == "walk" and not made.about.free_arms
        paces.append((made.commands[:, 1].max(), 1.0 / made.dt))
        return len(paces) > 2

    fastest = retarget_clip(clip, ROBOT)
    slower = retarget_clip(clip, ROBOT, holds=tried(third))
    assert slower.held and slower.tempo == pytest.approx(0.8 * fastest.tempo)
    for column in np.array(paces).T:
        np.testing.assert_allclose(column / column[0], [1.0, 0.9, 0.8])
    free = retarget_clip(clip, ROBOT, holds=tried(lambda made, controller: made.about.free_arms))
    assert free.held and free.tempo == fastest.tempo
    write_robot_clip(free.clip, tmp_path / "free.npz")
    assert load_motion(tmp_path / "free.npz", ROBOT).at_speed(0.9).free_arms
