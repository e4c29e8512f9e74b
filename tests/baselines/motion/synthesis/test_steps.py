"""Scripts of motions with steps: led on from where the feet stand, or refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.feasibility.check import check_motion
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import GraphClip
from poise.baselines.motion.retargeting.performed import clip_with_support, robot_clip_of
from poise.baselines.motion.retargeting.robot_bvh import robot_qpos
from poise.baselines.motion.synthesis.robot_joins import RobotJoins
from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.synthesis import Synthesis
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip, packaged_clip, swings

pytest.importorskip("mink")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def clips(robot: Robot) -> dict[str, Clip]:
    made = {"swing": packaged_clip(robot, "arm_swing"), "ahead": ahead_clip(robot)}
    return {name: clip_with_support(clip, robot, name) for name, clip in made.items()}


def of_kind(robot: Robot, clips: dict[str, Clip], kind: str = "physical") -> Synthesis:
    entries = [(GraphClip(name, name, clip.duration), clip) for name, clip in clips.items()]
    joins = RobotJoins(robot)
    return Synthesis(make_graph(entries, robot="humanoid"), clips, kind, robot_joins=joins,
                     others=["kick"])  # fmt: skip


@pytest.fixture(scope="module")
def synthesis(robot: Robot, clips: dict[str, Clip]) -> Synthesis:
    return of_kind(robot, clips)


def test_a_script_goes_on_from_the_new_stance(robot: Robot, synthesis: Synthesis) -> None:
    """Two steps ahead, each 0.1 h; the ZMP is inside the planted soles all along."""
    text = "ahead[0.4:3.8] -> swing[0.5:2.1] -> ahead[0.6:4.3] mirrored"
    clip, record = synthesis.make(parse(text))
    joins = [part for part in record["parts"] if part["what"] == "physical"]
    assert len(joins) == 3  # one leads from standing
    assert clip.support is not None and len(clip.support.home) == len(clip)
    made = robot_clip_of(clip, robot, "made")
    motion = reference_from(made, robot, "made")
    assert motion.footing is not None and made.planted is not None
    one = reference_from(ahead_clip(robot), robot, "").footing
    assert one is not None
    first, second = (foot for foot, *_ in swings(one))
    assert [foot for foot, *_ in swings(motion.footing)] == [first, second, second, first]
    _, places, _ = sole_poses(robot, made.qpos)
    moved = places[-1, :, 0] - places[0, :, 0]
    assert moved == pytest.approx(np.full(2, 0.2 * robot.height_com), abs=1e-3)
    for foot in range(2):
        for a, b in ((part["begins"], part["ends"]) for part in joins):
            own = places[round(a * 30) : round(b * 30) + 1, foot]
            assert np.ptp(own, axis=0).max() < 1e-5
    assert np.abs(np.diff(made.qpos[:, :3], axis=0)).max() < 0.03  # at most 0.9 m/s
    judged = check_motion(made, robot)
    assert judged.feasible, judged.reason


def test_an_overlay_and_a_tempo_move_the_com_for_the_steps(
    robot: Robot, synthesis: Synthesis, clips: dict[str, Clip]
) -> None:
    """An arm held out is borne by a CoM that goes elsewhere, over the same steps."""
    clip, _ = synthesis.make(parse("(ahead | swing on left_arm) @ 0.8"))
    made = robot_clip_of(clip, robot, "made")
    assert made.duration == pytest.approx(clips["ahead"].duration / 0.8, abs=0.1)
    assert made.planted is not None
    own = robot_qpos(clips["ahead"], robot)
    assert np.abs(own[:, 7:].max(axis=0) - made.qpos[:, 7:].max(axis=0)).max() > 0.2
    judged = check_motion(made, robot)
    assert judged.feasible, judged.reason


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ahead[0:1.6]", "line 1, column 6: cuts a step: both soles must be planted there"),
        ("ahead[0:2.1] -> swing", r"nothing can follow 'ahead \[0:2.1\]': at 2.10 s of .* the feet "
                                  r"are \d.\d cm and 0° from how they stand"),
        ("swing -> ahead[2.1:4.3]", r"nothing can lead to 'ahead \[2.1:4.3\]': at 0.00 s of .*"),
        ("ahead ->{insert, 0.4} swing", "column 7: 'ahead' has steps: only physical joins it"),
        ("ahead -> jump", r"no motion 'jump' \(choices: swing, ahead, kick\)"),
        ("ahead @ 9", "column 7: "),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_refused_in_one_line(
    text: str, said: str, synthesis: Synthesis
) -> None:
    with pytest.raises(ConfigError, match=said) as caught:
        synthesis.plan(parse(text))
    assert "\n" not in str(caught.value)


def test_other_kinds_know_no_steps(robot: Robot, clips: dict[str, Clip]) -> None:
    with pytest.raises(ConfigError, match="'ahead' has steps, which insert does not support"):
        of_kind(robot, clips, "insert").plan(parse("ahead -> swing"))
    bent = replace(clips["ahead"], rotations=clips["ahead"].rotations.copy())
    bent = bent.cut(0.0, 2.1)
    with pytest.raises(ConfigError, match="steps: does not end standing"):
        robot_clip_of(bent, robot, "bent")
