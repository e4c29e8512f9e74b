"""baselines/policy_files/observations.py: terms by their meaning, histories by their order."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.networks import load_network
from poise.baselines.policy_files.observations import ALIASES, Observer, Seen
from poise.configs.errors import ConfigError
from tests.support.policies import write_recurrent
from tests.support.shared import generic_state


def seen(**changes: Any) -> Seen:
    """A body that is turned and moves, with three joints of the policy."""
    state = generic_state().state
    given = Seen(
        state, state.q[:3], state.qvel[6:9], np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.5]),
        np.array([1.0, 2.0, 3.0]), np.pi / 6,
    )  # fmt: skip
    return given._replace(**changes)


def observer(*terms: ObservationTerm, history: Any = "term") -> Observer:
    return Observer(PolicyFileConfig(observations=terms, history=history), 3, 2, "own.yaml")


def observed(name: str) -> np.ndarray:
    return observer(ObservationTerm(name)).observe(seen())


def test_terms_mean_what_others_call_so() -> None:
    """Velocities and gravity in the root's axes, joints in the policy's order."""
    state = seen().state
    w, x, y, z = state.qpos[3:7]
    turn = Rotation.from_quat([x, y, z, w]).inv()
    expected = {
        "base_lin_vel": turn.apply(np.array(state.qvel[:3])),
        "base_ang_vel": state.qvel[3:6],
        "projected_gravity": turn.apply([0.0, 0.0, -1.0]),
        "velocity_commands": [1.0, 2.0, 3.0],
        "joint_pos": state.q[:3],
        "joint_pos_rel": state.q[:3] - [0.1, 0.2, 0.3],
        "joint_vel": state.qvel[6:9],
        "last_action": [0.5, -0.5],
        "phase": [0.5, np.sqrt(0.75)],
    }
    for name, value in expected.items():
        np.testing.assert_allclose(observed(name), value, atol=1e-6, err_msg=name)
    for alias, name in ALIASES.items():
        np.testing.assert_array_equal(observed(alias), observed(name))


def test_scale_comes_after_clip() -> None:
    """As in Isaac Lab and mjlab."""
    term = ObservationTerm("command", scale=(1.0, 10.0, 100.0), clip=(-1.5, 1.5))
    np.testing.assert_allclose(observer(term).observe(seen()), [1.0, 15.0, 150.0])


@pytest.mark.parametrize(
    ("history", "expected"),
    [("term", [[1, 1, 1, 7, 7], [1, 1, 2, 7, 8], [1, 2, 3, 8, 9]]), ("frame", None)],
)
def test_histories(history: str, expected: list[list[float]] | None) -> None:
    """Oldest first; the first observation fills them; a new trial starts anew."""
    shown = observer(
        ObservationTerm("command", history=3),
        ObservationTerm("last_action", history=3 if expected is None else 2),
        history=history,
    )
    for _ in range(2):
        shown.forget()
        rows = [
            shown.observe(seen(command=np.full(3, 1.0 + k), action=np.full(2, 7.0 + k)))
            for k in range(3)
        ]
        if expected is None:
            frames = [[1.0 + k] * 3 + [7.0 + k] * 2 for k in range(3)]
            np.testing.assert_array_equal(rows[0], frames[0] * 3)
            np.testing.assert_array_equal(rows[2], np.concatenate(frames))
        else:
            sizes = np.repeat([True, False], [9, 4])
            for row, values in zip(rows, expected, strict=True):
                np.testing.assert_array_equal(row[sizes], np.repeat(values[:3], 3))
                np.testing.assert_array_equal(row[~sizes], np.repeat(values[3:], 2))
    assert shown.size == len(rows[0]) and "command 3 × 3" in shown.parts


def test_frames_need_one_length() -> None:
    """Whole steps cannot lie side by side where terms show different numbers of them."""
    with pytest.raises(ConfigError, match=r"own.yaml: observations\[1\].history: 2 .* 3"):
        observer(ObservationTerm("command", history=3), ObservationTerm("action", history=2),
                 history="frame")  # fmt: skip


def test_a_recurrent_network_starts_from_zeros(tmp_path: Path) -> None:
    """Its memory is an input with an output of that name; a copy has one of its own."""
    network = load_network(write_recurrent(tmp_path / "policy.onnx", 2))
    one = np.ones(2, dtype=np.float32)
    assert [network.act(one)[0] for _ in range(3)] == [1.0, 2.0, 3.0]
    other = copy.deepcopy(network)
    assert other.act(one)[0] == 4.0 == network.act(one)[0]
    network.reset()
    assert network.act(one)[0] == 1.0


def test_a_network_has_one_input(tmp_path: Path) -> None:
    """Besides what it remembers."""
    path = write_recurrent(tmp_path / "two.onnx", 2)
    content = path.read_bytes().replace(b"h_out", b"h_new")
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="two.onnx: must have one input.*obs, h_in"):
        load_network(path)


@pytest.mark.parametrize("numbers", [10**8, 10**15, 2**62])
def test_a_memory_has_bounds(tmp_path: Path, numbers: int) -> None:
    """A file of a few bytes may ask for all of a machine's."""
    path = write_recurrent(tmp_path / "huge.onnx", numbers)
    with pytest.raises(
        ConfigError, match=rf"huge.onnx: h_in: must be at most .*not 1 × {numbers}$"
    ):
        load_network(path)
