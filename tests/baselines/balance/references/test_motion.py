"""Reference motions: what the packaged ones do, consistency in time, and what is refused."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.motion import MotionDescription, load_motion, make_motion
from poise.baselines.balance.references.postures import LevelKinematics
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.configs.schema import build
from poise.envs.robots.robot import load_robot

MOTIONS = ("standing", "squat", "bow", "arm_swing", "weight_shift")


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


@pytest.fixture(scope="module")
def kinematics(robot):
    return LevelKinematics(robot)


def motion_of(data, robot):
    return make_motion(build(MotionDescription, data, "x.yaml"), robot, "x", "x.yaml")


def joint(robot, name):
    return robot.joint_names.index(name)


def test_the_packaged_motions_are_the_documented_ones():
    """Those in place are tested below, those with steps in test_footing.py and test_footwork.py."""
    assert set(packaged("motions")) == {*MOTIONS, "kick", "step_in_place"}


@pytest.mark.parametrize("name", MOTIONS)
def test_references_are_consistent(robot, kinematics, name):
    """Starts standing and at rest; rates are derivatives; height and root follow the joints."""
    motion = load_motion(name, robot)
    first = motion.sample(0.0)
    np.testing.assert_allclose(first.q_ref, robot.standing_qpos[7:], atol=1e-9)
    np.testing.assert_allclose(first.com_offset, [0, 0, robot.height_com], atol=1e-6)
    rates = [rate for i in (0, 3, 6) for rate in (first[i + 1], first[i + 2])]
    np.testing.assert_allclose(np.concatenate([first.root, *rates]), 0.0, atol=1e-9)
    h = 1e-4
    for t in np.random.default_rng(0).uniform(0.01, motion.duration - 0.01, 20):
        before, now, after = (motion.sample(t + dt) for dt in (-h, 0.0, h))
        for i in (0, 3, 6):
            np.testing.assert_allclose((after[i] - before[i]) / (2 * h), now[i + 1], atol=1e-4)
            np.testing.assert_allclose(
                (after[i + 1] - before[i + 1]) / (2 * h), now[i + 2], atol=2e-2
            )
        level = kinematics.posture(now.q_ref)
        assert now.com_offset[2] == pytest.approx(level.com[2], abs=1e-5)
        np.testing.assert_allclose(now.root, kinematics.root_rotation(level), atol=1e-4)
        assert np.all(robot.joint_range[:, 0] <= now.q_ref)
        assert np.all(now.q_ref <= robot.joint_range[:, 1])


@pytest.mark.parametrize("name", MOTIONS)
def test_soles_stay_flat_and_the_com_where_it_belongs(robot, kinematics, name):
    """Both soles stay parallel to 1°; the joints' own CoM follows the CoM reference to 5 mm."""
    motion = load_motion(name, robot)
    for t in np.linspace(0.0, motion.duration, 15):
        sample = motion.sample(t)
        level = kinematics.posture(sample.q_ref)
        moved = level.com - kinematics.standing.com
        np.testing.assert_allclose(moved[:2], sample.com_offset[:2], atol=0.005)
        data = kinematics.data
        normals = [data.xmat[s.body_id].reshape(3, 3) @ s.rotation[:, 2] for s in robot.soles]
        assert normals[0] @ normals[1] > np.cos(np.radians(1.0))


def test_standing_is_the_constant_motion(robot):
    """Nothing moves, at any time."""
    motion = load_motion("standing", robot)
    for t in (0.3, 1.0, 100.0):
        sample = motion.sample(t)
        np.testing.assert_allclose(sample.q_ref, robot.standing_qpos[7:], atol=1e-12)
        assert max(np.abs(sample[i]).max() for i in (1, 2, 4, 5, 7, 8)) < 1e-9


def test_squat_bends_the_knees(robot):
    """Half way the knees are bent 35° more, and the CoM is several centimetres lower."""
    sample = load_motion("squat", robot).sample(1.6)
    standing = robot.standing_qpos[7:]
    for name in ("left_knee", "right_knee"):
        i = joint(robot, name)
        assert sample.q_ref[i] - standing[i] == pytest.approx(-np.radians(35.0), abs=1e-6)
    assert robot.height_com - sample.com_offset[2] > 0.05


