"""Small policies as ONNX files, and the files that describe policies."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

onnx = pytest.importorskip("onnx", reason="writes ONNX files: pip install onnx")
onnxruntime = pytest.importorskip(
    "onnxruntime", reason="plays ONNX files: pip install 'poise[onnx]'"
)
helper, numpy_helper = onnx.helper, onnx.numpy_helper


def onnx_session(path: str | Path) -> Any:
    """onnxruntime's own session of a file."""
    return onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])


def linear(inputs: int, outputs: int, size: float = 0.1, seed: int = 0) -> np.ndarray:
    """(inputs, outputs) small random numbers."""
    return np.random.default_rng(seed).normal(0.0, size, (inputs, outputs)).astype(np.float32)


def write_onnx(
    path: Path, W: np.ndarray, metadata: dict[str, str] | None = None, outside: bool = False
) -> Path:
    """A policy a = tanh(o W); with `outside`, W lies in a file beside it."""
    nodes = [
        helper.make_node("MatMul", ["obs", "W"], ["x"]),
        helper.make_node("Tanh", ["x"], ["actions"]),
    ]
    return _write(path, nodes, {"W": W}, [("obs", W.shape[0])], [("actions", W.shape[1])],
                  metadata, outside)  # fmt: skip


def write_layers(path: Path, sizes: list[int], seed: int = 0) -> Path:
    """A policy as mjlab writes them: (o − mean)/std, then layers with ELU between them."""
    rng, weights = np.random.default_rng(seed), {}
    weights["mean"] = rng.normal(0.0, 0.3, (1, sizes[0])).astype(np.float32)
    weights["std"] = rng.uniform(0.5, 2.0, (1, sizes[0])).astype(np.float32)
    nodes = [
        helper.make_node("Sub", ["obs", "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "std"], ["x0"]),
    ]
    for i, (inputs, outputs) in enumerate(pairwise(sizes)):
        last = i == len(sizes) - 2
        weights[f"W{i}"] = linear(outputs, inputs, 0.4, seed + 1 + i)
        weights[f"b{i}"] = rng.normal(0.0, 0.2, outputs).astype(np.float32)
        layer = [f"x{i}", f"W{i}", f"b{i}"], ["actions" if last else f"y{i}"]
        nodes.append(helper.make_node("Gemm", *layer, transB=1))
        nodes += [] if last else [helper.make_node("Elu", [f"y{i}"], [f"x{i + 1}"])]
    return _write(path, nodes, weights, [("obs", sizes[0])], [("actions", sizes[-1])])


def write_recurrent(
    path: Path, n: int, names: tuple[str, str] = ("h_in", "h_out"), optional: bool = False
) -> Path:
    """a = h' = h + o, which remembers; with `optional` the file has zeros for h."""
    before, after = names
    nodes = [
        helper.make_node("Add", ["obs", before], [after]),
        helper.make_node("Identity", [after], ["actions"]),
    ]
    zeros = {before: np.zeros((1, n), np.float32)} if optional else {}
    return _write(path, nodes, zeros, [("obs", n), (before, n)], [("actions", n), (after, n)])


def _write(
    path: Path,
    nodes: list[Any],
    weights: dict[str, np.ndarray],
    inputs: list[tuple[str, int]],
    outputs: list[tuple[str, int]],
    metadata: dict[str, str] | None = None,
    outside: bool = False,
) -> Path:
    sides = [[(name, [1, size], onnx.TensorProto.FLOAT) for name, size in side]
             for side in (inputs, outputs)]  # fmt: skip
    return write_graph(path, nodes, weights, *sides, metadata, outside)


def write_graph(
    path: Path,
    nodes: list[Any],
    weights: dict[str, np.ndarray],
    inputs: list[tuple[str, list[int | str], int]],
    outputs: list[tuple[str, list[int | str], int]],
    metadata: dict[str, str] | None = None,
    outside: bool = False,
) -> Path:
    """A network of these nodes; inputs and outputs have a name, a shape and ONNX's type."""
    ends = [
        [helper.make_tensor_value_info(name, kind, shape) for name, shape, kind in side]
        for side in (inputs, outputs)
    ]
    tensors = [numpy_helper.from_array(value, name) for name, value in weights.items()]
    graph = helper.make_graph(nodes, "policy", *ends, tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    for key, value in (metadata or {}).items():
        model.metadata_props.add(key=key, value=value)
    path.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(model, str(path), save_as_external_data=outside, location=f"{path.name}.data",
              size_threshold=0)  # fmt: skip
    return path


def within(
    path: Path, inputs: int, metadata: dict[str, str] | None = None, **outputs: np.ndarray
) -> Path:
    """A network that gives rows of these arrays by `time_step`, the last one beyond them."""
    actions = outputs["joint_pos"].shape[1]
    last = np.array([len(next(iter(outputs.values()))) - 1], np.float32)
    weights = {"last": last, "W": np.zeros((inputs, actions), np.float32)}
    nodes = [helper.make_node("Min", ["time_step", "last"], ["low"]),
             helper.make_node("Cast", ["low"], ["index"], to=7),
             helper.make_node("MatMul", ["obs", "W"], ["actions"])]  # fmt: skip
    ends = [("actions", [1, actions], 1)]
    for name, rows in outputs.items():
        weights[f"all_{name}"] = rows.astype(np.float32)
        nodes.append(helper.make_node("Gather", [f"all_{name}", "index"], [f"two_{name}"], axis=0))
        weights.setdefault("ones", np.array([0]))
        nodes.append(helper.make_node("Squeeze", [f"two_{name}", "ones"], [name]))
        ends.append((name, [1, *rows.shape[1:]], 1))
    sides: list[Any] = [("obs", [1, inputs], 1), ("time_step", [1, 1], 1)]
    return write_graph(path, nodes, weights, sides, ends, metadata)


def write_yaml(path: Path, **fields: Any) -> Path:
    """A YAML file of these fields."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(fields, sort_keys=False))
    return path


def lab_deploy(n: int, **changes: Any) -> dict[str, Any]:
    """A `deploy.yaml` of unitree_rl_lab for n joints, in the order in which Isaac Lab has them."""
    motors = [*range(0, n, 2), *range(1, n, 2)]
    term = {"params": {}, "clip": None, "scale": [1.0, 1.0, 1.0], "history_length": 1}
    joints = {**term, "scale": [1.0] * n}
    return {
        "joint_ids_map": motors,
        "step_dt": 0.02,
        "stiffness": [100.0 + i for i in range(n)],
        "damping": [2.0] * n,
        "default_joint_pos": [0.01 * i for i in range(n)],
        "commands": {"base_velocity": {"ranges": {"lin_vel_x": [-0.5, 1.0]}}},
        "actions": {
            "JointPositionAction": {
                "clip": None, "joint_names": [".*"], "scale": [0.25] * n,
                "offset": [0.01 * i for i in range(n)], "joint_ids": None,
            }
        },
        "observations": {
            "base_ang_vel": {**term, "scale": [0.2, 0.2, 0.2]},
            "projected_gravity": term,
            "velocity_commands": {**term, "params": {"command_name": "base_velocity"}},
            "joint_pos_rel": dict(joints),
            "joint_vel_rel": {**joints, "scale": [0.05] * n},
            "last_action": dict(joints),
        },
        **changes,
    }  # fmt: skip


def gym_config(n: int, **changes: Any) -> dict[str, Any]:
    """A configuration of unitree_rl_gym for n joints."""
    return {
        "policy_path": "{LEGGED_GYM_ROOT_DIR}/deploy/pre_train/own/policy.onnx",
        "xml_path": "{LEGGED_GYM_ROOT_DIR}/resources/robots/own/scene.xml",
        "simulation_duration": 60.0, "simulation_dt": 0.002, "control_decimation": 10,
        "kps": [100.0] * n, "kds": [2.0] * n, "default_angles": [0.1] * n,
        "ang_vel_scale": 0.25, "dof_pos_scale": 1.0, "dof_vel_scale": 0.05,
        "action_scale": 0.25, "cmd_scale": [2.0, 2.0, 0.25],
        "num_actions": n, "num_obs": 11 + 3 * n, "cmd_init": [0.5, 0, 0],
        **changes,
    }  # fmt: skip
