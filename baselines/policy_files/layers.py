"""The layers of a policy's network, out of its ONNX file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.configs.errors import ConfigError

HOW = "needs the package onnx: pip install onnx"


@dataclass(frozen=True, eq=False)
class Layers:
    """A network: x₀ = (o − mean) / scale, x_k = ELU(W_k x + b_k), and W x + b at the end."""

    mean: np.ndarray  # (n,)
    scale: np.ndarray  # (n,)
    weights: list[np.ndarray]  # (out, in) each
    biases: list[np.ndarray]  # (out,) each


def read_layers(path: Path) -> Layers:
    """The layers of an ONNX file: Sub and Div, or neither; then Gemm and Elu in turn, as mjlab's.

    Raises ConfigError naming the file: it holds another network, or the package onnx is missing.
    """
    try:
        import onnx
    except ImportError:
        raise ConfigError(HOW, source=path) from None
    graph = onnx.load(str(path)).graph
    arrays = {t.name: np.array(onnx.numpy_helper.to_array(t), float) for t in graph.initializer}
    kinds = [node.op_type for node in graph.node]
    normalised = kinds[:2] == ["Sub", "Div"]
    layers = list(graph.node)[2 if normalised else 0 :]
    gemms = layers[::2]
    if [node.op_type for node in layers] != ["Gemm", *["Elu", "Gemm"] * (len(gemms) - 1)]:
        raise ConfigError(
            f"is no chain of layers with ELU between them: {', '.join(kinds)}", source=path
        )
    weights = [_matrix(node, arrays) for node in gemms]
    biases = [arrays[node.input[2]].ravel() for node in gemms]
    mean, scale = np.zeros(weights[0].shape[1]), np.ones(weights[0].shape[1])
    if normalised:
        mean, scale = (arrays[node.input[1]].ravel() for node in list(graph.node)[:2])
    return Layers(mean, scale, weights, biases)


def _matrix(node: object, arrays: dict[str, np.ndarray]) -> np.ndarray:
    """(out, in) of a Gemm."""
    transposed = {each.name: each.i for each in node.attribute}.get("transB", 0)  # type: ignore[attr-defined]
    matrix = arrays[node.input[1]]  # type: ignore[attr-defined]
    return matrix if transposed else matrix.T