def test_bow_leans_the_torso_forward(robot):
    """The root, which is the torso, leans forward by 25° to 40°: the reference says so."""
    root = np.degrees(load_motion("bow", robot).sample(1.9).root)
    assert 25.0 < root[1] < 40.0
    np.testing.assert_allclose(root[[0, 2]], 0.0, atol=0.1)


def test_arms_swing_against_each_other(robot, kinematics):
    """A negative pitch brings the left arm forward while the right goes back, for ever."""
    motion = load_motion("arm_swing", robot)
    assert motion.loop

    def reach(t):
        kinematics.posture(motion.sample(t).q_ref)
        elbows = [kinematics.data.body(f"{side}_lower_arm").xpos for side in ("left", "right")]
        shoulders = [kinematics.data.body(f"{side}_upper_arm").xpos for side in ("left", "right")]
        return np.array(elbows) - np.array(shoulders)

    swing = reach(0.8 + 3 * motion.duration) - reach(0.0)
    assert swing[0, 0] > 0.05 and swing[1, 0] < -0.05
    np.testing.assert_allclose(swing[:, 1], 0.0, atol=0.01)  # not sideways


def test_weight_shift_moves_the_com_by_40_percent_of_half_the_stance(robot):
    """To the left at first and as far to the right later."""
    motion = load_motion("weight_shift", robot)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    half = 0.5 * abs(np.subtract(*[data.xpos[s.body_id][1] for s in robot.soles]))
    left, right = motion.sample(1.2).com_offset, motion.sample(3.6).com_offset
    np.testing.assert_allclose(left[:2], [0.0, 0.4 * half], atol=0.001)
    np.testing.assert_allclose(right[:2], -left[:2], atol=1e-9)


def test_hold_after_the_end(robot):
    """A motion that does not loop holds its last keyframe."""
    sample = load_motion("squat", robot).sample(50.0)
    np.testing.assert_allclose(sample.q_ref, robot.standing_qpos[7:], atol=1e-9)
    assert not sample.v_ref.any() and not sample.a_ref.any()


def test_roles_map_to_joints_with_their_scale(robot):
    """A role may be a pattern or several joints; offsets are scaled."""
    roles = {"all_knees": {"*_knee": -2.0}, "one": {"left_elbow": 1.0, "abdomen_z": 0.5}}
    robot = replace(robot, description=replace(robot.description, roles=roles))
    motion = motion_of({"keyframes": [{"time": 0, "roles": {"all_knees": 3, "one": 4}}]}, robot)
    moved = np.degrees(motion.sample(0.0).q_ref - robot.standing_qpos[7:])
    expected = dict(left_knee=-6.0, right_knee=-6.0, left_elbow=4.0, abdomen_z=2.0)
    for name, value in zip(robot.joint_names, moved, strict=True):
        assert value == pytest.approx(expected.get(name, 0.0), abs=1e-9)


def test_com_in_metres(robot):
    """com_unit m takes the offset as it is."""
    data = {"keyframes": [{"time": 0, "com": [0.02, -0.03]}], "com_unit": "m"}
    np.testing.assert_allclose(motion_of(data, robot).sample(0.5).com_offset[:2], [0.02, -0.03])


@pytest.mark.parametrize(
    ("data", "named"),
    [
        ({"keyframes": []}, ("keyframes", "time 0")),
        ({"keyframes": [{"time": 1.0}]}, ("keyframes", "time 0")),
        ({"keyframes": [{"time": 0.0}, {"time": 0.0}]}, ("keyframes", "increase")),
        ({"keyframes": [{"time": 0.0, "joints": {}}]}, ("keyframes[0].joints", "roles")),
        ({"keyframes": [{"time": 0.0, "roles": {"tail": 3}}]}, ("tail", "roles", "knees")),
        ({"keyframes": [{"time": 0.0, "roles": {"knees": 300}}]}, ("knee", "range")),
        ({"keyframes": [{"time": 0.0, "roles": {"knees": float("nan")}}]}, ("knees", "finite")),
        ({"keyframes": [{"time": 0.0, "com": [0.0, 1.2]}]}, ("keyframes[0].com", "inside")),
        (
            {"keyframes": [{"time": 0, "com": [0.9, 0]}], "balance": {"forward": {"knees": 0}}},
            ("balance",),
        ),
        (
            {"loop": True, "keyframes": [{"time": 0.0}, {"time": 1.0, "com": [0.1, 0.0]}]},
            ("keyframes", "loop"),
        ),
    ],
)
def test_bad_motions_are_refused(robot, data, named):
    """One error naming the file, the field and the choices."""
    with pytest.raises(ConfigError) as error:
        motion_of(data, robot)
    for word in ("x.yaml", *named):
        assert word in str(error.value)


