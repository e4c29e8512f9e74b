"""Files of constraints: what is packaged is valid; a mistake is one line: file, field, choices."""

from pathlib import Path

import pytest

from poise.baselines.motion.space_time.constraints.constraint import (
    When,
    check_constraints,
    read_constraints,
)
from poise.baselines.motion.space_time.constraints.points import PointReach
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from tests.support.scenes import swaying

HEAD = "constraints:\n- "
REACH = "{kind: reach, point: hand_left, place: [0.1, null, 1.0]"


def test_what_a_file_says(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(f"{HEAD}{REACH}, period: {{at: 0.2}}, weight: 2}}\n")
    found = read_constraints(path)
    wanted = PointReach(point="hand_left", place=(0.1, None, 1.0), period=When(at=0.2), weight=2.0)
    assert found == (wanted,)
    check_constraints(found, swaying(), path)


@pytest.mark.parametrize("name", packaged("constraints"))
def test_packaged_files_are_valid(name: str) -> None:
    assert read_constraints(name)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("- 3\n", "a.yaml"),
        ("constraints: []\n", "must be 1 to 100 constraints, not 0"),
        (f"{HEAD}{{kind: grab}}\n", r"s\[0\].kind: no such kind: 'grab' \(choices: apart,"),
        (f"{HEAD}{{point: hand_left}}\n", r"s\[0\].kind: this field is missing \(choices"),
        (f"{HEAD}{{kind: reach, point: hand_left}}\n", r"s\[0\].place: .* is missing"),
        (f"{HEAD}{REACH}, perod: always}}\n", r"s\[0\].perod: unknown field.* mean period\?"),
        (f"{HEAD}{REACH}, period: never}}\n", r"s\[0\].period: .*\(choices: always, at, "),
        (f"{HEAD}{REACH}, period: {{when: 1}}}}\n", r"s\[0\].period.when: unknown field "
         r"\(choices: at, contact, phase\)"),
        (f"{HEAD}{REACH}, period: {{at: 1, phase: [0, 1]}}}}\n", "must have one of at, contact"),
        (f"{HEAD}{REACH}, period: {{contact: front}}}}\n", r"choices: left, right, both"),
        (f"{HEAD}{REACH}, weight: 0}}\n", r"s\[0\].weight: must be above 0"),
        (f"{HEAD}{{kind: reach, point: a, place: [null, null, null]}}\n", "must have a number"),
        (f"{HEAD}{{kind: height, point: pelvis}}\n", "needs least or most"),
        (f"{HEAD}{{kind: speed, point: a, least: 2, most: 1}}\n", "least 2 is above most 1"),
        (f"{HEAD}{{kind: reach, point: [}}\n", "line 2"),
    ],
)  # fmt: skip
def test_mistakes(text: str, error: str, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=error) as raised:
        read_constraints(path)
    assert str(raised.value).startswith(str(path)) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("{kind: height, point: nose, most: 1}", r"s\[0\].point: the robot 'humanoid' has "
         r"no 'nose' \(choices: com, hip_left"),
        ("{kind: touch, point: hand_left, body: hip}", r"s\[0\].body: .*\(choices: torso"),
        ("{kind: touch, point: pelvis, body: torso}", r"s\[0\].point: is not on one body"),
        (f"{REACH}, period: {{at: 9}}}}", r"s\[0\].period: has no frames: \[9, 9\] s"),
    ],
)  # fmt: skip
def test_what_robot_or_clip_lack(text: str, error: str, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(f"{HEAD}{text}\n")
    with pytest.raises(ConfigError, match=error) as raised:
        check_constraints(read_constraints(path), swaying(), path)
    assert str(raised.value).startswith(str(path))
