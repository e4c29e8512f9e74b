"""What the YAML files of the controllers that step may say."""

import pytest

from poise.baselines.balance.stepping.planning import config
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError

CLASSES = [value for value in vars(config).values() if hasattr(value, "RENAMED")]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"again": 0.01}, "again: is now 'restep_margin'"),
        ({"home": {"far": 0.1}}, "home: is now 'recentring'"),
        ({"recentring": {"far": 0.1}}, "recentring.far: is now 'distance'"),
        ({"foothold": {"outward": 0.1}}, "foothold.outward: is now 'lateral_offset'"),
        ({"swing": {"yaw_share": 0.1}}, "swing.yaw_share: is now 'yaw_fraction'"),
        (
            {"feedback": {"outward": {"spin_ahead": 0.1}}},
            "feedback.outward.spin_ahead: is now 'momentum_ahead'",
        ),
    ],
)
def test_an_old_name_is_answered_with_the_new_one(change, said):
    with pytest.raises(ConfigError, match=f"^controller: {said}$"):
        controller_config({"kind": "ipm-step", **change})


def test_old_names_lead_to_fields_and_are_none():
    assert len(CLASSES) >= 6
    for each in CLASSES:
        fields = each.__dataclass_fields__
        assert set(each.RENAMED.values()) <= set(fields) and not set(each.RENAMED) & set(fields)