def test_an_unknown_motion_lists_the_known(robot):
    """load_motion names the packaged motions."""
    with pytest.raises(ConfigError, match="arm_swing"):
        load_motion("dance", robot)


KEYED = {
    "keyframes": [
        {"time": 0.0},
        {"time": 1.0, "roles": {"shoulder_pitch_left": 20.0}, "com": [0.2, 0.0]},
        {"time": 1.6, "roles": {"shoulder_pitch_left": 5.0}},
        {"time": 3.0},
    ]
}


@pytest.mark.parametrize("kind", ["linear", "hermite", "catmull-rom", "cubic", "polynomial"])
def test_keyframes_are_met_whatever_is_between_them(robot, kind):
    """Angles and CoM; `rest` is what a motion is without the field."""
    motion = motion_of({**KEYED, "interpolation": kind}, robot)
    default, rest = (motion_of(data, robot) for data in (KEYED, {**KEYED, "interpolation": "rest"}))
    assert np.array_equal(default.coeffs, rest.coeffs)
    assert not np.allclose(motion.sample(0.5).q_ref, rest.sample(0.5).q_ref, atol=1e-4)
    for key in KEYED["keyframes"]:
        ours, theirs = motion.sample(key["time"]), rest.sample(key["time"])
        np.testing.assert_allclose(ours.q_ref, theirs.q_ref, atol=1e-9)
        np.testing.assert_allclose(ours.com_offset[:2], theirs.com_offset[:2], atol=1e-9)
        np.testing.assert_allclose(ours.com_offset[2], theirs.com_offset[2], atol=2e-4)


def test_rates_of_keyframes_are_those_of_the_motion(robot):
    """Given in degrees a second, per role; what has none stands still in the keyframe."""
    data = {"interpolation": "hermite", "keyframes": [dict(key) for key in KEYED["keyframes"]]}
    data["keyframes"][1]["rates"] = {"shoulder_pitch_left": -30.0}
    motion = motion_of(data, robot)
    still = motion_of({**KEYED, "interpolation": "hermite"}, robot)
    assert not still.sample(1.0).v_ref.any()
    rate = motion.sample(1.0).v_ref
    turn = motion.sample(1.0).q_ref - robot.standing_qpos[7:]
    np.testing.assert_allclose(rate, -1.5 * turn, atol=1e-9)  # 20 degrees, -30 a second
    assert rate.any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"interpolation": "bezier"}, ["interpolation", "'bezier'", "catmull-rom"]),
        (
            {"keyframes": [{"time": 0.0, "rates": {"shoulder_pitch_left": 1.0}}]},
            ["rates", "hermite"],
        ),
        (
            {
                "interpolation": "hermite",
                "keyframes": [{"time": 0.0, "rates": {"shoulder_pitch_left": 1.0}}],
            },
            ["first and the last", "rates"],
        ),
        (
            {"interpolation": "polynomial", "keyframes": [{"time": 0.1 * i} for i in range(17)]},
            ["polynomial", "at most 16"],
        ),
        (
            {
                "interpolation": "hermite",
                "keyframes": [{"time": 0.0}, {"time": 1.0, "rates": {"tail": 1.0}}, {"time": 2.0}],
            },
            ["rates", "'tail'", "knees"],
        ),
    ],
)
def test_wrong_interpolations_are_errors(robot, change, words):
    with pytest.raises(ConfigError) as caught:
        motion_of({**KEYED, **change}, robot)
    assert all(word in str(caught.value) for word in ["x.yaml", *words]), caught.value
