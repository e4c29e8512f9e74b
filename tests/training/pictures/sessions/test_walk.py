"""`poise walk`: training/pictures/sessions/walk.py and training/cli/walk.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from poise.training.cli.entry import main
from poise.training.pictures.sessions.walk import play_walk


def test_a_walk_is_told_in_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """What was asked for, how far it is every 5 s, how it ended, its figures, its push."""
    args = "walk --speed 0.4 --turn 5 --duration 8 --push 2@90 --push-at 5.5".split()
    assert main(args) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "walk, humanoid: 0.4 m/s ahead, 0 left, 5 °/s for 8 s"
    assert told[1].startswith("   5.0 s  0.") and told[1].endswith(" m/s")
    starts = [
        "upright after 8 s",
        "the last two strides are as near to the command as those before the push",
        "speed: 0.",
        "steps: ",
        "cost of transport: ",
        "knee of the stance leg: ",
        "push: 2 N·s towards 90° at 5.5 s",
    ]
    for line, start in zip(told[2:], starts, strict=True):
        assert line.startswith(start)
    assert " of the stride" in told[-1]


def test_to_stand_is_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    """It has no strides of which anything could be said."""
    assert main("walk --speed 0 --duration 3".split()) == 0
    told = capsys.readouterr().out.splitlines()
    assert told == ["walk, humanoid: 0 m/s ahead, 0 left, 0 °/s for 3 s", "upright after 3 s",
                    "it is at rest"]  # fmt: skip


def test_a_fall_is_told(tmp_path: Path) -> None:
    """A push that nothing holds: when it fell; a video of it is written."""
    told: list[str] = []
    path = tmp_path / "walk.webp"
    outcome = play_walk(
        {"ahead": 0.3}, duration=4.0, push="90@90", push_at=0.5, video=path, say=told.append
    )
    assert outcome.fallen and f"fell after {outcome.fall_time:.1f} s" in told
    assert path.stat().st_size > 1000 and told[-1] == str(path)


def test_a_walk_over_stairs_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    args = ["walk", "--terrain", "{kind: stairs, count: 2}", "--duration", "4"]
    assert main(args) == 0
    told = capsys.readouterr().out.splitlines()
    assert "terrain: passed 2 of 2, touched edges 0 times" in told
    assert not any(line.startswith("the last two strides") for line in told)
    args = ["walk", "--terrain", "{kind: bumps, count: 9}", "--duration", "2"]
    assert main(args) == 0  # which have no order to be passed in
    assert re.search(r"^terrain: touched edges \d+ times$", capsys.readouterr().out, re.M)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("hills", "no such kind: 'hills'"),
        ("{kind: stairs", "terrain: is no YAML"),
        ("{kind: stairs, tread: 0.2}", "a tread of 0.2 m cannot be stepped: 'humanoid' needs"),
        ("{kind: stones, gap: 0.5}", "cannot be stepped: 'humanoid' steps at most"),
    ],
)
def test_a_terrain_that_cannot_be_walked_is_told_in_a_line(
    text: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["walk", "--terrain", text, "--duration", "2"]) == 2
    told = capsys.readouterr().err.strip()
    assert says in told and "\n" not in told
