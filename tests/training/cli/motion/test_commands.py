"""`poise motion`: files in and out, and errors as one line with exit code 2."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import read_robot_clip, write_robot_clip
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.training.cli.entry import main
from tests.support.motion_files import small_bvh
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip, packaged_clip


def test_info_convert_and_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["motion", "info", "humanoid_squat"]) == 0
    assert "20, 15 of them with a role" in capsys.readouterr().out
    part, squat, back = (tmp_path / name for name in ("part.bvh", "squat.npz", "robot.bvh"))
    cut = ["--cut", "1.0", "2.0", "--mirror", "--speed", "2"]
    assert main(["motion", "convert", "humanoid_squat", str(part), *cut]) == 0
    assert read_bvh(part).clip.duration == pytest.approx(0.5, abs=0.04)
    assert main(["motion", "import", str(part), "--out", str(squat), "--robot", "compact"]) == 0
    printed = capsys.readouterr().out
    assert "over joint limits" in printed and "e-" not in printed  # rounding errors are 0
    command = f"poise motion follow {squat} --robot compact --controller momentum-qp"
    assert f"perform it: {command}\n{squat}\n" in printed
    assert main(["motion", "convert", str(squat), str(back), "--robot", "compact"]) == 0
    robot_clip = read_robot_clip(squat)
    robot = read_bvh(back, "m", "y", "z").clip
    assert np.abs(robot.root - robot_clip.qpos[:, :3]).max() < 1e-6


def test_constraints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are met by the whole clip's solver, which is the default then; single frames only say
    how much is missing."""
    file, out = tmp_path / "pelvis.yaml", tmp_path / "out.npz"
    file.write_text("constraints:\n- {kind: height, point: pelvis, most: 0.7, period: {at: 0.2}}\n")
    words = ["motion", "import", "humanoid_punch", "--out", str(out), "--cut", "1.2", "1.7"]
    words += ["--lead", "0.3", "--constraints", str(file)]
    assert main([*words, "--solver", "frame"]) == 0
    printed = capsys.readouterr().out
    assert "by frame" in printed and "constraints, 1 of 1 violated" in printed
    assert "skating, mean and largest" in printed and "hands off their places" in printed
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "by spacetime" in printed and "constraints, 0 of 1 violated" in printed
    assert "program 1: tasks " in printed
    assert read_robot_clip(out).qpos[9 + 6, 2] < read_robot_clip(out).qpos[0, 2] - 0.03


