"""baselines/policy_files/networks.py: inputs, outputs and memories by any names, in any type."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import poise
from poise.baselines.policy_files.config import NetworkMemory, ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.networks import load_network
from poise.baselines.policy_files.script_sizes import script_sizes
from poise.configs.errors import ConfigError, PoiseError
from tests.support.policies import helper, write_graph, write_recurrent
from tests.support.refused import invalid

SEEN = {"": np.ones(2)}
TERM = (ObservationTerm("base_ang_vel"),)


def test_a_recurrent_network_starts_from_zeros(tmp_path: Path) -> None:
    """Its memory is an input with an output of that name; a copy has one of its own."""
    network = load_network(write_recurrent(tmp_path / "policy.onnx", 2))
    assert [network.act(SEEN)["action"][0] for _ in range(3)] == [1.0, 2.0, 3.0]
    other = copy.deepcopy(network)
    assert other.act(SEEN)["action"][0] == 4.0 == network.act(SEEN)["action"][0]
    network.reset()
    assert network.act(SEEN)["action"][0] == 1.0


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("input_hidden", "output_hidden"), ()),
        (("h0", "hn"), (NetworkMemory("h0", "hn"),)),
        (("h0", "hn"), (NetworkMemory("h0", 1),)),
    ],
)
@pytest.mark.parametrize("optional", [False, True])
def test_a_memory_has_any_name(
    tmp_path: Path, names: tuple[str, str], said: tuple[NetworkMemory, ...], optional: bool
) -> None:
    """And its zeros may be the file's own, so that the input may be left out."""
    path = write_recurrent(tmp_path / "policy.onnx", 2, names, optional)
    network = load_network(path, PolicyFileConfig(memory=said))
    assert [network.act(SEEN)["action"][0] for _ in range(2)] == [1.0, 2.0]


def two(path: Path, types: tuple[int, int] = (1, 1)) -> Path:
    """Two inputs, and outputs that bring gains: action = a + b[:2], kp = a, kd = b[:2]."""
    nodes = [
        helper.make_node("Cast", ["b"], ["b1"], to=types[0]),
        helper.make_node("Slice", ["b1", "zero", "end"], ["kd"]),
        helper.make_node("Add", ["a", "kd"], ["target"]),
        helper.make_node("Identity", ["a"], ["kp"]),
    ]
    ends = {"zero": np.array([0]), "end": np.array([2])}
    outputs = [(name, [2], types[0]) for name in ("kp", "kd", "target")]
    inputs = [("a", [2], types[0]), ("b", [3], types[1])]
    return write_graph(path, nodes, ends, inputs, outputs)


@pytest.mark.parametrize("types", [(1, 1), (11, 11), (10, 10), (1, 7)])
def test_inputs_and_outputs_by_name(tmp_path: Path, types: tuple[int, int]) -> None:
    """In 32, 64 and 16 bits and whole numbers, without an axis for a batch."""
    roles = {"action": "target", "stiffness": "kp", "damping": 1}
    config = PolicyFileConfig(observations={"b": TERM, "a": TERM}, outputs=roles)
    network = load_network(two(tmp_path / "two.onnx", types), config)
    found = network.act({"b": np.array([3.0, 4.0, 5.0]), "a": np.array([0.5, 0.25])})
    assert {role: values.tolist() for role, values in found.items()} == {
        "action": [3.5, 4.25], "stiffness": [0.5, 0.25], "damping": [3.0, 4.0]}  # fmt: skip
    assert pickle.loads(pickle.dumps(network)).act(
        {"b": np.zeros(3), "a": np.ones(2)})["action"].tolist() == [1.0, 1.0]  # fmt: skip


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, r"two.onnx: must have one input, the observation, not a, b: say what each shows"),
        ({"observations": {"a": TERM}}, "observations: what the input 'b' shows is not said"),
        (
            {"observations": {"a": TERM, "b": TERM, "c": TERM}},
            "has no such input: 'c' .choices: a, b",
        ),
        ({"memory": (NetworkMemory("h", "kp"),)}, r"memory\[0\].input: two.onnx has no input 'h'"),
        (
            {"memory": (NetworkMemory("b", "hn"),)},
            r"memory\[0\].output: two.onnx has no output 'hn'",
        ),
        ({"memory": (NetworkMemory("b", 3),)}, "has no output 3 .choices: kp, kd, target"),
        (
            {"memory": (NetworkMemory("b", "kd"),), "outputs": {"action": "q"}},
            "outputs.action: .*'q'",
        ),
    ],
)
def test_what_is_not_said_of_a_network(
    tmp_path: Path, fields: dict[str, Any], message: str
) -> None:
    """One line names the file, the field and what there is."""
    with pytest.raises(ConfigError, match=message):
        load_network(two(tmp_path / "two.onnx"), PolicyFileConfig(**fields))


