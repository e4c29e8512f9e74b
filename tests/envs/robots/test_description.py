"""Robot descriptions are checked strictly."""

from __future__ import annotations

from typing import Any

import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.robots.description import RobotDescription, match_names

GOOD: dict[str, Any] = {
    "name": "biped",
    "source": {"mjcf": "biped.xml"},
    "root": "trunk",
    "feet": [{"name": "left", "body": "l"}, {"name": "right", "body": "r"}],
}


def test_defaults() -> None:
    """Name, source, root and feet suffice; what is built can be written and built again."""
    description = build(RobotDescription, GOOD, "test")
    assert description.forward == (1, 0, 0) and description.options.timestep == 0.002
    assert build(RobotDescription, to_dict(description), "test") == description


WRONG = {
    "no source": ({"source": {}}, "source: give exactly one"),
    "two sources": ({"source": {"mjcf": "a", "builder": "humanoid"}}, "source: give exactly one"),
    "one foot": ({"feet": GOOD["feet"][:1]}, "feet: a biped has two feet, 1 given"),
    "three feet": ({"feet": [*GOOD["feet"], {"name": "x", "body": "x"}]}, "feet: .*3 given"),
    "same name": ({"feet": [{"name": "f", "body": b} for b in "lr"]}, "feet: names"),
    "ground": ({"feet": [{"name": n, "body": n} for n in ("ground", "r")]}, "feet: names"),
    "same body": ({"feet": [{"name": n, "body": "l"} for n in "lr"]}, "feet: both"),
    "timestep": ({"options": {"timestep": 0.1}}, "options.timestep"),
    "tiny timestep": ({"options": {"timestep": 1e-6}}, "options.timestep: .*at least 0.0001"),
    "integrator": ({"options": {"integrator": "RK4"}}, "options.integrator.*implicitfast"),
    "negative limit": ({"torque_limits": {"a": -1}}, r"torque_limits\.a"),
    "huge limit": ({"torque_limits": {"*": 1e300}}, r"torque_limits\.\*: .*at most"),
    "forward": ({"forward": [1, 0]}, "forward"),
    "joint value": ({"posture": {"joints": {"a": "bent"}}}, r"posture\.joints\.a"),
    "foot field": ({"feet": [{"nmae": "l"}, {}]}, r"feet\[0\]\.nmae"),
}


@pytest.mark.parametrize(("change", "pattern"), WRONG.values(), ids=WRONG)
def test_wrong_fields(change: dict[str, Any], pattern: str) -> None:
    """Each wrong field is named in one line that begins with the file."""
    with pytest.raises(ConfigError, match=f"^test: {pattern}"):
        build(RobotDescription, GOOD | change, "test")


def test_match_names() -> None:
    """An exact name wins over a pattern, an earlier pattern over a later one."""
    names = ["left_knee", "right_knee", "waist"]
    patterns = {"*_knee": 1, "*": 2, "right_knee": 3}
    found = match_names(patterns, names, "test", "field")
    assert found == {"left_knee": 1, "right_knee": 3, "waist": 2}
    with pytest.raises(ConfigError, match=r"test: field: .*'\*_hip'.*left_knee, right_knee, waist"):
        match_names({"*_hip": 1}, names, "test", "field")
