"""The floor of a robot's world, whatever it is in its model; envs/robots/floors.py."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

from poise.configs.errors import ConfigError, PoiseWarning
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot, load_robot
from tests.support.small_biped import BOX_FOOT, write_biped

STAGE = '<geom name="stage" type="box" size="3 3 0.05" pos="0 0 0.05"/>'
FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'


def ground_name(path: Path) -> str:
    robot = load_robot(path)
    return robot.model.geom(robot.ground_geom_id).name


def test_added_where_there_is_none(tmp_path: Path) -> None:
    """A model without a plane gets one, called as the description says."""
    assert ground_name(write_biped(tmp_path)) == "ground"
    assert ground_name(write_biped(tmp_path, ground="lawn")) == "lawn"


def test_added_ground_touches_unusual_masks(tmp_path: Path) -> None:
    """The added ground collides with whatever collides at all."""
    foot = BOX_FOOT.replace("/>", ' contype="4" conaffinity="0"/>')
    load_robot(write_biped(tmp_path, foot=foot))
    foot = BOX_FOOT.replace("/>", ' contype="0" conaffinity="8"/>')
    load_robot(write_biped(tmp_path, foot=foot))


def test_models_own_plane(tmp_path: Path) -> None:
    """The model's plane is the ground: the first one, the named one, or one without a name."""
    other = '<geom name="other" type="plane" size="1 1 1"/>'
    picture = '<geom type="plane" size="1 1 1" contype="0" conaffinity="0" pos="0 0 -1"/>'
    assert ground_name(write_biped(tmp_path, world=picture + FLOOR + other)) == "floor"
    path = write_biped(tmp_path, world=FLOOR + other, ground="other")
    assert ground_name(path) == "other"
    assert ground_name(write_biped(tmp_path, world=FLOOR.replace('name="floor"', ""))) == "ground"


WRONG = {
    "unknown name": ({"world": FLOOR, "ground": "lawn"}, ["ground", "'lawn'", "choices: floor"]),
    "stage": (
        {"world": FLOOR + STAGE},
        ["ground: standing on 'floor', the robot touches 'stage' (box)"],
    ),
    "rocks": (
        {"world": '<geom name="rock" size="0.1"/>', "ground": "lawn"},
        ["ground: standing on 'lawn', the robot touches 'rock' (sphere)"],
    ),
    "slope": ({"world": FLOOR.replace("/>", ' euler="5 0 0"/>')}, ["ground", "z = 0"]),
    "masks": (
        {"world": FLOOR, "foot": BOX_FOOT.replace("/>", ' contype="2" conaffinity="2"/>')},
        ["feet[0]", "collision geometry"],
    ),
    "friction": ({"options": {"friction": 0}}, ["options.friction", "above 0"]),
}


@pytest.mark.parametrize(("change", "words"), WRONG.values(), ids=WRONG)
def test_wrong_ground(tmp_path: Path, change: dict, words: list[str]) -> None:
    """A ground on which the robot cannot stand is refused with the file and the field."""
    path = write_biped(tmp_path, **change)
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


LEVEL = {
    "a box": '<geom name="f" type="box" size="3 3 0.05" pos="0 0 -0.05" friction="0.3"/>',
    "a higher box": '<geom name="f" type="box" size="3 3 0.05" pos="0 0 1" friction="0.3"/>',
    "a disc": '<geom name="f" type="cylinder" size="3 0.05" pos="0 0 -0.05" friction="0.3"/>',
    "a plane of a body": '<body pos="0 0 2"><geom name="f" type="plane" size="1 1 1" '
    'friction="0.3"/></body>',
    "a higher plane": '<geom name="f" type="plane" size="1 1 1" pos="0 0 0.5" friction="0.3"/>',
    "two planes": '<geom name="f" type="plane" size="1 1 1" friction="0.3"/>'
    '<geom name="g" type="plane" size="1 1 1"/>',
    "a box in a stage": '<geom name="g" type="plane" size="1 1 1" pos="0 0 -0.1"/>'
    '<geom name="f" type="box" size="3 3 0.05" pos="0 0 -0.05" friction="0.3"/>',
}  # fmt: skip


def standing_contacts(robot: Robot) -> set[str]:
    """Names of the geoms of the world that the standing robot touches."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    geoms = [geom for contact in data.contact[: data.ncon] for geom in contact.geom]
    return {model.geom(g).name for g in geoms if model.body_weldid[model.geom_bodyid[g]] == 0}


@pytest.mark.parametrize("what", LEVEL)
def test_a_level_floor_is_the_plane_that_it_stands_for(tmp_path: Path, what: str) -> None:
    """At z = 0, with its friction, and nothing else beneath the soles; what changed is said."""
    foot = BOX_FOOT.replace("/>", ' friction="0.1"/>')
    name = {"ground": "f"} if what == "a box in a stage" else {}
    path = write_biped(tmp_path, foot=foot, world=LEVEL[what], **name)
    with pytest.warns(PoiseWarning, match="'f'"):
        robot = load_robot(path)
    ground = robot.ground_geom_id
    assert robot.model.geom_pos[ground].tolist() == [0.0, 0.0, 0.0] and robot.notes
    assert contact_friction(robot.model, ground, robot.soles[0].geom_ids) == 0.3
    assert standing_contacts(robot) == {robot.model.geom(ground).name}
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    assert data.sensordata[robot.sensor_adr["left"]] > 0
