"""Chains: their joints, their Jacobians against differences, and the base that stays."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.retargeting.inverse_kinematics.chain import Chain
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot
from tests.support.small_biped import write_biped

RNG = np.random.default_rng(0)
POINT = np.array([0.1, -0.2, 0.3])
ARM = """<body name="arm" pos="0 0.2 0.1">
  <joint name="lift" type="slide" axis="0 0.6 0.8" limited="true" range="-0.2 0.3"/>
  <joint name="swing" axis="1 0 0" limited="false"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/></body>"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def slider(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A biped with an arm on a slide and a hinge without limits."""
    folder: Path = tmp_path_factory.mktemp("slider")
    return load_robot(write_biped(folder, trunk=ARM))


CHAINS = {
    "outward": ("torso", ["right_lower_arm"]),
    "inward": ("left_foot", ["torso"]),
    "across": ("left_foot", ["right_lower_arm", "right_foot"]),
}


def test_joints_are_in_the_order_of_the_ways(robot: Robot) -> None:
    assert Chain(robot, "torso", ["right_lower_arm"]).names == (
        "right_shoulder1", "right_shoulder2", "right_elbow",
    )  # fmt: skip
    across = Chain(robot, "left_foot", ["right_lower_arm", "right_foot"])
    assert across.names[:2] == ("left_ankle_x", "left_ankle_y")
    assert across.names[8:12] == (
        "abdomen_z", "right_shoulder1", "right_shoulder2", "right_elbow",
    )  # fmt: skip
    assert across.names[12:] == (
        "right_hip_x", "right_hip_z", "right_hip_y", "right_knee", "right_ankle_y",
        "right_ankle_x",
    )  # fmt: skip
    assert across.signs.tolist() == [-1.0] * 9 + [1.0] * 9
    assert across.moves.sum(axis=0).tolist() == [12, 12]


@pytest.mark.parametrize("name", CHAINS)
def test_jacobians_are_derivatives(robot: Robot, name: str) -> None:
    """Of places, and of axes as rotations, by central differences over every joint."""
    chain = Chain(robot, *CHAINS[name])
    compare_jacobians(chain)


def test_jacobians_of_slides(slider: Robot) -> None:
    chain = Chain(slider, "left_foot", ["arm"])
    assert {"lift", "swing", "left_knee"} < set(chain.names)
    compare_jacobians(chain)


def compare_jacobians(chain: Chain, h: float = 1e-6) -> None:
    q = RNG.uniform(*chain.free)
    for end in range(len(chain.ends)):
        chain.move(q)
        of_place, of_turn = chain.jacobians(end, POINT)
        axes = chain.end_pose(end, POINT)[1]
        for i in range(len(q)):
            poses = []
            for way in (-h, h):
                chain.move(q + way * np.eye(len(q))[i])
                poses.append(chain.end_pose(end, POINT))
            moved = (poses[1][0] - poses[0][0]) / (2 * h)
            spin = (poses[1][1] - poses[0][1]) @ axes.T / (2 * h)  # [ω]×
            assert of_place[:, i] == pytest.approx(moved, abs=1e-7)
            turned = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            assert of_turn[:, i] == pytest.approx(turned, abs=1e-7)


def test_the_manifold_of_the_root_does_not_matter(robot: Robot) -> None:
    """A displacement of the free joint moves no end relative to the base."""
    chain = Chain(robot, "left_foot", ["right_lower_arm"])
    before = np.concatenate([part.ravel() for part in chain.end_pose(0, POINT)])
    moved, displacement = robot.standing_qpos.copy(), np.zeros(robot.model.nv)
    displacement[:6] = RNG.normal(size=6)
    mujoco.mj_integratePos(robot.model, moved, displacement, 1.0)
    chain.place(moved)
    after = np.concatenate([part.ravel() for part in chain.end_pose(0, POINT)])
    assert after == pytest.approx(before, abs=1e-12)
    assert not np.allclose(moved[:7], robot.standing_qpos[:7])


def test_lines_are_the_columns_of_the_jacobians(robot: Robot, slider: Robot) -> None:
    """A hinge moves a point by n × (p − o) and turns it by n, a slide moves it by n."""
    for chain in (Chain(robot, *CHAINS["inward"]), Chain(slider, "left_foot", ["arm"])):
        chain.move(RNG.uniform(*chain.free))
        anchors, axes = chain.lines()
        place = chain.end_pose(0, POINT)[0]
        of_place, of_turn = chain.jacobians(0, POINT)
        moved = np.where(chain.slides[:, None], axes, np.cross(axes, place - anchors))
        assert of_place.T == pytest.approx(moved, abs=1e-12)
        assert of_turn.T == pytest.approx(np.where(chain.slides[:, None], 0.0, axes), abs=1e-12)


@pytest.mark.parametrize("name", CHAINS)
def test_the_base_stays_where_it_was(robot: Robot, name: str) -> None:
    chain = Chain(robot, *CHAINS[name])
    start = robot.standing_qpos.copy()
    mujoco.mj_integratePos(robot.model, start, RNG.uniform(-0.4, 0.4, robot.model.nv), 1.0)
    chain.place(start)
    before = [part.copy() for part in chain.frame()]
    q = RNG.uniform(*chain.free)
    qpos = chain.whole(q, start)
    assert qpos[chain.qpos] == pytest.approx(q)
    others = np.setdiff1d(np.arange(7, robot.model.nq), chain.qpos)
    assert np.array_equal(qpos[others], start[others])
    chain.place(qpos)
    for now, then in zip(chain.frame(), before, strict=True):
        assert now == pytest.approx(then, abs=1e-12)


def test_joints_without_mobility_are_left_out(robot: Robot) -> None:
    chain = Chain(robot, "pelvis", ["right_lower_arm"], {"abdomen_*": 0.0, "right_elbow": 0.25})
    assert chain.names == ("right_shoulder1", "right_shoulder2", "right_elbow")
    assert chain.mobility.tolist() == [1.0, 1.0, 0.25]


def test_absent_limits_become_half_a_turn_for_random_postures(slider: Robot) -> None:
    chain = Chain(slider, "trunk", ["arm"])
    assert chain.high.tolist() == [0.3, np.inf]
    assert chain.free[1] - chain.free[0] == pytest.approx([0.5, 2 * np.pi])


@pytest.mark.parametrize(
    ("base", "ends", "mobility", "words"),
    [
        ("hull", ["torso"], {}, ["body", "'hull'", "choices", "torso"]),
        ("torso", ["head"], {}, ["body", "'head'"]),
        ("torso", ["torso"], {}, ["no joint", "'torso'"]),
        ("torso", ["pelvis"], {"abdomen_*": 0.0}, ["no joint"]),
        ("torso", ["pelvis"], {"abdomen_z": 1.5}, ["mobility.abdomen_z", "0 to 1"]),
        ("torso", ["pelvis"], {"tail": 1.0}, ["mobility", "'tail'"]),
    ],
)
def test_errors_name_what_is_wrong(robot: Robot, base, ends, mobility, words) -> None:
    with pytest.raises(ConfigError) as caught:
        Chain(robot, base, ends, mobility)
    assert all(word in str(caught.value) for word in words), caught.value
