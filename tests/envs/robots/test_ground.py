"""Friction, options and flags; envs/robots/ground.py."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.configs.errors import PoiseWarning
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import load_robot
from tests.support.small_biped import BOX_FOOT, motors, write_biped

FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'


def test_contact_pairs(tmp_path: Path) -> None:
    """A foot that meets the ground only as an explicit pair is a foot."""
    foot = BOX_FOOT.replace("/>", ' contype="0" conaffinity="0"/>')
    pairs = "".join(f'<pair geom1="{s}_sole" geom2="floor"/>' for s in ("left", "right"))
    extra = motors(ctrlrange="-9 9") + f"<contact>{pairs}</contact>"
    robot = load_robot(
        write_biped(tmp_path, foot=foot, extra=extra, world=FLOOR, options={"friction": 0.6})
    )
    np.testing.assert_array_equal(robot.model.pair_friction[:, :2], 0.6)
    robot = load_robot(write_biped(tmp_path, foot=foot, extra=extra, ground="floor"))
    assert robot.model.geom(robot.ground_geom_id).name == "floor", "only the pairs name it"


def test_friction(tmp_path: Path) -> None:
    """Friction of the description holds for every geom; without it the model's stays."""
    assert np.all(load_robot(write_biped(tmp_path)).model.geom_friction[:, 0] == 1)
    path = write_biped(tmp_path, world=FLOOR, options={"friction": 0.7})
    assert np.all(load_robot(path).model.geom_friction[:, 0] == 0.7)


FLAGS = ("contact", "gravity", "actuation", "constraint", "sensor")


@pytest.mark.parametrize("flag", FLAGS)
def test_flags_that_no_robot_stands_without_are_turned_on(tmp_path: Path, flag: str) -> None:
    """Files for inverse kinematics have them; it is said, and the robot is the same."""
    option = f'<option><flag {flag}="disable"/></option>'
    path = write_biped(tmp_path, extra=motors(ctrlrange="-50 50") + option)
    with pytest.warns(PoiseWarning, match=f"flags disable {flag}: turned on"):
        robot = load_robot(path)
    assert robot.notes == (f"the model's flags disable {flag}: turned on",)
    (tmp_path / "plain").mkdir()
    assert robot.fingerprint == load_robot(write_biped(tmp_path / "plain")).fingerprint


def test_an_override_of_contacts_is_the_friction(tmp_path: Path) -> None:
    """Whatever the geoms say."""
    option = '<option o_friction="0.2 0.2 0 0 0"><flag override="enable"/></option>'
    robot = load_robot(write_biped(tmp_path, extra=motors(ctrlrange="-50 50") + option))
    assert contact_friction(robot.model, robot.ground_geom_id, robot.soles[0].geom_ids) == 0.2


def test_friction_may_be_stiffer_than_the_contact(tmp_path: Path) -> None:
    """`cone` and `impratio` of the description are MuJoCo's; other dynamics, another robot."""
    plain = load_robot(write_biped(tmp_path))
    options = {"cone": "elliptic", "impratio": 50}
    (tmp_path / "stiff").mkdir()
    stiff = load_robot(write_biped(tmp_path / "stiff", options=options))
    assert (plain.model.opt.impratio, stiff.model.opt.impratio) == (1.0, 50.0)
    assert stiff.model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC != plain.model.opt.cone
    (tmp_path / "round").mkdir()
    prints = {robot.fingerprint for robot in (
        plain, stiff, load_robot(write_biped(tmp_path / "round", options={"cone": "elliptic"})),
    )}  # fmt: skip
    assert len(prints) == 3
