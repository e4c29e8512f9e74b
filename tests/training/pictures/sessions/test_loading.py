"""training/pictures/sessions/loading.py: pushes as they are typed."""

from __future__ import annotations

import pytest

from poise.configs.errors import ConfigError
from poise.envs.physics.pushes.push import Push
from poise.training.pictures.sessions.loading import read_pushes
from poise.training.pictures.sessions.walk import parse_push
from tests.support.shared import robot


@pytest.mark.parametrize(
    ("text", "push"),
    [
        ("20@90", Push("torso", 1.0, 0.1, 20.0, 90.0)),
        ("20@90@1.5", Push("torso", 1.5, 0.1, 20.0, 90.0)),
        ("{impulse: 20, direction: 90, body: pelvis, start: 2}",
         Push("pelvis", 2.0, 0.1, 20.0, 90.0)),
    ],
)  # fmt: skip
def test_a_push_is_typed_short_or_with_its_fields(text: str, push: Push) -> None:
    """The same for a session and, with fields, for a walk."""
    assert read_pushes(text, robot()) == [push]
    if "{" in text:
        assert parse_push(text, 6.0, 20.0, robot()) == push


@pytest.mark.parametrize("text", ["a@b", "20@90@soon", "20@999", "{impulse: 20, delta_v: 1}"])
def test_what_is_no_push_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        read_pushes(text, robot())
