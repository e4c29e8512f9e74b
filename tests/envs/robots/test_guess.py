"""Descriptions guessed from models alone; envs/robots/guess.py."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError, PoiseWarning
from poise.envs.robots.guess import guess
from poise.envs.robots.menagerie import IN_WHEEL, WHEEL
from poise.envs.robots.robot import load_robot
from tests.support.small_biped import LEG, write_biped
from tests.support.small_urdf import write_urdf


def test_a_urdf_file_alone(tmp_path: Path) -> None:
    """Root, feet, forward, a posture with bent knees, the rotors that the file cannot say."""
    path = write_urdf(tmp_path).with_suffix(".urdf")
    found = guess(path)
    assert found.root == "trunk" and [foot.body for foot in found.feet] == [
        "left_foot",
        "right_foot",
    ]
    assert found.forward == (1.0, 0.0, 0.0) and found.posture.com == "middle"
    assert found.posture.joints["left_knee"] == 40.0 and found.posture.joints["right_hip"] == -20.0
    assert set(found.roles["knees"]) == {"left_knee", "right_knee"}
    assert set(found.armature.values()) == {0.012} and len(found.armature) == 10
    with pytest.warns(
        PoiseWarning, match="guessed: root 'trunk', feet 'left_foot' and 'right_foot'"
    ):
        robot = load_robot(path)
    assert robot.com_ahead == pytest.approx(0.0, abs=1e-6)
    assert robot.model.dof_armature[6:].tolist() == [0.012] * 10


def test_an_mjcf_file_that_faces_backwards_and_bends_the_other_way(tmp_path: Path) -> None:
    """Sides by name; knees about the other axis; its keyframe where it has one."""
    mirrored = LEG.replace('axis="0 1 0" range="5 150"', 'axis="0 -1 0" range="-150 5"')
    write_biped(tmp_path, leg=mirrored)
    path = tmp_path / "biped.xml"
    text = path.read_text()
    path.write_text(text.replace("left", "tfel").replace("right", "left").replace("tfel", "right"))
    found = guess(path)
    assert found.forward == (-1.0, 0.0, 0.0)
    assert found.feet[0].body == "left_foot" and found.posture.joints["left_knee"] != 0.0
    key = '<keyframe><key name="stand" qpos="0 0 1 1 0 0 0 {0} {0}"/></keyframe>'
    path.write_text(text.replace("</mujoco>", key.format("-0.2 -0.4 -0.2 0") + "</mujoco>"))
    assert guess(path).posture.keyframe == "stand"


TAIL = '<body name="tail"><joint/><geom size="0.05" pos="0 0 -0.7"/></body>'
RIGHT = '<body name="right_thigh"'
#: as in humanoid-gym and what was made from it
SLIDES = "".join(f'<joint type="slide" axis="{x}"/>' for x in ("1 0 0", "0 1 0", "0 0 1"))
SLIDES += '<joint type="ball"/>'
UNSURE = {
    "three legs": ((RIGHT, TAIL + RIGHT), "more than two limbs end low"),
    "no free joint": (("<freejoint/>", ""), "give the body 'trunk' a free joint, <freejoint/>"),
    "slides and a ball": (("<freejoint/>", SLIDES), "replace them by a free joint"),
    "tilted feet": (
        ('pos="0.03 0 -0.04"', 'pos="0.03 0 -0.04" euler="0 30 0"'),
        "no posture stands with both soles flat .* has no flat side",
    ),
}


@pytest.mark.parametrize(("change", "text"), UNSURE.values(), ids=UNSURE)
def test_what_is_not_sure_is_asked_for(tmp_path: Path, change: tuple[str, str], text: str) -> None:
    path = write_biped(tmp_path).with_suffix(".xml")
    path.write_text(path.read_text().replace(*change))
    advice = "" if "free joint" in text else ": write a description .* docs/robots.md"
    with pytest.raises(ConfigError, match=f"{text}.*{advice}"):
        load_robot(path)


@pytest.mark.parametrize("file", ["unitree_h1/h1.xml", "booster_t1/t1.xml"])
def test_public_robots_are_guessed_as_they_are_described(file: str) -> None:
    """The same root and feet as in the packaged descriptions; the CoM over the soles."""
    wheel = importlib.util.find_spec(WHEEL)
    if wheel is None:
        pytest.skip("its model is not installed: pip install 'poise[robots]'")
    found = guess(Path(wheel.submodule_search_locations[0]) / IN_WHEEL / file)
    described = load_robot(file.partition("/")[0]).description
    assert found.root == described.root and found.forward == described.forward
    assert [foot.body for foot in found.feet] == [foot.body for foot in described.feet]
    assert np.isfinite(list(found.posture.joints.values())).all()
