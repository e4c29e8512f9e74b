"""baselines/policy_files/bounds.py: bounds in the forms that other projects write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from poise.baselines.policy_files.bounds import pairs, with_pairs
from poise.baselines.policy_files.deploy import deploy_fields
from poise.baselines.policy_files.reading import policy_file_config
from poise.configs.errors import ConfigError
from tests.support.policies import lab_deploy, linear, write_onnx

WIDE = [[-100.0, 100.0]]


@pytest.mark.parametrize(
    ("said", "read"),
    [
        ([-100.0, 100.0], WIDE),
        ((-100.0, 100.0), [(-100.0, 100.0)]),
        (100.0, WIDE),
        (WIDE, WIDE),
        ([[-1.0, 1.0], [-2.0, 2.0]], [[-1.0, 1.0], [-2.0, 2.0]]),
        ([], []),
        (None, None),
    ],
)
def test_bounds_of_actions(said: Any, read: Any) -> None:
    """One number, one pair, or a pair for each."""
    assert pairs(said) == read


def test_bounds_of_terms_in_frames_and_of_several_inputs() -> None:
    """One number bounds both sides, wherever a term is."""
    frame = {"frame": [{"term": "phase", "clip": 2.0}, {"term": "action"}], "history": 3}
    read = [{"frame": [{"term": "phase", "clip": [-2.0, 2.0]}, {"term": "action"}], "history": 3}]
    assert with_pairs({"observations": [frame]})["observations"] == read
    assert with_pairs({"observations": {"a": [frame]}})["observations"] == {"a": read}


@pytest.mark.parametrize(
    ("fields", "bounds"),
    [
        ({"action_clip": [-100, 100]}, ((-100.0, 100.0),)),
        ({"action_clip": 18}, ((-18.0, 18.0),)),
        ({"action_clip": [[-1, 1]] * 3}, ((-1.0, 1.0),) * 3),
        ({"action_clip": [100, -100]}, "action_clip.0.: 100.0 is above -100.0"),
        ({"action_clip": [-1, 0, 1]}, "action_clip.0.: must be a list"),
        ({"action_clip": True}, "action_clip: must be a list"),
    ],
)
def test_a_description_is_read_with_them(
    tmp_path: Path, fields: dict[str, Any], bounds: Any
) -> None:
    """What is no bounds is one line with its field."""
    write_onnx(tmp_path / "policy.onnx", linear(3, 3))
    said = {"observations": [{"term": "base_ang_vel", "clip": 5}], **fields}
    if isinstance(bounds, str):
        with pytest.raises(ConfigError, match=bounds):
            policy_file_config(said, tmp_path / "own.yaml")
        return
    config = policy_file_config(said, tmp_path / "own.yaml")
    assert config.action_clip == bounds and config.inputs[""][0].clip == (-5.0, 5.0)


def test_a_deploy_file_is_read_with_them() -> None:
    """The action's clip of Isaac Lab, and that of a term."""
    deploy = lab_deploy(3)
    deploy["actions"]["JointPositionAction"]["clip"] = [-100.0, 100.0]
    deploy["observations"]["base_ang_vel"]["clip"] = 18.0
    fields = deploy_fields(deploy, Path("deploy.yaml"))
    assert fields["action_clip"] == ((-100.0, 100.0),)
    terms = fields["observations"]
    assert isinstance(terms, list) and terms[0]["clip"] == (-18.0, 18.0)
