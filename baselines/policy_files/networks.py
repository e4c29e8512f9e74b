"""The network of a policy: numbers in, numbers out, with whatever it remembers in between."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from poise.baselines.allowance import is_script
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.extras import how_to_install
from poise.configs.reading import read_bytes

from .bounds import Clocked
from .files import BYTES

MEMORY = 10_000_000  # numbers that a network may remember, of each kind
HOW = f"needs the package onnxruntime: {how_to_install('onnx')}"


class Network(Protocol):
    """A policy's network: an observation in, an action out, with a memory of its own."""

    def reset(self) -> None:
        """Forget the last trial: a new one begins."""

    def act(self, observation: np.ndarray) -> np.ndarray:
        """The action (na,) float64 of an observation (n,) float32.

        Raises whatever the library of the network raises.
        """


def load_network(path: Path) -> Network:
    """The network in an ONNX or a TorchScript file. TorchScript runs: ask `check_allowed` before.

    Raises ConfigError naming the file: onnxruntime is missing, it cannot be read, or it has inputs
    besides the observation that are no memory (``NAME_in`` with an output ``NAME_out``), or its
    memory is huge.
    """
    return ScriptNetwork(read_bytes(path, BYTES), path) if is_script(path) else OnnxNetwork(path)


def onnx_session(path: Path) -> Any:
    """onnxruntime's session of a file, on one thread: results do not depend on the machine's."""
    try:
        import onnxruntime
    except ImportError:
        raise ConfigError(HOW, source=path) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
    except Exception as error:  # its classes are not public
        raise ConfigError(f"cannot be read by onnxruntime ({error})", source=path) from None


class OnnxNetwork:
    """A network in ONNX, played by onnxruntime; a recurrent one starts from zeros.

    Asking it raises PoiseError in one line where onnxruntime fails or takes too long, and where it
    remembers more than it did.
    """

    def __init__(self, path: Path):
        self.path = path
        self._session = onnx_session(path)
        inputs = {each.name: each.shape for each in self._session.get_inputs()}
        outputs = [each.name for each in self._session.get_outputs()]
        self._memory = {name: _zeros(shape, name, path) for name, shape in inputs.items()
                        if _after(name) in outputs}  # fmt: skip
        others = [name for name in inputs if name not in self._memory]
        if len(others) != 1:
            raise ConfigError(f"must have one input, the observation, not {', '.join(inputs)}",
                              source=path)  # fmt: skip
        self._input = others[0]
        self._outputs = [outputs[0], *map(_after, self._memory)]
        self._clocked = Clocked()

    def __reduce__(self) -> tuple[object, ...]:
        return OnnxNetwork, (self.path,), {"_memory": self._memory}

    def reset(self) -> None:
        self._memory = {name: np.zeros_like(value) for name, value in self._memory.items()}

    def act(self, observation: np.ndarray) -> np.ndarray:
        given = {self._input: observation[None], **self._memory}
        try:
            with self._clocked.run() as options:
                action, *memory = self._session.run(self._outputs, given, options)
            numbers = np.asarray(action, dtype=float).ravel()
        except Exception as error:  # of onnxruntime, or the action is no numbers
            raise PoiseError(f"{self.path}: cannot be asked ({error})") from None
        for (name, before), after in zip(self._memory.items(), memory, strict=True):
            if after.shape != before.shape:
                raise PoiseError(f"{self.path}: {name}: remembers {_times(after.shape)} numbers, "
                                 f"not {_times(before.shape)}")  # fmt: skip
        self._memory = dict(zip(self._memory, memory, strict=True))
        return numbers


def _after(name: str) -> str:
    """The output that an input of this name is taken from in the next step."""
    return name.removesuffix("_in") + "_out" if name.endswith("_in") else ""


def _times(shape: Sequence[object]) -> str:
    return " × ".join(map(str, shape))


def _zeros(shape: list[object], name: str, path: Path) -> np.ndarray:
    """The memory at the start; a size that is left open is 1."""
    sizes = [size if isinstance(size, int) else 1 for size in shape]
    if min(sizes, default=0) < 0 or math.prod(sizes) > MEMORY:
        raise ConfigError(f"must be at most {MEMORY} numbers, not {_times(sizes)}",
                          source=path, field=name)  # fmt: skip
    return np.zeros(sizes, dtype=np.float32)


class ScriptNetwork:
    """A network in TorchScript; one that remembers is loaded anew for every trial."""

    def __init__(self, content: bytes, path: Path):
        self.content, self.path = content, path
        self.reset()

    def __reduce__(self) -> tuple[object, ...]:
        import torch

        buffer = io.BytesIO()
        torch.jit.save(self._module, buffer)
        return _with_module, (self.content, self.path, buffer.getvalue())

    def reset(self) -> None:
        self._module = _module(self.content, self.path)

    def act(self, observation: np.ndarray) -> np.ndarray:
        import torch

        with torch.inference_mode():
            action = self._module(torch.from_numpy(observation)[None])
        return action.double().numpy().ravel()


def _module(content: bytes, path: Path) -> Callable[..., Any]:
    import torch

    try:
        return torch.jit.load(io.BytesIO(content), map_location="cpu").train(False)
    except Exception as error:
        raise ConfigError(f"is no TorchScript ({error})", source=path) from None


def _with_module(content: bytes, path: Path, module: bytes) -> ScriptNetwork:
    network = ScriptNetwork(content, path)
    network._module = _module(module, path)
    return network
