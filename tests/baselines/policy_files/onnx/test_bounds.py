"""Networks that would take all time or memory; policy_files/onnx/bounds.py, tensors.py."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.policy_files.networks import OnnxNetwork
from poise.baselines.policy_files.onnx import bounds
from poise.baselines.policy_files.onnx.bounds import RunOptions, try_network
from poise.baselines.policy_files.onnx.files import digest
from poise.baselines.policy_files.onnx.tensors import DEPTH, external_files
from poise.configs.errors import ConfigError, PoiseError
from tests.support.policies import helper, linear, onnx, write_onnx, write_recurrent
from tests.support.refused import invalid

FLOAT, BOOL, INT = onnx.TensorProto.FLOAT, onnx.TensorProto.BOOL, onnx.TensorProto.INT64
info = helper.make_tensor_value_info


def write(path: Path, nodes: list[Any], tensors: list[Any], shape: list[Any]) -> Path:
    """A network from `obs` of three numbers to `actions`."""
    ends = [info("obs", FLOAT, [1, 3])], [info("actions", FLOAT, shape)]
    graph = helper.make_graph(nodes, "policy", *ends, tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return path


def loop(path: Path, rounds: int) -> Path:
    """a = o · 1.5 · 1.5 …"""
    again = helper.make_node("Identity", ["c"], ["c_out"])
    body = helper.make_graph(
        [again, helper.make_node("Mul", ["s", "k"], ["t"])], "body",
        [info("i", INT, []), info("c", BOOL, []), info("s", FLOAT, [1, 3])],
        [info("c_out", BOOL, []), info("t", FLOAT, [1, 3])],
        [helper.make_tensor("k", FLOAT, [1], [1.5])],
    )  # fmt: skip
    node = helper.make_node("Loop", ["n", "go", "obs"], ["actions"], body=body)
    tensors = [
        helper.make_tensor("n", INT, [], [rounds]),
        helper.make_tensor("go", BOOL, [], [True]),
    ]
    return write(path, [node], tensors, [1, 3])


def constant(path: Path, size: int) -> Path:
    """A constant that is made while the network is optimised."""
    nodes = [
        helper.make_node("ConstantOfShape", ["size"], ["zeros"]),
        helper.make_node("ReduceSum", ["zeros"], ["sum"], keepdims=0),
        helper.make_node("Add", ["obs", "sum"], ["actions"]),
    ]
    return write(path, nodes, [helper.make_tensor("size", INT, [1], [size])], [1, 3])


BAD: dict[str, tuple[Callable[[Path], Path], str]] = {
    "a loop": (lambda path: loop(path, 2**62), "takes more than 1 s to read and ask once"),
    "a constant": (lambda path: constant(path, 10**9), "takes more than 1024 MiB"),
}


@pytest.mark.parametrize("what", BAD)
def test_a_network_is_asked_apart_first(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing in this process can end either; what is within the bounds is played."""
    monkeypatch.setattr(bounds, "CPU", 1)
    make, problem = BAD[what]
    with pytest.raises(ConfigError, match=f"policy.onnx: {problem}"):
        try_network(make(tmp_path / "policy.onnx"), "")


def test_the_same_within_the_bounds_is_played(tmp_path: Path) -> None:
    for path in (loop(tmp_path / "a.onnx", 2), constant(tmp_path / "b.onnx", 10)):
        try_network(path, str(path))
        assert OnnxNetwork(path).act({"": np.ones(3)})["action"].shape == (3,)


def test_one_digest_is_asked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a process: half a second."""
    path = write_onnx(tmp_path / "policy.onnx", linear(3, 2))
    try_network(path, "seen")
    monkeypatch.setattr(bounds.subprocess, "run", pytest.fail)
    try_network(path, "seen")


def test_a_network_that_takes_long_later_ends_with_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it saw; the next asking has its time again."""
    network = OnnxNetwork(loop(tmp_path / "policy.onnx", 2**62))
    monkeypatch.setattr(bounds, "LONGEST", 0.3)
    monkeypatch.setattr(bounds, "_thread", None)  # one that looks that often
    begun = time.monotonic()
    with pytest.raises(PoiseError, match=r"policy.onnx: cannot be asked \(") as caught:
        network.act({"": np.ones(3)})
    assert time.monotonic() - begun < 20.0 and str(caught.value).isprintable()
    with RunOptions().run() as options:
        assert not options.terminate


def test_a_memory_that_grows_ends_the_trial(tmp_path: Path) -> None:
    """Before it is all that there is."""
    path = write_recurrent(tmp_path / "policy.onnx", 3)
    model = onnx.load(path)
    model.graph.node[0].CopyFrom(helper.make_node("Concat", ["h_in", "obs"], ["h_out"], axis=1))
    model.graph.input[1].type.tensor_type.shape.dim[1].dim_param = "n"
    model.graph.output[1].type.tensor_type.shape.dim[1].dim_param = "m"
    model.graph.output[0].type.tensor_type.shape.dim[1].dim_param = "k"
    path.write_bytes(model.SerializeToString())
    network = OnnxNetwork(path)
    with pytest.raises(PoiseError, match="h_in: remembers 1 × 4 numbers, not 1 × 1"):
        network.act({"": np.ones(3)})


