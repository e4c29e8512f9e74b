"""The layers of a policy's network, out of its ONNX file or TorchScript."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.baselines.allowance import is_script
from poise.configs.errors import ConfigError
from poise.configs.reading import read_bytes

from .networks import script_module
from .onnx.files import BYTES

HOW = "needs the package onnx: pip install onnx"


@dataclass(frozen=True, eq=False)
class NetworkLayers:
    """A network: x₀ = (o − mean) / scale, x_k = ELU(W_k x + b_k), and W x + b at the end."""

    mean: np.ndarray  # (n,)
    scale: np.ndarray  # (n,)
    weights: list[np.ndarray]  # (out, in) each
    biases: list[np.ndarray]  # (out,) each

    def outputs(self, observations: np.ndarray) -> np.ndarray:
        """(n, out) of observations (n, in)."""
        x = (observations - self.mean) / self.scale
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = x @ weight.T + bias
            x = np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0)))
        return x @ self.weights[-1].T + self.biases[-1]


def read_layers(path: Path) -> NetworkLayers:
    """The layers of an ONNX file: Sub and Div, or neither; then Gemm and Elu in turn, as mjlab's.

    Of TorchScript, which the user must have allowed, its matrices in turn, with ELU between them.

    Raises ConfigError naming the file: it holds another network, or the package onnx is missing.
    """
    return _script_layers(path) if is_script(path) else _onnx_layers(path)


def _script_layers(path: Path) -> NetworkLayers:
    """What TorchScript calls weight and bias, in turn; and mean and std of what it is given.

    Nothing tells what lies between them, so it is tried whether they do what it does.
    """
    import torch

    module = script_module(read_bytes(path, BYTES), path)
    found: dict[str, list[np.ndarray]] = {"weight": [], "bias": [], "mean": [], "std": []}
    for name, each in module.state_dict().items():
        found.get(name.rsplit(".")[-1].strip("_"), []).append(each.detach().double().numpy())
    weights, biases = found["weight"], found["bias"]
    shapes = [(w.ndim, w.shape[:1] == b.shape) for w, b in zip(weights, biases, strict=False)]
    if not shapes or len(weights) != len(biases) or set(shapes) != {(2, True)}:
        raise ConfigError("is no chain of layers: it has other weights than matrices with biases",
                          source=path)  # fmt: skip
    n = weights[0].shape[1]
    mean, scale = (np.ravel(each[0]) if each else empty for each, empty in
                   ((found["mean"], np.zeros(n)), (found["std"], np.ones(n))))  # fmt: skip
    layers = NetworkLayers(mean, scale, weights, biases)
    tried = mean + scale * np.random.default_rng(0).normal(size=(8, n))
    with torch.inference_mode():
        expected = module(torch.from_numpy(tried).float()).double().numpy()
    if not np.allclose(layers.outputs(tried), expected, rtol=1e-3, atol=1e-3):
        raise ConfigError("is no chain of layers with ELU between them", source=path)
    return layers


def _onnx_layers(path: Path) -> NetworkLayers:
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
    return NetworkLayers(mean, scale, weights, biases)


def _matrix(node: object, arrays: dict[str, np.ndarray]) -> np.ndarray:
    """(out, in) of a Gemm."""
    transposed = {each.name: each.i for each in node.attribute}.get("transB", 0)  # type: ignore[attr-defined]
    matrix = arrays[node.input[1]]  # type: ignore[attr-defined]
    return matrix if transposed else matrix.T
