"""The ground plane and friction."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from tests.support.small_biped import BOX_FOOT, motors, write_biped

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


def test_contact_pairs(tmp_path: Path) -> None:
    """A foot that meets the ground only as an explicit pair is a foot."""
    foot = BOX_FOOT.replace("/>", ' contype="0" conaffinity="0"/>')
    pairs = "".join(f'<pair geom1="{s}_sole" geom2="floor"/>' for s in ("left", "right"))
    extra = motors(ctrlrange="-9 9") + f"<contact>{pairs}</contact>"
    robot = load_robot(
        write_biped(tmp_path, foot=foot, extra=extra, world=FLOOR, options={"friction": 0.6})
    )
    np.testing.assert_array_equal(robot.model.pair_friction[:, :2], 0.6)
    path = write_biped(tmp_path, foot=foot, extra=extra, ground="floor")
    assert ground_name(path) == "floor", "a ground that only the pairs name is added"


def test_friction(tmp_path: Path) -> None:
    """Friction of the description holds for every geom; without it the model's stays."""
    assert np.all(load_robot(write_biped(tmp_path)).model.geom_friction[:, 0] == 1)
    path = write_biped(tmp_path, world=FLOOR, options={"friction": 0.7})
    assert np.all(load_robot(path).model.geom_friction[:, 0] == 0.7)


WRONG = {
    "unknown name": ({"world": FLOOR, "ground": "lawn"}, ["ground", "'lawn'", "choices: floor"]),
    "raised": ({"world": FLOOR.replace("/>", ' pos="0 0 0.1"/>')}, ["ground", "z = 0"]),
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
