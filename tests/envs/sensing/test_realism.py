"""envs/sensing/realism.py: levels from names, files and mappings."""

from dataclasses import replace

import pytest

from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.sensing.estimator import check_latency
from poise.envs.sensing.realism import Realism, load_realism, overlaid
from tests.support.refused import invalid


def test_levels_by_name_file_and_mapping(tmp_path):
    """A base gives the fields that are not given; nothing at all is ideal."""
    assert set(packaged("realism")) == {
        *("ideal", "lab", "field", "late", "late-underrated", "late-overrated"),
        *("arms", "hand-load"),
    }
    assert load_realism(None) == load_realism("ideal") == Realism() and Realism().ideal
    lab = load_realism("lab")
    assert lab.name == "lab" and not lab.ideal and load_realism(lab) is lab
    path = tmp_path / "mine.yaml"
    path.write_text("base: lab\nlatency: {sense: 0.02}\n")
    mine = load_realism(path)
    assert mine.name == "mine" and mine.latency.sense == 0.02
    assert mine.latency.command == lab.latency.command and mine.sensors == lab.sensors
    same = load_realism({"base": "lab", "latency": {"sense": 0.02}})
    assert same.name == "lab, changed" and same.latency == mine.latency
    alone = load_realism({"latency": {"sense": [0.0, 0.02]}})
    assert alone.name == "custom" and alone.latency.sense == (0.0, 0.02)
    assert alone.sensors == Realism().sensors


def test_fields_are_laid_over_a_level():
    lab = load_realism("lab")
    other = overlaid(lab, {"ground": {"slope": 3.0}, "motors": {"lag": 0.0}}, "here")
    assert other.ground.slope == 3.0 and other.motors.lag == 0.0
    assert other.ground.friction == lab.ground.friction and other.sensors == lab.sensors


def test_joined_levels_are_one(tmp_path):
    """The later one has the last word on the fields that it has; a plus may be in a file's name."""
    both = load_realism("field+arms")
    field, arms = load_realism("field"), load_realism("arms")
    assert both == replace(
        field, name="field+arms", motors=replace(field.motors, arms=arms.motors.arms)
    )
    odd = tmp_path / "a+b.yaml"
    odd.write_text("latency: {sense: 0.05}")
    assert load_realism(str(odd)).latency.sense == 0.05
    later = tmp_path / "later.yaml"
    later.write_text("latency: {sense: 0.001}")
    assert load_realism(f"late+{later}").latency.sense == 0.001
    assert load_realism(f"{later}+late").latency.sense == 0.02
    for wrong in ("field+arm", "+field", "field+"):
        with invalid("realism"):
            load_realism(wrong)


def test_a_level_is_scaled():
    """Half of every number; what the robot has of its own stays; none is ideal."""
    field = load_realism("field")
    half = field.scaled(0.5)
    assert half.sensors.gyro_noise == 0.5 * field.sensors.gyro_noise
    assert half.latency.sense == (0.002, 0.005) and half.ground.slope == (0.0, 1.0)
    assert half.ground.friction == field.ground.friction
    assert field.scaled(0.0).ideal and field.scaled(1.0) == field


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("moon", ("realism", "'moon'", "field", "ideal", "lab")),
        ({"latency": {"sense": [0.01, 0.0]}}, ("latency", "0.01", "0")),
        ({"latency": {"sens": 0.01}}, ("latency.sens", "sense")),
        ({"wind": 3.0}, ("wind", "latency")),
        ({"sensors": {"gyro_noise": -1.0}}, ("sensors.gyro_noise",)),
        ({"sensors": {"gyro_noise": "much"}}, ("sensors.gyro_noise",)),
        ({"base": "moon"}, ("realism", "'moon'")),
        (7, ("realism", "7")),
    ],
)
def test_what_is_wrong_is_named(given, message):
    with invalid(*message) as error:
        load_realism(given)
    assert "\n" not in str(error.value)


def test_more_delay_than_can_be_led_on_is_refused():
    """62 physics steps together, by the upper ends of ranges."""
    level = load_realism(
        {"latency": {"sense": [0.0, 0.05], "command": 0.05}, "motors": {"lag": 0.03}}
    )
    with pytest.raises(ConfigError, match=r"latency: .* at most 0.124 s: .*motors.lag 0.03"):
        check_latency(level, 0.002)
    check_latency(level, 0.003)
