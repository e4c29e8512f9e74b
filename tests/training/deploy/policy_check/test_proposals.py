"""proposals: what a description leaves open is tried, and what stands is proposed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from poise.baselines.registry import controller_config
from poise.training.cli.entry import main
from poise.training.deploy.policy_check.check import PolicyCheck, check_policy
from tests.support.policies import write_onnx, write_yaml
from tests.support.shared import robot
from tests.support.weekly import daily

N, FRAME = 25, 84  # joints of `compact`; numbers of a step of the terms below
TERMS = ["base_ang_vel", "projected_gravity", "velocity_commands", "joint_pos_rel", "joint_vel",
         "last_action"]  # fmt: skip
GRAVITY = (
    14  # by term this is one of four steps of gravity's third number; by frame a joint at rest
)


def leaning(path: Path, inputs: int, place: int, joints: str = "", **kwargs: Any) -> None:
    """A network that bends joints, by default all, by what is at a place of its observation."""
    W = np.zeros((inputs, N), dtype=np.float32)
    W[place] = [0.8 * (joints in name) for name in robot("compact").joint_names]
    write_onnx(path, W, **kwargs)


def described(place: Path, terms: list[dict[str, Any]], **changes: Any) -> str:
    """A stiff robot in its standing posture."""
    body = robot("compact")
    fields: dict[str, Any] = {
        "kind": "policy-file", "policy": "policy.onnx", "joints": list(body.joint_names),
        "default": [float(q) for q in body.standing_qpos[7:]], "action_scale": 0.6,
        "stiffness": {"*hip*": 400.0, "*knee*": 400.0, "*ankle*": 400.0, "*": 60.0},
        "damping": 10.0, "observations": terms,
    }  # fmt: skip
    return str(write_yaml(place / "own.yaml", **{**fields, **changes}))


def proposal(check: PolicyCheck) -> dict[str, Any]:
    assert check.proposed is not None
    said: dict[str, Any] = yaml.safe_load(check.proposed.lines)
    return said


def test_a_history_that_nothing_says_is_tried(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four times the numbers of the terms: by frame it stands, by term it falls."""
    leaning(tmp_path / "policy.onnx", 4 * FRAME, GRAVITY)
    path = described(tmp_path, [{"term": name} for name in TERMS])
    check = check_policy(path, robot("compact"))
    stands = {each.name: each.stood.fell is None for each in check.tried}
    assert stands == {"by frame, oldest first": True, "by frame, newest first": True,
                      "by term, oldest first": False, "by term, newest first": False}  # fmt: skip
    assert not check.right and check.stood is not None and check.stood.fell is None
    said = proposal(check)
    assert said["history"] == "frame" and all(t["history"] == 4 for t in said["observations"])
    assert main(["policies", "check", path, "--robot", "compact"]) == 1
    printed = capsys.readouterr()
    text = printed.out.replace("\n", " ")
    assert "its own description does not fit its network" in text and "history: frame" in text
    assert printed.err.count("trying its history, ") == 4 and "standing for 10 s" in printed.err
    assert check_policy(described(tmp_path, **{"terms": [], **said}), robot("compact")).right


def test_the_order_of_a_history_that_falls_is_tried(tmp_path: Path) -> None:
    """Where its length is said and its order is not; never where the order is said."""
    leaning(tmp_path / "policy.onnx", 4 * FRAME, GRAVITY)
    terms = [{"term": name, "history": 4} for name in TERMS]
    check = check_policy(described(tmp_path, terms), robot("compact"))
    assert proposal(check)["history"] == "frame" and not check.right
    check = check_policy(described(tmp_path, terms, history="term"), robot("compact"))
    assert check.tried == () and check.proposed is None


def test_no_order_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each is told with its fall."""
    leaning(tmp_path / "policy.onnx", 2 * FRAME, 5)  # gravity in the first frame, or a rate
    path = described(tmp_path, [{"term": name} for name in TERMS], stiffness=1.0)
    assert main(["policies", "check", path, "--robot", "compact"]) == 1
    text = capsys.readouterr().out.replace("\n", " ")
    assert text.count("fell after") == 5 and "it does not stand" in text


@pytest.mark.parametrize("term", daily(["phase", "phase_sin"]))
def test_a_clock_that_is_never_at_rest(
    tmp_path: Path, term: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Zeros at rest are proposed; what is proposed is at rest, and says so itself."""
    leaning(tmp_path / "policy.onnx", 5, 3, "waist_roll")
    terms = [{"term": "projected_gravity"}, {"term": term}]
    path = described(tmp_path, terms, action_scale=0.3)
    main(["policies", "check", path, "--robot", "compact"])
    text = " ".join(capsys.readouterr().out.split())
    assert "as it is described, it stood for 10 s, never at rest" in text
    assert "clock's period in seconds" in text and "0.8 is taken" in text
    check = check_policy(path, robot("compact"))
    assert check.stood is not None and check.stood.fell is None and not check.stood.rests
    said = proposal(check)
    assert said["observations"] == [{"term": "projected_gravity"},
                                    {"term": term, "at_rest": [0.0, 0.0]}]  # fmt: skip
    again = check_policy(described(tmp_path, action_scale=0.3, terms=[], **said), robot("compact"))
    assert again.stood is not None and again.stood.rests and again.tried == ()
    assert check.unsaid == ("phase",)
    told = described(tmp_path, terms, action_scale=0.3, phase=0.8)
    assert check_policy(told, robot("compact")).unsaid == ()


def test_metadata_says_terms_and_no_history(tmp_path: Path) -> None:
    """As mjlab writes them into a file, which stands alone."""
    body = robot("compact")
    metadata = {
        "joint_names": ",".join(body.joint_names),
        "default_joint_pos": ",".join(str(q) for q in body.standing_qpos[7:]),
        "joint_stiffness": ",".join(["400"] * N), "joint_damping": ",".join(["10"] * N),
        "action_scale": ",".join(["0.6"] * N),
        "observation_names": "base_ang_vel,projected_gravity,command,joint_pos,joint_vel,actions",
    }  # fmt: skip
    leaning(tmp_path / "policy.onnx", 4 * FRAME, GRAVITY, metadata=metadata)
    check = check_policy(str(tmp_path / "policy.onnx"), body)
    assert proposal(check)["history"] == "frame" and check.unsaid == ()
    assert controller_config(str(tmp_path / "policy.onnx"))
