"""rollout: networks that remember and networks of several inputs, against their maker's steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import poise
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError
from poise.training.deploy.policy_check.rollout import Finding, compare_rollout
from tests.support.policies import helper, write_graph, write_recurrent, write_yaml
from tests.support.shared import robot

N = 25  # joints of `compact`
ROWS = np.random.default_rng(0).normal(0.0, 0.1, (6, N))


def found(place: Path, arrays: dict[str, Any], **fields: Any) -> dict[str, Finding]:
    """The findings, by what was compared."""
    np.savez(place / "rollout.npz", **arrays)
    path = write_yaml(place / "own.yaml", **{
        "kind": "policy-file", "policy": "policy.onnx",
        "joints": list(robot("compact").joint_names),
        "observations": [{"term": "last_action"}], **fields})  # fmt: skip
    policy = PolicyFile(robot("compact"), controller_config(str(path)))
    return {each.what: each for each in compare_rollout(policy, place / "rollout.npz")}


@pytest.fixture
def remembering(tmp_path: Path) -> Path:
    """a = h' = h + o."""
    write_recurrent(tmp_path / "policy.onnx", N)
    return tmp_path


def sums(start: float = 0.0) -> np.ndarray:
    return start + np.cumsum(ROWS, axis=0)


def test_a_network_that_remembers_is_asked_in_turn(remembering: Path) -> None:
    """From zeros, where the rollout begins with its trial; else that is what is missing."""
    good = found(remembering, {"observations": ROWS, "actions": sums()})
    assert good["network"].right is True
    later = found(remembering, {"observations": ROWS, "actions": sums(1.0)})["network"]
    assert later.right is False and "asked from zeros" in later.text and "h_in" in later.text


def test_a_rollout_may_tell_what_it_remembered(remembering: Path) -> None:
    """Before each step; what it remembers then is compared with the next one."""
    before = np.vstack([np.ones(N), sums(1.0)[:-1]])[:, None]  # (T, 1, n)
    arrays = {"observations": ROWS, "actions": sums(1.0), "h_in": before}
    good = found(remembering, arrays)
    assert good["network"].right is True and good["memory h_in"].right is True
    wrong = found(remembering, {**arrays, "h_in": before + np.linspace(0.0, 1.0, 6)[:, None, None]})
    assert wrong["memory h_in"].right is False and wrong["network"].right is False
    with pytest.raises(ConfigError, match="h_in: policy.onnx remembers 1 × 25 numbers, not 3"):
        found(remembering, {**arrays, "h_in": np.zeros((6, 3))})


def test_a_warm_up_is_part_of_the_loop(remembering: Path) -> None:
    """Asked so often before its first action, on the first observation or on zeros."""
    warm = {"observations": ROWS, "actions": sums() + 3.0 * ROWS[0]}
    assert found(remembering, warm, warm_up=3)["network"].right is True
    assert found(remembering, warm)["network"].right is False
    zeros = found(remembering, {**warm, "actions": sums()}, warm_up=3, warm_up_with="zeros")
    assert zeros["network"].right is True


class Hidden(torch.nn.Module):
    """It keeps what it remembers in a buffer of its own, as rsl_rl exports a recurrent policy."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.eye(N))
        self.register_buffer("hidden_state", torch.zeros(1, N))

    def forward(self, o: torch.Tensor) -> torch.Tensor:
        self.hidden_state[:] = self.hidden_state + o @ self.weight
        return self.hidden_state.clone()


def test_a_script_keeps_its_memory_in_buffers(tmp_path: Path) -> None:
    """Which a rollout may tell by their names."""
    torch.jit.save(torch.jit.script(Hidden()), str(tmp_path / "policy.pt"))
    before = np.vstack([np.ones(N), sums(1.0)[:-1]])
    arrays = {"observations": ROWS, "actions": sums(1.0), "hidden_state": before}
    with poise.allowing(str(tmp_path / "policy.pt")):
        good = found(tmp_path, arrays, policy="policy.pt")
    assert good["network"].right is True and good["memory hidden_state"].right is True


def test_several_inputs_by_their_names(tmp_path: Path) -> None:
    """Each is an array of its own; a term is told with its input."""
    nodes = [helper.make_node("Add", ["a", "b"], ["actions"])]
    write_graph(tmp_path / "policy.onnx", nodes, {}, [("a", [1, N], 1), ("b", [1, N], 1)],
                [("actions", [1, N], 1)])  # fmt: skip
    actions = np.cumsum(ROWS, axis=0)
    last = np.vstack([np.zeros(N), actions[:-1]])
    inputs = {"a": [{"term": "last_action"}], "b": [{"term": "joint_vel"}]}
    good = found(tmp_path, {"a": last, "b": ROWS, "actions": actions}, observations=inputs)
    assert good["network"].right is True and good["a: last_action at 0:25"].right is True
    assert good["b: joint_vel at 0:25"].right is None
    swapped = found(tmp_path, {"a": ROWS, "b": last, "actions": actions}, observations=inputs)
    assert swapped["network"].right is True and swapped["a: last_action at 0:25"].right is False
