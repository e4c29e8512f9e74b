"""What the YAML files of the controllers that step may say."""

import pytest

from poise.baselines.balance.stepping.planning import config
from poise.baselines.registry import controller_config
from tests.support.refused import refused

CLASSES = [value for value in vars(config).values() if hasattr(value, "RENAMED")]


@pytest.mark.parametrize(
    ("change", "field", "name"),
    [
        ({"again": 0.01}, "again", "restep_margin"),
        ({"home": {"far": 0.1}}, "home", "recentring"),
        ({"recentring": {"far": 0.1}}, "recentring.far", "distance"),
        ({"foothold": {"outward": 0.1}}, "foothold.outward", "lateral_offset"),
        ({"swing": {"yaw_share": 0.1}}, "swing.yaw_share", "yaw_fraction"),
        (
            {"feedback": {"outward": {"spin_ahead": 0.1}}},
            "feedback.outward.spin_ahead",
            "momentum_ahead",
        ),
    ],
)
def test_an_old_name_is_answered_with_the_new_one(change, field, name):
    with refused("renamed", field, source="controller", name=repr(name)):
        controller_config({"kind": "ipm-step", **change})


def test_old_names_lead_to_fields_and_are_none():
    assert len(CLASSES) >= 6
    for each in CLASSES:
        fields = each.__dataclass_fields__
        assert set(each.RENAMED.values()) <= set(fields) and not set(each.RENAMED) & set(fields)
