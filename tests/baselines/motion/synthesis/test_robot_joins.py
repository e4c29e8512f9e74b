"""Scripts of a robot's clips: joined by what the robot can do, refused or led round where not."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.feasibility.check import FeasibilityLimits, check_joints
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, joints_of
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import GraphClip, MotionGraph
from poise.baselines.motion.retargeting.performed import robot_clip_of
from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot, robot_qpos
from poise.baselines.motion.synthesis.robot_joins import RobotJoins
from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.synthesis import Synthesis
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named
from tests.support.robot_clips import packaged_clip

pytest.importorskip("mink")
NAMES = ("squat", "arm_swing")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def clips(robot: Robot) -> dict[str, Clip]:
    made = {name: packaged_clip(robot, name) for name in NAMES}
    return {name: clip_of_robot(robot, clip.qpos, clip.dt, name) for name, clip in made.items()}


@pytest.fixture(scope="module")
def graph(clips: dict[str, Clip]) -> MotionGraph:
    entries = [(GraphClip(name, name, clip.duration), clip) for name, clip in clips.items()]
    return make_graph(entries, robot="humanoid")


@pytest.fixture(scope="module")
def synthesis(robot: Robot, graph: MotionGraph, clips: dict[str, Clip]) -> Synthesis:
    return Synthesis(graph, clips, "physical", robot_joins=RobotJoins(robot))


@pytest.mark.parametrize("arrow", ["->", "->{physical}"])
def test_clips_left_and_entered_in_motion_are_joined_by_what_is_possible(
    arrow: str, robot: Robot, synthesis: Synthesis, clips: dict[str, Clip]
) -> None:
    """No torque, ZMP or joint of the join is out of bounds in the motion that is performed."""
    clip, record = synthesis.make(parse(f"squat[0:0.8] {arrow} arm_swing[0.9:2.1]"))
    first, join, second, back = record["parts"]
    made = robot_clip_of(clip, robot, "made")
    assert made.duration == pytest.approx(record["duration"]) == pytest.approx(back["ends"])
    for before, after in pairwise(record["parts"]):
        assert before["ends"] == pytest.approx(after["begins"])
    assert join["what"] == back["what"] == "physical" and not join["physics"]["through_standing"]
    assert join["ends"] - join["begins"] == pytest.approx(sum(join["physics"]["durations"]))
    own = robot_qpos(clips["squat"].cut(0.0, first["ends"]), robot)
    assert np.abs(made.qpos[: len(own), 7:] - own[:, 7:]).max() < 1e-3
    motion, planted = reference_from(made, robot, "made"), PlantedRobot(robot)
    for part in (join, back):  # a frame beside a cut is the clip's
        times = np.arange(part["begins"] + 0.03, part["ends"] - 0.03, 0.02)
        judged = check_joints(planted, joints_of(motion), times)
        assert judged.feasible, judged.reason
    assert second["enter"] == 0.0 and np.abs(made.qpos[-1] - robot.standing_qpos).max() == 0.0


def test_a_motion_from_standing_to_standing_is_led_nowhere(synthesis: Synthesis) -> None:
    _, record = synthesis.make(parse("squat"))
    assert [part["what"] for part in record["parts"]] == ["squat"]


def turned(robot: Robot) -> dict[str, Clip]:
    """Two seconds of standing with the trunk turned to a side each."""
    waist = robot.joint_names.index("abdomen_z")
    still, clips = packaged_clip(robot, "standing", 0.1), {}
    for name, way in (("left", 0.3), ("right", -0.3)):
        qpos = still.qpos.copy()
        qpos[:, 7 + waist] += way
        clips[name] = clip_of_robot(robot, qpos, still.dt, name)
    return clips


def synthesis_within(robot: Robot, limits: FeasibilityLimits) -> Synthesis:
    clips = turned(robot)
    entries = [(GraphClip(name, name, clip.duration), clip) for name, clip in clips.items()]
    joins = RobotJoins(robot, limits)
    return Synthesis(make_graph(entries, robot="humanoid"), clips, "physical", robot_joins=joins)


def test_what_the_robot_cannot_do_is_refused_with_the_reason(robot: Robot) -> None:
    """0.3 rad in 2.5 s take 15/8 · 0.3/2.5 = 0.23 rad/s at the fastest, by standing too."""
    synthesis = synthesis_within(robot, FeasibilityLimits(speed=0.1))
    for arrow, place in (("->", "no way from "), ("->{physical}", "line 1, column 6: ")):
        with pytest.raises(ConfigError) as caught:
            synthesis.plan(parse(f"left {arrow} right"))
        assert place in str(caught.value) and "joint speed" in str(caught.value)
        assert "to standing: joint speed" in str(caught.value)


def test_where_there_is_no_direct_way_it_goes_by_standing(robot: Robot) -> None:
    """0.6 rad in 2.5 s is too fast by 15/8 · 0.6/2.5, half of it is not."""
    waist = robot.joint_names.index("abdomen_z")
    synthesis = synthesis_within(robot, FeasibilityLimits(speed=0.36))
    clip, record = synthesis.make(parse("left -> right"))
    join = next(part for part in record["parts"] if part["what"] == "physical"
                and part["coefficient"] is not None)  # fmt: skip
    assert join["physics"]["through_standing"] and len(join["physics"]["durations"]) == 2
    middle = robot_qpos(clip, robot)[round((join["begins"] + join["ends"]) / 2.0 / clip.dt)]
    assert abs(middle[7 + waist]) < 0.05


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("squat ->{physical, 0.4} squat", "line 1, column 7: a physical transition lasts as long"),
        ("squat[0:0.04] ->{physical} arm_swing", "column 15: 'squat [0:0.04]' has fewer than 4 fr"),
    ],
)
def test_what_is_wrong_is_said(text: str, said: str, synthesis: Synthesis) -> None:
    with pytest.raises(ConfigError) as caught:
        synthesis.plan(parse(text))
    assert said in str(caught.value) and "\n" not in str(caught.value)