def test_a_size_that_is_a_multiple_is_perhaps_a_history(tmp_path: Path) -> None:
    """Which is said; open sizes are the batch's, but for the last."""
    nodes = [helper.make_node("Identity", ["obs"], ["actions"])]
    path = write_graph(tmp_path / "p.onnx", nodes, {}, [("obs", ["batch", 384], 1)],
                       [("actions", ["batch", 384], 1)])  # fmt: skip
    with pytest.raises(PoiseError, match="1 × 384; 384 = 4 × 96: a history of 4 steps\\?"):
        load_network(path).act({"": np.zeros(96)})
    path = write_graph(tmp_path / "q.onnx", nodes, {}, [("obs", [1, 2, "n"], 1)],
                       [("actions", [1, 2, "n"], 1)])  # fmt: skip
    assert len(load_network(path).act({"": np.zeros(6)})["action"]) == 6


@pytest.mark.parametrize("numbers", [10**8, 10**15, 2**62])
def test_a_memory_has_bounds(tmp_path: Path, numbers: int) -> None:
    """A file of a few bytes may ask for all of a machine's."""
    path = write_recurrent(tmp_path / "huge.onnx", numbers)
    with invalid("h_in", f"1 × {numbers}", source="huge.onnx"):
        load_network(path)


class Remembering(torch.nn.Module):
    """h' = h + o, in double; it gives the action, gains, and what it remembers."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.eye(3, dtype=torch.float64)[:2])

    def forward(
        self, o: torch.Tensor, h: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        return 10.0 * (h + o), o, h + o


def test_torchscript_with_memory(tmp_path: Path) -> None:
    """Given behind the observation, taken from a place among what comes back; in its own type."""
    path = tmp_path / "policy.pt"
    torch.jit.save(torch.jit.script(Remembering()), str(path))
    config = PolicyFileConfig(
        memory=(NetworkMemory("h", 2, (2,)),), outputs={"stiffness": 1}, batch=False
    )
    with poise.allowing(str(path)):
        network = load_network(path, config)
        assert script_sizes(path) == (3, 2)
    assert [network.act(SEEN)["action"][0] for _ in range(2)] == [10.0, 20.0]
    other = copy.deepcopy(network)
    found = other.act(SEEN)
    assert found["action"][0] == 30.0 and found["stiffness"].tolist() == [1.0, 1.0]
    network.reset()
    assert network.act(SEEN)["action"][0] == 10.0
    with pytest.raises(ConfigError, match=r"memory\[0\].shape: needs a shape"):
        load_network(path, PolicyFileConfig(memory=(NetworkMemory("h", 2),)))


class Recurrent(torch.nn.Module):
    """A policy as rsl_rl exports one: layers by a name before that of the LSTM that they follow."""

    def __init__(self) -> None:
        super().__init__()
        self.actor = torch.nn.Sequential(torch.nn.Linear(64, 32), torch.nn.ELU(),
                                         torch.nn.Linear(32, 7))  # fmt: skip
        self.rnn = torch.nn.LSTM(11, 64)
        self.register_buffer("hidden_state", torch.zeros(1, 1, 64))


class Keeps(Recurrent):
    def forward(self, o: torch.Tensor) -> torch.Tensor:
        out, (h, _) = self.rnn(o.unsqueeze(0), (self.hidden_state, self.hidden_state))
        self.hidden_state[:] = h
        return self.actor(out.squeeze(0))


class Given(Recurrent):
    def forward(
        self, o: torch.Tensor, h: torch.Tensor, c: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        out, (h, c) = self.rnn(o.unsqueeze(0), (h, c))
        return self.actor(out.squeeze(0)), h, c


@pytest.mark.parametrize("kind", [Keeps, Given])
def test_the_sizes_of_a_recurrent_script(tmp_path: Path, kind: type[Recurrent]) -> None:
    """Those of its observation and action, not of whichever matrix is first and last."""
    path = tmp_path / "policy.pt"
    torch.jit.save(torch.jit.script(kind()), str(path))
    assert script_sizes(path) == (11, 7)


def test_the_sizes_of_a_normalised_script(tmp_path: Path) -> None:
    """A single number that goes with any mean is no observation."""

    class Normalised(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.register_buffer("count", torch.ones(1))
            self.register_buffer("mean", torch.zeros(5))
            self.layer = torch.nn.Linear(5, 3)

        def forward(self, o: torch.Tensor) -> torch.Tensor:
            return self.layer((o - self.mean) / self.count)

    path = tmp_path / "policy.pt"
    torch.jit.save(torch.jit.script(Normalised()), str(path))
    assert script_sizes(path) == (5, 3)
