"""training/pictures/sessions/spec.py: a command line and a link that show the same again."""

from __future__ import annotations

import shlex
from urllib.parse import urlsplit

import pytest

from poise.configs.errors import ConfigError
from poise.training.pictures.sessions.spec import SessionSpec, TrialSpec, choices, read_link
from tests.support.refused import invalid

PUSH = "{impulse: 12.0, direction: -70.0, body: torso, start: 0.02, point: [0.1, 0.0, -0.25]}"
FULL = SessionSpec(
    ("walk", "residual-torque"), "tall", "squat", 7, (PUSH, PUSH), ("{ahead: 0.5, start: 1.5}",)
)
PLAIN = SessionSpec(("zero",))
TRIAL = TrialSpec("out/a b", 17, ('a "soft" <b>&.yaml', "zero"))


@pytest.mark.parametrize("spec", [FULL, PLAIN])
def test_a_link_says_all_of_it(spec: SessionSpec) -> None:
    """Whatever is shown when it is opened."""
    query = urlsplit(spec.link).query
    for now in (PLAIN, FULL):
        assert read_link(query, now, choices(now).all) == spec


def test_a_link_to_a_trial_says_which() -> None:
    """Of the folder that is shown: a link opens no other."""
    query = urlsplit(TRIAL.link).query
    assert read_link(query, TrialSpec("out/a b", 2, ("zero",)), ()) == TRIAL
    other = read_link("trial=4&folder=/etc", TRIAL, ())
    assert other == TrialSpec("out/a b", 4, TRIAL.controllers)


def test_a_command_line_says_all_of_it() -> None:
    assert shlex.split(FULL.command) == [
        *("poise", "view", "walk", "residual-torque", "--robot", "tall", "--motion", "squat"),
        *("--seed", "7", "--push", PUSH, "--push", PUSH, "--command", "{ahead: 0.5, start: 1.5}"),
    ]
    assert shlex.split(PLAIN.command) == ["poise", "view", "zero", "--robot", "humanoid",
                                          "--seed", "0"]  # fmt: skip
    assert shlex.split(TRIAL.command)[2:] == ["out/a b", "--trial", "17", "--controllers",
                                              *TRIAL.controllers]  # fmt: skip


@pytest.mark.parametrize("query", ["", "x=1", "websocket=ws://elsewhere"])
def test_other_addresses_ask_for_nothing(query: str) -> None:
    assert read_link(query, FULL, ()) is None and read_link(query, TRIAL, ()) is None


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("controller=os:system", "may name what is packaged alone, not 'os:system'"),
        ("controller=zero&robot=../r.yaml", "not '../r.yaml'"),
        ("controller=zero&motion=a.npz", "not 'a.npz'"),
        ("controller=zero&seed=-1", "seed: must be a whole number, not '-1'"),
        ("seed=99999999999999999999", "seed: must be a whole number"),
        ("&".join(["controller=zero"] * 4), "controller: at most 3 side by side, not 4"),
    ],
)
def test_what_a_link_may_not_ask_for(query: str, message: str) -> None:
    with pytest.raises(ConfigError) as raised:
        read_link(query, PLAIN, choices(PLAIN).all)
    assert message in str(raised.value)


def test_a_trial_s_number_is_one() -> None:
    with invalid("trial", "'x'"):
        read_link("trial=x", TRIAL, ())


def test_what_the_user_has_named_may_be_chosen() -> None:
    """And what is packaged, each once."""
    named = SessionSpec(("my.yaml", "zero"), "robot.yaml", "wave.npz")
    found = choices(named)
    assert {"my.yaml", "zero", "walk"} <= set(found.controllers)
    assert {"robot.yaml", "humanoid"} <= set(found.robots)
    assert {"wave.npz", "squat", "standing"} <= set(found.motions)
    assert len(set(found.all)) == len(found.all)