def test_join(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """T₁ + D + T₂; without a duration that of the least coefficient."""
    out, lengths = tmp_path / "both.bvh", []
    both = ["motion", "join", "humanoid_punch", "humanoid_squat", str(out)]
    for duration in (["--duration", "0.8"], []):
        assert main([*both, *duration]) == 0
        lengths.append(read_bvh(out, "m", "y", "z").clip.duration)
    parts = [read_bvh(find_bvh(name)).clip.duration for name in both[2:4]]
    assert lengths[0] == pytest.approx(sum(parts) + 0.8, abs=0.02)
    assert sum(parts) + 0.2 <= lengths[1] + 1e-3 and lengths[1] != lengths[0]
    printed = capsys.readouterr().out.split("coefficient ")
    assert float(printed[2].split()[0]) < float(printed[1].split()[0])


def test_check_and_physical_join(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0 for what the robot can do, 1 for what it cannot; what is fitted can be done."""
    robot = robot_named("humanoid")
    squat, hasty, fitted, both = (tmp_path / f"{name}.npz" for name in ("a", "b", "c", "d"))
    clip = packaged_clip(robot, "squat")
    write_robot_clip(clip, squat)
    write_robot_clip(replace(clip, dt=clip.dt / 7.0), hasty)
    assert main(["motion", "check", str(squat)]) == 0
    assert main(["motion", "check", str(hasty), "--qp"]) == 1
    printed = capsys.readouterr().out
    assert "ZMP inside the soles by" in printed and "gap of the QP" in printed
    assert main(["motion", "check", str(hasty), "--fit", "--out", str(fitted)]) == 0
    assert "tempo 0." in capsys.readouterr().out
    assert main(["motion", "check", str(fitted)]) == 0
    joined = ["motion", "join", str(squat), str(squat), str(both), "--kind", "physical"]
    assert main([*joined, "--leave", "0.8", "--enter", "0.4"]) == 0
    assert "physical, 0." in capsys.readouterr().out
    assert read_robot_clip(both).duration < 2.0 * clip.duration


def test_steps_are_joined_and_put_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By hand and by a script of a graph; what is cut in a step is one line."""
    monkeypatch.chdir(tmp_path)
    robot = robot_named("humanoid")
    write_robot_clip(ahead_clip(robot), "ahead.npz")
    write_robot_clip(packaged_clip(robot, "arm_swing"), "swing.npz")
    joined = ["motion", "join", "ahead.npz", "swing.npz", "both.npz", "--kind", "physical"]
    assert main([*joined, "--leave", "3.8"]) == 0
    planted = read_robot_clip("both.npz").planted
    assert planted is not None and (~planted).sum() == (~ahead_clip(robot).planted).sum()
    assert main([*joined, "--leave", "1.6"]) == 2
    assert "leave: at 1.60 s a foot swings" in capsys.readouterr().err
    of_robot = ["--robot", "humanoid"]
    assert main(["motion", "graph", "ahead.npz", "swing.npz", "--out", "g.yaml", *of_robot]) == 0
    synth = ["motion", "synth", "swing -> ahead", "--graph", "g.yaml", "--out", "made.npz"]
    assert main([*synth, *of_robot]) == 0
    made = read_robot_clip("made.npz").planted
    assert made is not None and (~made).sum() == (~ahead_clip(robot).planted).sum()
    monkeypatch.setattr("poise.training.motion.following.scripts.packaged_clips", list)
    by_path = ["motion", "synth", 'step_in_place -> "ahead.npz"', "--out", "path.npz", *of_robot]
    assert main(by_path) == 0 and read_robot_clip("path.npz").planted is not None
    assert main(["motion", "graph", "ahead.npz", "humanoid_stand", "--out", "g.yaml"]) == 2
    assert "say which robot's (--robot)" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ["jump"],
            "no such command: motion 'jump' (choices: info, convert, import, follow, join, check,",
        ),
        (["info", "nothing"], "clip: no such name: 'nothing'; give a path to a .bvh file, a"),
        (["info", "nothing.bvh"], "clip: no such file: 'nothing.bvh'"),
        (["follow", "squat ->"], 'script: line 1, column 9: after "->" a motion is missing'),
        (["follow", "stand -> jump"], "script: line 1, column 10: no motion 'jump' (choices:"),
        (
            ["follow", "other.bvh", "--robot", "compact"],
            "other.bvh: motion: is motion capture: import it first, by poise motion import "
            "other.bvh --robot compact --out FILE.npz",
        ),
        (["check", "other.bvh"], "other.bvh: motion: is motion capture: import it first"),
        (
            ["follow", "squat", "--robot", "compact", "--share", "0.5"],
            "share: no J50 of 'compact' was measured: give --push N [N·s] instead (choices: ",
        ),
        (
            ["follow", "kick"],
            "motion: the feet of 'kick' leave the ground, which momentum-qp cannot",
        ),
        (["check", "kick", "--qp"], "kick: qp: is not for motions with steps"),
        (
            ["import", "humanoid_stand", "--out", "x.npz", "--constraints", "nothing"],
            "constraints: no such name: 'nothing'; give a path to a .yaml file or a packaged name "
            "(choices: hand_on_hip, low_punch)",
        ),
        (["convert", "humanoid_stand", "x.txt"], "x.txt: must be the name of a .bvh file"),
        (["join", "humanoid_punch", "other.bvh", "x.bvh"], "has another skeleton than"),
        (
            ["join", "a.npz", "b.npz", "c.npz", "--kind", "physical", "--duration", "1"],
            "duration: a physical join lasts as long as the robot needs",
        ),
        (
            ["join", "humanoid_punch", "humanoid_squat", "x.bvh", "--enter", "1"],
            "enter: is for physical",
        ),
        (["check", "squat", "--fit"], "out: --fit and --out go together"),
        (["check", "squat", "--fit", "--out", "x.npz"], "squat: fit: only a .npz of poise motion"),
        (["check", "squat", "--qp", "--controller", "pd"], "controller: 'pd' is of kind"),
        (["follow", "bow", "--physics", "bullet"], "physics: no such name: 'bullet'"),
        (["follow", "bow", "--physics", "mujoco", "--fastest"], "fastest: goes with --controller,"),
        (["follow", "nothing.npz"], "nothing.npz: cannot be read (No such file or directory)"),
    ],
)
def test_errors_are_one_line_and_exit_code_2(
    arguments: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    packaged = "poise.training.motion.following.scripts.packaged_clips"
    monkeypatch.setattr(packaged, lambda: ["humanoid_stand"])  # or all are retargeted: seconds
    (tmp_path / "other.bvh").write_text(small_bvh())
    assert main(["motion", *arguments]) == 2
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1


def test_a_wrong_line_of_a_file_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrong.bvh"
    path.write_text(small_bvh().replace("Frames: 12", "Frames: 11"))
    assert main(["motion", "info", str(path)]) == 2
    assert "line 59: the file ends after 12 rows, 'Frames:' says 11" in capsys.readouterr().err
