"""baselines/walking/schedule.py: commands that a caller writes, that are drawn, and when."""

import numpy as np
import pytest

from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import (
    MOST_COMMANDS,
    CommandSampler,
    Follower,
    TimedCommand,
    command_sampler,
    empty_timetable,
    follow_timetable,
    parse_commands,
)
from poise.envs.physics.clock import Clock
from tests.support.refused import invalid, refused


def test_one_command_or_a_list_of_them():
    """A mapping, a `GaitCommand` and a list say the same; what is left out is 0."""
    expected = (TimedCommand(0.5, 0.0, 0.1, 0.0),)
    assert parse_commands({"ahead": 0.5, "turn": 0.1}) == expected
    assert parse_commands(GaitCommand(0.5, turn=0.1)) == expected
    assert parse_commands([{"ahead": 0.5, "turn": 0.1, "start": 0}]) == expected
    assert parse_commands([]) == ()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ahead": float("nan")}, ("ahead",)),
        (
            {"speed": 1.0},
            ("speed", "ahead", "start"),
        ),
        ({"start": -1.0}, ("start", "0.0", "-1.0")),
        ([{}, {}], ("start",)),
        ("fast", (None, "'fast'")),
        ([3], (None, "3")),
        ([{"start": float(k)} for k in range(MOST_COMMANDS + 1)], (None, "256")),
    ],
)
def test_bad_commands(given, said):
    with invalid(*said):
        parse_commands(given)


def test_numbers_and_ranges_make_a_sampler():
    """A number is a range of no width; a `GaitCommand` is a fixed command."""
    assert command_sampler({"ahead": 0.4}) == CommandSampler((0.4, 0.4))
    assert command_sampler(GaitCommand(0.1, 0.2, 0.3)) == CommandSampler(
        (0.1, 0.1), (0.2, 0.2), (0.3, 0.3)
    )
    with invalid(None, source="command"):
        command_sampler({"ahead": [0.5, 0.2]})
    with invalid("command", "0.5"):
        command_sampler(0.5)
    with refused("unknown field", "step_time", source="command"):
        command_sampler(GaitCommand(0.1, step_time=0.4))  # which a sampler does not draw
    with refused("type", "interval", source="command", expected="a list", value="3"):
        command_sampler({"interval": 3})


def test_commands_are_drawn_from_the_ranges():
    """The first at the reset, the others an interval apart, none after the end; all within."""
    sampler = CommandSampler((0.2, 0.8), (-0.1, 0.1), (-0.3, 0.3), (2.0, 5.0))
    drawn = sampler.sample(np.random.default_rng(4), 60.0)
    assert drawn == sampler.sample(np.random.default_rng(4), 60.0)
    starts = np.array([command.start for command in drawn])
    assert starts[0] == 0.0 and starts[-1] < 60.0 and 12 <= len(drawn) <= 30
    assert np.all((np.diff(starts) >= 2.0) & (np.diff(starts) <= 5.0))
    values = np.array([command.array()[:3] for command in drawn])
    assert np.all(np.abs(values - [0.5, 0.0, 0.0]) <= [0.3, 0.1, 0.3])
    assert len(np.unique(values[:, 0])) == len(drawn)
    assert len(CommandSampler().sample(np.random.default_rng(4), 60.0)) == 1
    assert len(sampler.sample(np.random.default_rng(4), 1e6)) == MOST_COMMANDS


def test_a_fraction_of_the_commands_has_one_axis_alone():
    """Ahead, to the left or a turn, a third each; without it what is drawn stays as it was."""
    ranges = {"ahead": [0.2, 0.8], "left": [0.1, 0.2], "turn": [0.3, 0.4], "interval": [1.0, 1.0]}
    rng = np.random.default_rng(5)
    drawn = [command_sampler({**ranges, "alone": 0.6}).sample(rng, 200.5) for _ in range(16)]
    moves = np.array([each.array()[:3] != 0.0 for course in drawn for each in course])
    assert len(moves) == 3216 and set(moves.sum(axis=1)) == {1, 3}
    assert np.mean(moves.sum(axis=1) == 1) == pytest.approx(0.6, abs=0.035)
    np.testing.assert_allclose(moves[moves.sum(axis=1) == 1].mean(axis=0), 1.0 / 3.0, atol=0.045)
    plain, none = (command_sampler({**ranges, **own}).sample(np.random.default_rng(1), 9.0)
                   for own in ({}, {"alone": 0.0}))  # fmt: skip
    assert plain == none


def test_a_fraction_of_the_commands_is_to_stand():
    rng = np.random.default_rng(4)
    sampler = command_sampler({"ahead": [0.2, 0.8], "interval": [2.0, 5.0], "stand": 0.3})
    ahead = [command.ahead for command in sampler.sample(rng, 1e6)]
    assert 0.2 < ahead.count(0.0) / len(ahead) < 0.4
    assert all(value == 0.0 or 0.2 <= value <= 0.8 for value in ahead)
    always = command_sampler({"ahead": 0.5, "turn": 0.2, "stand": 1.0}).sample(rng, 9.0)
    assert always == (TimedCommand(),)
    with refused("range", "stand", source="command", most=1.0):
        command_sampler({"stand": 1.5})


def test_a_command_comes_at_its_time():
    """The latest whose time has come; an empty timetable leaves what was set by hand."""
    clock, command = Clock(0), np.zeros(3)
    table = empty_timetable()
    follower = Follower(table, clock, 0.002, command)
    command[:] = 7.0
    follow_timetable(follower)
    assert command[0] == 7.0
    table.fill([TimedCommand(0.1), TimedCommand(0.2, start=0.5), TimedCommand(0.3, start=0.502)])
    seen = []
    for clock.steps in (0, 249, 250, 251, 400):
        follow_timetable(follower)
        seen.append(command[0])
    assert seen == [0.1, 0.1, 0.2, 0.3, 0.3]
    command[:] = 9.0
    follow_timetable(follower)  # each is told once
    assert command[0] == 9.0
