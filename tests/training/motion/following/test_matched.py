"""Motion matching from the command line: commands as text, what is reached and what refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.training.cli.entry import main
from poise.training.motion.following.matched import parse_timed_commands
from tests.support.captured import captured

TWO = ["humanoid_punch", "humanoid_walk"]


def test_commands_hold_from_their_time_on() -> None:
    asked = parse_timed_commands(["1:1.2,0,0.5", "3:0.8"])
    assert asked(0.5) == (0.0, 0.0, 0.0)
    assert asked(1.0) == (1.2, 0.0, 0.5) and asked(2.99).forward == 1.2
    assert asked(9.0) == (0.8, 0.0, 0.0)


def test_a_walk_that_is_asked_for_is_walked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It punches in place for two seconds and then goes forward about as fast as asked."""
    for name in ("cmu02_punch", "cmu02_walk"):
        captured(name)
    out = tmp_path / "walk.bvh"
    ask = ["--commands", "2:1.2", "--seconds", "5", "--out", str(out)]
    assert main(["motion", "match", "cmu02_punch", "cmu02_walk", *ask]) == 0
    assert "cmu02_walk" in capsys.readouterr().out
    made = read_bvh(out, "m", "y", "z").clip
    assert made.duration == pytest.approx(5.0, abs=0.1)
    place = made.root[:, :2]
    still, going = place[int(1.5 / made.dt)], place[[int(3.0 / made.dt), -1]]
    assert np.linalg.norm(still - place[0]) < 0.2
    speed = np.linalg.norm(going[1] - going[0]) / (made.duration - 3.0)
    assert 0.8 < speed < 1.5


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (["--commands", "x"], "commands: must be SECONDS:FORWARD,LEFT,TURN, not 'x'"),
        (["--commands", "0:1,2,3,4"], "commands: must be SECONDS:FORWARD,LEFT,TURN"),
        (["--commands", "0:nan"], "commands: must be at most 10 m/s or rad/s"),
        (["--commands", "0:11"], "commands: must be at most 10 m/s or rad/s"),
        (["--commands", "2:1", "1:1"], "commands: must begin after the one before it, not '1:1'"),
        (["--commands", "0:1", "--seconds", "0"], "seconds: must be from 0.1 to 120, not 0"),
        (["--commands", "0:1", "--start", "walk"], "start: must be CLIP@SECONDS, not 'walk'"),
        (
            ["--commands", "0:1", "--start", "humanoid_punch@9"],
            "before the end of 'humanoid_punch",
        ),
        (["--commands", "0:1", "--out", "x.npz"], "x.npz: must be the name of a .bvh file"),
    ],
)
def test_errors_are_one_line(
    more: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    out = [] if "--out" in more else ["--out", "x.bvh"]
    assert main(["motion", "match", "humanoid_punch", *more, *out]) == 2
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1 and not Path("x.bvh").exists()


def test_what_is_reached_and_what_is_beyond_the_clips_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "walk.bvh"), "--seconds", "9", "--start", "humanoid_stand@0"]
    assert main(["motion", "match", "--commands", "0:0", "1:0.5", "5:3", *out]) == 0
    text = " ".join(capsys.readouterr().out.split())
    (reached,) = re.findall(r"from 1 s: 0.50 m/s commanded, (\d\.\d\d) m/s", text)
    assert float(reached) == pytest.approx(0.5, rel=0.15)
    assert re.findall(r"3.00 m/s is beyond the clips, which have 1\.\d\d m/s", text)
    assert "0.50 m/s is beyond" not in text
