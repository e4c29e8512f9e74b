"""What tests of the QP's rows share: the humanoid, and a state of its recovery."""

import pytest

from poise.envs.robots.robot import Robot
from tests.support.physics import recovery, robot_named


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def tick():
    """A state on the way back from a push, where limits bind."""
    return recovery()[30]
