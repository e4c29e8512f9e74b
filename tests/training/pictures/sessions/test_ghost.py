"""The ghost of a motion with steps goes on with them, from where the robot stood."""

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.balance.references.stances import away_from_home, place_of
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.training.pictures.sessions.ghost import ghost_of
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip


def test_the_ghost_of_steps_goes_ahead_with_them() -> None:
    robot = robot_named("humanoid")
    motion = reference_from(ahead_clip(robot), robot, "ahead")
    env = ResidualBalanceEnv(robot, controller="motion-step", motion=motion, pushes=None)
    env.reset(seed=4)
    ghost = ghost_of(env)
    assert ghost is not None
    times = np.arange(0.0, motion.duration, 0.02)
    qpos = np.array([ghost.posture(time) for time in times])
    begin, end = (place_of(robot, qpos[k]) for k in (0, -1))
    assert np.hypot(*(end.middle - begin.middle)) > 0.09 * robot.height_com
    np.testing.assert_allclose(begin.middle, env.simulation.state.origin[:2], atol=1e-3)
    assert np.abs(np.diff(qpos[:, :3], axis=0)).max() < 0.02  # 1 m/s: it never jumps
    gaps = away_from_home(robot, qpos[[0, -1]])[0]  # the start is disturbed, so are the soles
    assert gaps[1] == pytest.approx(gaps[0], abs=1e-6) and gaps[0] < 1e-2
    np.testing.assert_allclose(ghost(times[-1]).positions[robot.root_body_id], qpos[-1, :3])
