"""What a robot can do of a motion: each criterion fails where it is to."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.feasibility.check import (
    FeasibilityLimits,
    check_motion,
    ground_friction,
)
from poise.baselines.motion.feasibility.gap import with_gap
from poise.baselines.registry import momentum_qp_config
from tests.support.physics import robot_named, slippery
from tests.support.robot_clips import com_clip, packaged_clip


def test_packaged_motions_are_possible() -> None:
    robot = robot_named("humanoid")
    for name in ("standing", "squat", "bow", "weight_shift"):
        judged = check_motion(load_motion(name, robot), robot)
        assert judged.feasible and judged.reason == "" and judged.lacking == 0.0, name


def test_a_sway_that_is_too_fast_names_the_zmp_and_its_time() -> None:
    """a ω² h/g beyond the soles: at the first turn the ZMP is out, on the side of the turn."""
    robot = robot_named("humanoid")
    omega = 2.0 * np.pi * 1.5

    def sway(t: float) -> np.ndarray:
        return np.array([0.0, 0.03 * np.sin(omega * t) * min(t / 0.5, 1.0), 0.0])

    judged = check_motion(com_clip(robot, sway, 2.0, 0.02), robot)
    zmp = judged.criteria[0]
    assert not judged.feasible and not zmp.holds and zmp.worst < 0.0
    assert zmp.name in judged.reason and f"{zmp.time:.2f} s" in judged.reason
    k = int(np.argmin(judged.zmp_margin))
    assert judged.times[k] == pytest.approx(zmp.time)
    assert abs(judged.zmp[k, 1]) - judged.support[:, 1].max() == pytest.approx(-zmp.worst, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"zmp_margin": 0.2}, "ZMP inside the soles by"),
        ({"friction": 1e-4}, "friction, of what the ground has"),
        ({"load": (1.0, 2.0)}, "least load"),
        ({"load": (0.3, 1.0)}, "largest load"),
        ({"torque": 0.1}, "torque, of the motor's limit"),
        ({"speed": 0.1}, "joint speed"),
        ({"excess": -3.0}, "joint beyond its range by"),
        ({"drift": -1.0}, "a sole off its place by"),
    ],
)
def test_each_limit_is_looked_at(change: dict[str, float], name: str) -> None:
    robot = robot_named("humanoid")
    limits = replace(FeasibilityLimits(), **change)
    judged = check_motion(load_motion("squat", robot), robot, limits)
    assert [c.name for c in judged.criteria if not c.holds] == [name]


def test_less_friction_is_a_greater_share_of_it() -> None:
    robot = robot_named("humanoid")
    smooth = slippery(robot, 0.2)
    assert ground_friction(smooth) == pytest.approx(0.2)
    shares = [check_motion(load_motion("squat", one), one).friction for one in (robot, smooth)]
    np.testing.assert_allclose(shares[1], shares[0] * ground_friction(robot) / 0.2, rtol=1e-6)


def test_the_qp_gives_a_still_posture_and_a_slow_motion_what_they_ask_for() -> None:
    """No gap in standing, hardly one in a slow squat, a large one in what is not possible."""
    robot = robot_named("humanoid")
    config = momentum_qp_config("momentum-qp")
    slow = packaged_clip(robot, "squat")
    gaps = []
    for clip in (packaged_clip(robot, "standing"), slow, replace(slow, dt=slow.dt / 8.0)):
        motion = reference_from(clip, robot, "test")
        judged = with_gap(check_motion(motion, robot), motion, robot, config)
        assert judged.gap is not None and judged.criteria[-1].worst == judged.gap.max()
        gaps.append(float(judged.gap.max()))
    assert gaps[0] < 1e-5 and gaps[1] < 1e-3 and gaps[2] > 0.05
