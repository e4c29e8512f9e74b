"""Roots that do not float, and other moving parts, get the advice that mends them."""

from __future__ import annotations

from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from tests.support.refused import invalid
from tests.support.small_biped import write_biped

SLIDES = "".join(f'<joint name="t{a}" type="slide" axis="{x}"/>' for a, x in zip(
    "xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True))  # fmt: skip
HINGES = SLIDES.replace("slide", "hinge").replace('name="t', 'name="r')
BALL = '<body name="ball" pos="2 0 1"><freejoint name="rolls"/><geom size="0.1"/></body>'
DOOR = '<body name="door" pos="2 0 1"><joint name="swings"/><geom size="0.1"/></body>'

ADVICE = {
    "slides and hinges": (
        {"root_joint": SLIDES + HINGES},
        "root: the root 'trunk' is moved by the slide joint 'tx', the slide joint 'ty', the slide "
        "joint 'tz', the hinge joint 'rx', the hinge joint 'ry', the hinge joint 'rz': replace "
        "them by a free joint, <freejoint/>, of the body 'trunk'",
    ),
    "fixed": ({"root_joint": ""}, "nothing moves the root 'trunk', it is fixed to the world: give"),
    "a ball before": (
        {"world": BALL},
        "other than the robot 'trunk': 'ball' (the free joint 'rolls')",
    ),
    "a door before": (
        {"world": DOOR},
        "other than the robot 'trunk': 'door' (the hinge joint 'swings')",
    ),
}


@pytest.mark.parametrize(("change", "text"), ADVICE.values(), ids=ADVICE)
def test_the_line_says_what_mends_it(tmp_path: Path, change: dict, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_robot(write_biped(tmp_path, **change))
    assert text in str(caught.value)


@pytest.mark.parametrize("thing", [BALL, DOOR])
def test_a_second_tree_after_the_robot(tmp_path: Path, thing: str) -> None:
    path = write_biped(tmp_path)
    model = path.with_suffix(".xml")
    model.write_text(model.read_text().replace("</worldbody>", f"{thing}</worldbody>"))
    with invalid("root", "'trunk'"):
        load_robot(path)


def test_a_robot_on_a_dummy(tmp_path: Path) -> None:
    """The body that floats is named; so is what moves a dummy that does not float."""
    path = write_biped(tmp_path, root_joint="")
    model, plain = path.with_suffix(".xml"), path.with_suffix(".xml").read_text()
    for joint, text in (
        ("<freejoint/>", "which is 'dummy', not 'trunk' on it (choices: dummy)"),
        (SLIDES, "replace them by a free joint, <freejoint/>, of the body 'dummy'"),
    ):
        opened = plain.replace(
            '<body name="trunk"', f'<body name="dummy">{joint}<body name="trunk"'
        )
        model.write_text(opened.replace("</worldbody>", "</body></worldbody>"))
        with pytest.raises(ConfigError) as caught:
            load_robot(path)
        assert text in str(caught.value)
