"""External policies: ONNX files of all sorts, their data beside them, and `deploy.yaml`."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from hypothesis import strategies as st

from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.reading import policy_config
from poise.configs.files import packaged_folder
from tests.support.policies import gym_config, helper, lab_deploy, linear, write_onnx, write_yaml
from tests.support.shared import robot

from .texts import Draw, byte_edits, changed, edit_bytes
from .values import Json, decode, packed

N = 7  # joints of the robot called compact
INPUTS = 9 + 3 * N
FLOAT, STRING, INT = onnx.TensorProto.FLOAT, onnx.TensorProto.STRING, onnx.TensorProto.INT64
LOCATIONS = ("policy.onnx.data", "../policy.onnx.data", "", ".", "..", "/etc/passwd", "sub/a",
             "link", "pipe", "x" * 300, "a\0b", "policy.onnx", "\u00e9", "missing")  # fmt: skip
SIZES: list[Json] = [0, 1, 2, -1, 2**31, 2**62, "n", None]


@cache
def _model(outside: bool) -> bytes:
    """A small policy; with `outside`, its numbers lie in a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_onnx(Path(folder) / "policy.onnx", linear(INPUTS, N), None, outside)
        return path.read_bytes()


DATA = linear(INPUTS, N).tobytes()


def _resize(model: Any, value: Json) -> None:
    """An input of other sizes, or of none."""
    shape = model.graph.input[0].type.tensor_type.shape
    if value is None:
        del shape.dim[:]
    elif isinstance(value, str):
        shape.dim[1].dim_param = value
    else:
        shape.dim[1].dim_value = value


def _retype(model: Any, value: Json) -> None:
    """Texts or whole numbers as what goes in or comes out."""
    side = model.graph.input if value % 2 else model.graph.output
    side[0].type.tensor_type.elem_type = STRING if value < 2 else INT


def _initialiser(model: Any, value: Json) -> None:
    """A tensor that says to be larger than it is."""
    model.graph.initializer[0].dims[0] = value if isinstance(value, int) else 10**9


def _filled(model: Any, value: Json) -> None:
    """A constant of many numbers, made while the network is optimised."""
    size = value if isinstance(value, int) else 10**9
    shape = helper.make_tensor("shape", INT, [1], [size])
    model.graph.node.insert(0, helper.make_node("ConstantOfShape", ["shape"], ["ones"]))
    model.graph.node.append(helper.make_node("ReduceSum", ["ones"], ["sum"], keepdims=0))
    model.graph.initializer.append(shape)
    model.graph.output.append(helper.make_tensor_value_info("sum", FLOAT, []))


def _memory(model: Any, value: Json) -> None:
    """A memory that grows with every step."""
    dims = [1, value if isinstance(value, int) and value < 2**31 else "n"]
    model.graph.node.append(helper.make_node("Concat", ["h_in", "h_in"], ["h_out"], axis=1))
    model.graph.input.append(helper.make_tensor_value_info("h_in", FLOAT, dims))
    model.graph.output.append(helper.make_tensor_value_info("h_out", FLOAT, None))


def _operator(model: Any, value: Json) -> None:
    """An operator that there is not, or of another version."""
    model.graph.node[0].op_type = str(value)


def _metadata(model: Any, value: Json) -> None:
    model.metadata_props.add(key="joint_names", value=str(value))
    model.metadata_props.add(key="observation_names", value=str(value))


CHANGES: dict[str, Callable[[Any, Json], None]] = {
    "size": _resize,
    "initialiser": _initialiser,
    "filled": _filled,
    "memory": _memory,
    "operator": _operator,
    "metadata": _metadata,
}


@st.composite
def cases(draw: Draw) -> Json:
    """A network, its data and its description, one of them changed."""
    how = draw(st.sampled_from(["bytes", "model", "model", "type", "location", "deploy", "data"]))
    case: Json = {"how": how}
    if how == "bytes":
        outside = draw(st.booleans())
        content = edit_bytes(_model(outside), byte_edits(draw, min(len(_model(outside)), 300)))
        return {**case, "file": packed(content)}
    if how == "model":
        change, size = draw(st.sampled_from(sorted(CHANGES))), draw(st.sampled_from(SIZES))
        return {**case, "change": change, "value": size}
    if how == "type":
        return {**case, "value": draw(st.integers(0, 3))}
    if how == "location":
        return {**case, "name": draw(st.sampled_from(LOCATIONS))}
    if how == "data":
        return {**case, "size": draw(st.sampled_from([0, 1, len(DATA) - 4, len(DATA) + 4]))}
    described = draw(st.sampled_from([_deploy(), _gym(), _own()]))
    return {**case, "file": packed(changed(draw, described))}


@cache
def _deploy() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write_yaml(Path(folder) / "deploy.yaml", **lab_deploy(N)).read_bytes()


@cache
def _gym() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write_yaml(Path(folder) / "deploy.yaml", **gym_config(N)).read_bytes()


def _own() -> bytes:
    return (packaged_folder("rivals") / "unitree-g1-velocity.yaml").read_bytes()


def _network(case: Json) -> bytes:
    """The ONNX file of a case."""
    if case["how"] == "bytes":
        return decode(case["file"])
    if case["how"] == "deploy":
        return _model(False)
    model = onnx.ModelProto()
    model.ParseFromString(_model(case["how"] in ("location", "data")))
    if case["how"] == "model":
        CHANGES[case["change"]](model, case["value"])
    elif case["how"] == "type":
        _retype(model, case["value"])
    elif case["how"] == "location":
        for tensor in model.graph.initializer:
            for entry in tensor.external_data:
                if entry.key == "location":
                    entry.value = case["name"]
    return model.SerializeToString()


def play(case: Json, folder: Path) -> None:
    """Read it, and ask it a few times if it can be played."""
    (folder / "policy.onnx").write_bytes(_network(case))
    (folder / "policy.onnx.data").write_bytes(DATA[: case.get("size", len(DATA))].ljust(
        case.get("size", 0), b"\0"))  # fmt: skip
    os.symlink("/etc/passwd", folder / "link")
    os.mkfifo(folder / "pipe")
    described = decode(case["file"]) if case["how"] == "deploy" else _deploy()
    (folder / "deploy.yaml").write_bytes(described)
    config = policy_config(folder)
    assert isinstance(config, PolicyFileConfig)
    controller = PolicyFile(robot("compact"), config)
    for _ in range(40):
        sizes = controller.observer.sizes
        action = controller.network.act({name: np.zeros(n) for name, n in sizes.items()})["action"]
        assert action.shape == (len(controller.action),)