def with_data(folder: Path, name: str, place: str = "initializer") -> Path:
    """A network whose numbers lie in the file `name`."""
    path = write_onnx(folder / "policy.onnx", linear(3, 2), outside=True)
    model = onnx.load(path, load_external_data=False)
    tensor = model.graph.initializer[0]
    for entry in tensor.external_data:
        if entry.key == "location":
            entry.value = name
    if place != "initializer":
        moved = onnx.TensorProto()
        moved.CopyFrom(tensor)
        del model.graph.initializer[:]
        node = helper.make_node("Constant", [], ["W"], value=moved)
        if place == "graph within a node":
            inner = helper.make_graph([node], "inner", [], [info("W", FLOAT, [3, 2])])
            go = helper.make_tensor("go", BOOL, [], [True])
            model.graph.initializer.append(go)
            node = helper.make_node("If", ["go"], ["W"], then_branch=inner, else_branch=inner)
        model.graph.node.insert(0, node)
    if place == "function":
        version = [helper.make_opsetid("", 17)]
        function = helper.make_function("own", "f", [], ["W"], [model.graph.node[0]], version)
        model.functions.append(function)
        del model.graph.node[0]
    path.write_bytes(model.SerializeToString())
    (folder / "policy.onnx.data").rename(folder / name)
    return path


@pytest.mark.parametrize("place", ["initializer", "node", "graph within a node", "function"])
@pytest.mark.parametrize("name", ["policy.data", "x" * 200])  # a length of one byte, and of two
def test_the_digest_covers_the_numbers_wherever_they_are(
    place: str, name: str, tmp_path: Path
) -> None:
    """So a result names the network that it played."""
    path = with_data(tmp_path, name, place)
    assert external_files(path.read_bytes()) == {name}
    before = digest(path, path)
    content = bytearray((tmp_path / name).read_bytes())
    content[0] ^= 1
    (tmp_path / name).write_bytes(content)
    assert digest(path, path) != before


def test_a_file_of_another_suffix_is_looked_at_likewise(tmp_path: Path) -> None:
    """A description may name it, and onnxruntime reads it."""
    path = with_data(tmp_path, "policy.data").rename(tmp_path / "policy.bin")
    before = digest(path, path)
    (tmp_path / "policy.data").write_bytes(bytes(24))
    assert digest(path, path) != before


def test_keys_in_another_order_and_twice(tmp_path: Path) -> None:
    """As protocol buffers may be written: the last value counts for onnxruntime, all for us."""
    entry = b"\x12\x01b" + b"\x0a\x08location" + b"\x12\x01c"  # value, key, value
    tensor = b"\x6a" + bytes([len(entry)]) + entry
    graph = b"\x2a" + bytes([len(tensor)]) + tensor
    assert external_files(b"\x3a" + bytes([len(graph)]) + graph) == {"b", "c"}


@pytest.mark.parametrize("name", ["", ".", "..", "../policy.onnx.data", "/etc/passwd", "sub/a"])
def test_data_elsewhere_is_refused(name: str, tmp_path: Path) -> None:
    path = with_data(tmp_path, "policy.data")
    model = onnx.load(path, load_external_data=False)
    for entry in model.graph.initializer[0].external_data:
        if entry.key == "location":
            entry.value = name
    path.write_bytes(model.SerializeToString())
    with invalid("policy", "policy.onnx"):
        digest(path, path)


@pytest.mark.parametrize("content", [
    b"\xff" * 20, b"\x3a\x7f", b"\x0b", b"\x08", b"no network",
    b"\x3a\x00" * 300_000,
], ids=["number", "cut off", "group", "no value", "text", "parts"])  # fmt: skip
def test_what_is_no_onnx_file_is_told(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "policy.onnx").write_bytes(content)
    with invalid(None, source="policy.onnx"):
        digest(tmp_path / "policy.onnx", "policy")


def test_levels_are_bounded() -> None:
    """A graph in an attribute of a node in a graph, over and over."""
    content = b""
    for _ in range(DEPTH):
        for tag in (b"\x32", b"\x2a", b"\x0a"):  # graph of an attribute, of a node, of a graph
            content = tag + _length(content) + content
    with pytest.raises(ValueError, match="levels"):
        external_files(b"\x3a" + _length(content) + content)


def _length(content: bytes) -> bytes:
    size, varint = len(content), b""
    while size >= 0x80:
        varint, size = varint + bytes([size & 0x7F | 0x80]), size >> 7
    return varint + bytes([size])
