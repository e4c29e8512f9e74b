"""training/motion/following/tracked.py: an external policy follows a clip."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError
from poise.training.cli.entry import main
from poise.training.motion.following.follow import follow
from poise.training.motion.following.tracked import follow_clip, following, tracker_config
from tests.support.policies import helper, linear, write_graph, write_onnx, write_yaml
from tests.support.shared import robot

BODY = robot("compact")
N = len(BODY.joint_names)


def tracker(place: Path, **changes: Any) -> str:
    """Servos that go where the clip has the joints, one step ahead."""
    nodes = [helper.make_node("Identity", ["obs"], ["actions"])]
    write_graph(place / "policy.onnx", nodes, {}, [("obs", [1, N], 1)], [("actions", [1, N], 1)])
    fields: dict[str, Any] = {
        "kind": "policy-file", "policy": "policy.onnx", "joints": list(BODY.joint_names),
        "default": [float(q) for q in BODY.standing_qpos[7:]], "action_scale": 1.0,
        "stiffness": {"*hip*": 400.0, "*knee*": 400.0, "*ankle*": 400.0, "*": 60.0},
        "damping": 10.0, "observations": [{"term": "motion_joint_pos_rel", "ahead": [1]}],
    }  # fmt: skip
    return str(write_yaml(place / "tracker.yaml", **{**fields, **changes}))


def waving(path: Path, seconds: float = 1.0) -> Path:
    """A clip in which the shoulders swing and all else stands, elsewhere and turned by 90°."""
    t = np.arange(round(50 * seconds) + 1)[:, None] / 50.0
    q = np.tile(BODY.standing_qpos[7:], (len(t), 1))
    arms = [name.endswith("shoulder_pitch") for name in BODY.joint_names]
    q[:, arms] += 0.3 * (1.0 - np.cos(2.0 * np.pi * t))
    root = np.tile([3.0, 1.0, BODY.standing_qpos[2]], (len(t), 1))
    turn = np.tile([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], (len(t), 1))
    np.savetxt(path, np.hstack([root, turn, q]), delimiter=",")
    return path


def test_a_tracker_is_told_from_other_controllers(tmp_path: Path) -> None:
    """By what it sees; an external policy that sees no motion is refused."""
    assert tracker_config(tracker(tmp_path)) is not None
    assert tracker_config("motion-step") is None
    write_onnx(tmp_path / "other.onnx", linear(3, N))
    other = write_yaml(tmp_path / "other.yaml", kind="policy-file", policy="other.onnx",
                       observations=[{"term": "base_ang_vel"}])  # fmt: skip
    with pytest.raises(ConfigError, match="other.yaml' follows no motion"):
        tracker_config(str(other))
    with pytest.raises(ConfigError, match="other.yaml' follows no motion"):
        follow("standing", str(other), robot=BODY, starts=1)


def test_it_follows_a_clip(tmp_path: Path) -> None:
    """From each start within a degree; the same seed gives the same, pushed it may fall."""
    config = tracker_config(tracker(tmp_path, motion={"rate": 50.0}))
    assert config is not None
    config = following(config, waving(tmp_path / "clip.csv"))
    first, again = (follow_clip(config, BODY, starts=2, seed=3) for _ in range(2))
    assert str(first) == str(again)
    for trial in first:
        assert not trial.fallen and trial.joint_rms < np.radians(4.0)
        assert trial.body_error_root < 0.05 and trial.push is None
    times: dict[int, list[float]] = {}
    watched = follow_clip(
        config, BODY, starts=2, seed=3,
        watch=lambda trial: lambda env: times.setdefault(trial.number, []).append(
            env.simulation.time),
    )  # fmt: skip
    assert str(watched) == str(first)
    for seen in times.values():  # the reset and each step, until 3 s after the clip
        assert seen[0] == 0.0 and seen[-1] == pytest.approx(4.0) and np.all(np.diff(seen) > 0.0)
    assert list(times) == [0, 1]
    hit = follow_clip(config, BODY, starts=1, pushed=lambda direction: 60.0)
    assert hit[0].fallen and hit[0].push is not None and hit[0].push["impulse"] == 60.0


def test_it_follows_a_clip_in_another_engine(tmp_path: Path) -> None:
    """Whose contact is softer: servos alone, which see no lean, may fall there."""
    pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")
    config = tracker_config(tracker(tmp_path, motion={"rate": 50.0}))
    assert config is not None
    config = following(config, waving(tmp_path / "clip.csv"))
    (own,), (other,) = (
        follow_clip(config, BODY, starts=1, seed=3, physics=engine) for engine in (None, "drake")
    )
    assert other.joint_rms < np.radians(4.0) and other.joint_rms != own.joint_rms


def test_its_clip_is_held_where_nothing_plays_it(tmp_path: Path) -> None:
    """In an environment of pushes the first frame stands; the robot's arms do, too."""
    waving(tmp_path / "clip.csv")
    path = tracker(tmp_path, motion={"clip": "clip.csv", "rate": 50.0})
    env = ResidualBalanceEnv(BODY, controller=path, pushes=None, duration=5.0)
    env.reset(seed=0, options={"push": []})
    rest = np.zeros(len(env.action_names))
    for _ in range(50):
        env.step_without_info(rest)
    assert not env.fallen
    np.testing.assert_allclose(env.simulation.data.qpos[7:], BODY.standing_qpos[7:], atol=0.15)


def test_the_command_follows_a_clip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a table of errors, and the trials as JSON."""
    clip, out = waving(tmp_path / "clip.csv"), tmp_path / "trials.json"
    args = [
        "motion",
        "follow",
        str(clip),
        "--controller",
        tracker(tmp_path, motion={"rate": 50.0}),
        "--robot",
        "compact",
    ]
    assert main([*args, "--starts", "1", "--seed", "3", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "0 of 1 fell" in " ".join(said.out.split())
    assert said.err.startswith("trials 0/1") and " 1/1 " in said.err
    assert json.loads(out.read_text())[0]["fallen"] is False
    for more, message in (
        (["--tempo", "2"], "at the clip's own pace"),
        (["--push", "1", "--share", "0.5"], "either an impulse or a share"),
        (["--push", "-1"], "impulse: must be at least 0"),
        (["--starts", "0"], "starts: must be"),
    ):
        assert main([*args, *more]) == 2
        assert message in " ".join(capsys.readouterr().err.split())


def test_what_it_cannot_follow(tmp_path: Path) -> None:
    """A motion by name has no file; an anchor that the robot lacks."""
    config = tracker_config(tracker(tmp_path, motion={"anchor": "tail"}))
    assert config is not None
    with pytest.raises(ConfigError, match="motion: a tracker follows a file of a clip"):
        following(config, "squat")
    with pytest.raises(ConfigError, match="motion.anchor: 'compact' has no body 'tail' .choices"):
        follow_clip(following(config, waving(tmp_path / "clip.csv")), BODY, starts=1)
    with pytest.raises(ConfigError, match="motion.clip: no such file"):
        tracker_config(tracker(tmp_path, motion={"clip": "none.npz"}))
