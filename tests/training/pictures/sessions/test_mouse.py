"""training/pictures/sessions/mouse.py: from a body that is dragged to a push."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.physics.pushes.options import parse_pushes
from poise.envs.physics.pushes.table import pack
from poise.envs.physics.simulation import Simulation
from poise.training.pictures.sessions.frames import Frame
from poise.training.pictures.sessions.mouse import GAIN, LONGEST, Pull, pull
from tests.support.shared import generic_state, robot

EYE = np.array([3.0, 2.0, 1.9])


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return generic_state()


def grabbed_and_pulled(simulation: Simulation, arrow: np.ndarray, flat: bool = False) -> Pull:
    """The torso, grabbed 5 cm off its centre of mass, and the mouse moved by an arrow from there;
    `flat`: with a camera at the same height."""
    data, body = simulation.data, simulation.model.body("torso").id
    grabbed = data.xipos[body] + [0.03, -0.04, 0.0]
    eye = EYE * [1.0, 1.0, 0.0] + [0.0, 0.0, grabbed[2]] if flat else EYE
    through = grabbed + arrow
    under = through if flat else eye + 0.7 * (through - eye)  # the same ray, nearer
    frame = Frame(0.0, data.xpos, data.xquat, data.xpos[0], (), {}, None)
    return pull(robot(), frame, body, grabbed, (eye, under))


def test_the_arrow_ends_under_the_mouse_at_the_same_height(simulation: Simulation) -> None:
    """Where the ray meets the horizontal plane of the grabbed point, however the camera looks."""
    for flat in (False, True):
        found = grabbed_and_pulled(simulation, np.array([0.2, 0.3, 0.0]), flat)
        assert np.allclose(found.arrow, [0.2, 0.3, 0.0], atol=1e-9)


def test_the_push_is_the_arrow(simulation: Simulation) -> None:
    """Impulse by its length; direction from the heading at the reset; the force where it was
    grabbed, towards the mouse."""
    arrow = np.array([0.0, 0.4, 0.0])
    found, yaw = grabbed_and_pulled(simulation, arrow), simulation.state.heading_yaw
    fields = found.fields(robot(), yaw, 0.1)
    impulse = GAIN * robot().mass * 0.4 / robot().height_com
    assert fields["impulse"] == pytest.approx(impulse, abs=0.01) and fields["body"] == "torso"
    (push,) = parse_pushes(fields, robot())
    row = pack([push], robot(), yaw)[0]
    force, point = row["force"], row["point"]
    assert np.allclose(force / np.linalg.norm(force), [0.0, 1.0, 0.0], atol=2e-3)
    body = simulation.model.body("torso").id
    rotation = simulation.data.xmat[body].reshape(3, 3)
    assert np.allclose(simulation.data.xipos[body] + rotation @ point, found.start, atol=1e-4)


def test_no_push_is_boundless(simulation: Simulation) -> None:
    """The arrow is cut off, its direction stays."""
    found = grabbed_and_pulled(simulation, np.array([-1.9, 0.0, 0.0]))
    assert np.linalg.norm(found.arrow) == pytest.approx(LONGEST * robot().height_com)
    assert found.arrow[0] < 0.0 and found.arrow[1] == pytest.approx(0.0, abs=1e-9)
