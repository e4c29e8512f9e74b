"""The network of a policy: numbers in, numbers out, with whatever it remembers in between."""

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from poise.baselines.allowance import is_script
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.extras import needing
from poise.configs.reading import read_bytes

from .config import NetworkMemory, PolicyFileConfig
from .onnx.bounds import RunOptions
from .onnx.files import BYTES

MEMORY = 10_000_000  # numbers that a network may remember, of each kind
#: ONNX's types of an input → NumPy's
TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64, "tensor(float16)": np.float16,
         "tensor(int64)": np.int64, "tensor(int32)": np.int32}  # fmt: skip


class Network(Protocol):
    """A policy's network: observations in, an action out, with a memory of its own."""

    def reset(self) -> None:
        """Forget the last trial: a new one begins."""

    def act(self, observations: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Its outputs (na,) by what they are, see `ROLES`, of the observation (n,) of each input.

        Raises whatever the library of the network raises.
        """

    def memories(self) -> dict[str, np.ndarray]:
        """What it remembers now, by the names of the inputs or of the buffers that hold it."""

    def remember(self, memories: Mapping[str, np.ndarray]) -> None:
        """Let it remember other numbers, as many as it does.

        Raises ConfigError for a memory that it does not have, and for another size.
        """


def load_network(path: Path, config: PolicyFileConfig | None = None) -> Network:
    """The network in an ONNX or a TorchScript file. TorchScript runs: ask `check_allowed` before.

    Its inputs, outputs and memory are those of `config`.

    Raises ConfigError naming the file: onnxruntime is missing, it cannot be read, has inputs that
    are neither said to be observations nor memory, lacks what is said, or its memory is huge.
    """
    config = config or PolicyFileConfig()
    if is_script(path):
        return ScriptNetwork(read_bytes(path, BYTES), path, config)
    return OnnxNetwork(path, config)


def onnx_session(path: Path) -> Any:
    """onnxruntime's session of a file, on one thread: results do not depend on the machine's."""
    with needing("onnx", path):
        import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
    except Exception as error:  # its classes are not public
        raise ConfigError(f"cannot be read by onnxruntime ({error})", source=path) from None


class OnnxNetwork:
    """A network in ONNX, run by onnxruntime; a recurrent one starts from zeros.

    Asking it raises PoiseError in one line where onnxruntime fails or takes too long, and where it
    remembers more than it did.
    """

    def __init__(self, path: Path, config: PolicyFileConfig | None = None):
        config = config or PolicyFileConfig()
        self.path, self.config = path, config
        self._session = onnx_session(path)
        outputs = [each.name for each in self._session.get_outputs()]
        given = {each.name: each for each in self._session.get_inputs()}
        # inputs with a value of their own: memory where it is said so, else numbers of the network
        optional = {each.name: each for each in self._session.get_overridable_initializers()}
        self._pairs = _pairs(given | optional, outputs, config.memory, path)
        given |= {name: each for name, each in optional.items() if name in self._pairs}
        self._memory = {name: _zeros(given[name], path) for name in self._pairs}
        self._inputs = {
            place: given[name]
            for place, name in _observed([*given], self._pairs, config, path).items()
        }
        self._roles = {role: _output(output, outputs, f"outputs.{role}", path)
                       for role, output in {"action": 0, **config.outputs}.items()}  # fmt: skip
        self._clocked = RunOptions()

    def __reduce__(self) -> tuple[object, ...]:
        return OnnxNetwork, (self.path, self.config), {"_memory": self._memory}

    @property
    def input_names(self) -> list[str]:
        """All inputs of the file."""
        return [each.name for each in self._session.get_inputs()]

    @property
    def output_names(self) -> list[str]:
        """All outputs of the file."""
        return [each.name for each in self._session.get_outputs()]

    def frame(self, step: int, outputs: Sequence[str]) -> list[np.ndarray]:
        """Outputs for the input `time_step`, zeros elsewhere; nothing is remembered."""
        given = {each.name: np.zeros([size if isinstance(size, int) and size > 0 else 1
                                      for size in each.shape], TYPES.get(each.type, np.float32))
                 for each in self._session.get_inputs()}  # fmt: skip
        given["time_step"][...] = step
        return [np.asarray(each, dtype=float).ravel()
                for each in self._session.run(list(outputs), given)]  # fmt: skip

    def reset(self) -> None:
        self._memory = {name: np.zeros_like(value) for name, value in self._memory.items()}

    def memories(self) -> dict[str, np.ndarray]:
        return {name: value.astype(float) for name, value in self._memory.items()}

    def remember(self, memories: Mapping[str, np.ndarray]) -> None:
        for name, values in memories.items():
            before = _same_size(self._memory, name, values, self.path)
            self._memory[name] = values.astype(before.dtype).reshape(before.shape)

    def act(self, observations: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        wanted = [*self._roles.values(), *self._pairs.values()]
        try:
            given = {self._inputs[place].name: _given(self._inputs[place], values)
                     for place, values in observations.items()}  # fmt: skip
        except ValueError as error:
            raise PoiseError(str(error)) from None
        try:
            with self._clocked.run() as options:
                found = self._session.run(wanted, {**given, **self._memory}, options)
            answer = {role: np.asarray(values, dtype=float).ravel()
                      for role, values in zip(self._roles, found, strict=False)}  # fmt: skip
        except Exception as error:  # of onnxruntime, or what comes back is no numbers
            raise PoiseError(f"{self.path}: cannot be asked ({error})") from None
        memory = dict(zip(self._pairs, found[len(self._roles) :], strict=True))
        for name, after in memory.items():
            if after.shape != self._memory[name].shape:
                raise PoiseError(f"{self.path}: {name}: remembers {_times(after.shape)} numbers, "
                                 f"not {_times(self._memory[name].shape)}")  # fmt: skip
        self._memory = memory
        return answer


def _same_size(known: Mapping[str, Any], name: str, values: np.ndarray, path: Path) -> Any:
    """The memory of a name, which is to be as large as these values."""
    if name not in known:
        raise ConfigError(f"{path.name} remembers nothing of that name", source=path, field=name,
                          choices=known)  # fmt: skip
    before = known[name]
    if math.prod(before.shape) != values.size:
        raise ConfigError(f"{path.name} remembers {_times(before.shape)} numbers, not "
                          f"{_times(values.shape)}", source=path, field=name)  # fmt: skip
    return before


def _times(shape: Sequence[object]) -> str:
    return " × ".join(map(str, shape))


def _pairs(
    inputs: Mapping[str, Any], outputs: Sequence[str], said: Sequence[NetworkMemory], path: Path
) -> dict[str, str]:
    """Input → the output that it is taken from in the next step."""
    pairs = {name: after for name in inputs for after in _after(name) if after in outputs}
    for i, memory in enumerate(said):
        if memory.input not in inputs:
            raise ConfigError(f"{path.name} has no input {memory.input!r}", source=path,
                              field=f"memory[{i}].input", choices=inputs)  # fmt: skip
        pairs[memory.input] = _output(memory.output, outputs, f"memory[{i}].output", path)
    return pairs


def _after(name: str) -> list[str]:
    """What the output that an input of this name is taken from may be called."""
    names = [name.removesuffix("_in") + "_out"] if name.endswith("_in") else []
    return names + (["output" + name.removeprefix("input")] if name.startswith("input_") else [])


def _output(output: str | int, outputs: Sequence[str], field: str, path: Path) -> str:
    """The name of an output."""
    if isinstance(output, int) and 0 <= output < len(outputs):
        return outputs[output]
    if output not in outputs:
        raise ConfigError(f"{path.name} has no output {output!r}", source=path, field=field,
                          choices=outputs)  # fmt: skip
    return str(output)


def _observed(
    names: Sequence[str], memory: Mapping[str, str], config: PolicyFileConfig, path: Path
) -> dict[str, str]:
    """Input of the description → that of the network; all but its memory are observations."""
    others = [name for name in names if name not in memory]
    said = list(config.inputs)
    if said == [""]:
        if len(others) != 1:
            raise ConfigError(
                f"must have one input, the observation, not {', '.join(others)}: say what each "
                "shows (observations: {NAME: [...]}), or which output it remembers (memory)",
                source=path,
            )
        return {"": others[0]}
    if lost := [name for name in others if name not in said]:
        raise ConfigError(f"what the input {lost[0]!r} shows is not said", source=path,
                          field="observations", choices=others)  # fmt: skip
    if unknown := [name for name in said if name not in others]:
        raise ConfigError(f"{path.name} has no such input: {unknown[0]!r}", source=path,
                          field="observations", choices=others)  # fmt: skip
    return {name: name for name in said}


def _given(about: Any, values: np.ndarray) -> np.ndarray:
    """Numbers as an input takes them: a size that is left open is 1, the last one what is left.

    Raises ValueError where they are more or less than it takes.
    """
    sizes = [size if isinstance(size, int) and size > 0 else 0 for size in about.shape]
    whole = math.prod(filter(None, sizes))
    if sizes and sizes[-1] == 0:
        sizes[-1] = max(1, len(values) // whole)
    sizes = [size or 1 for size in sizes]
    if math.prod(sizes) != len(values):
        whole = math.prod(sizes)
        steps = whole // max(1, len(values))
        many = f"; {whole} = {steps} × {len(values)}: a history of {steps} steps?"
        guess = many if steps > 1 and steps * len(values) == whole else ""
        raise ValueError(f"it takes {_times(sizes) or 1}{guess}")
    return values.astype(TYPES.get(about.type, np.float32)).reshape(sizes)


def _zeros(about: Any, path: Path) -> np.ndarray:
    """The memory at the start; a size that is left open is 1."""
    sizes = [size if isinstance(size, int) else 1 for size in about.shape]
    if min(sizes, default=0) < 0 or math.prod(sizes) > MEMORY:
        raise ConfigError(f"must be at most {MEMORY} numbers, not {_times(sizes)}",
                          source=path, field=about.name)  # fmt: skip
    return np.zeros(sizes, dtype=TYPES.get(about.type, np.float32))


class ScriptNetwork:
    """A network in TorchScript; a recurrent one is reloaded for every trial."""

    def __init__(self, content: bytes, path: Path, config: PolicyFileConfig):
        self.content, self.path, self.config = content, path, config
        for i, memory in enumerate(config.memory):
            if not memory.shape or math.prod(memory.shape) > MEMORY:
                raise ConfigError(f"needs a shape, of at most {MEMORY} numbers: TorchScript does "
                                  "not tell it", source=config.described_in or path,
                                  field=f"memory[{i}].shape")  # fmt: skip
        self.reset()

    def __reduce__(self) -> tuple[object, ...]:
        import torch

        buffer = io.BytesIO()
        torch.jit.save(self._module, buffer)
        given = self.content, self.path, self.config, buffer.getvalue(), self._memory
        return _with_module, given

    def reset(self) -> None:
        import torch

        self._module = script_module(self.content, self.path)
        kinds = (value.dtype for value in self._module.parameters())
        self._type = next((kind for kind in kinds if kind.is_floating_point), torch.float32)
        self._memory = [torch.zeros(each.shape, dtype=self._type) for each in self.config.memory]

    def _kept(self) -> dict[str, Any]:
        """What is given back, and the buffers in which a module keeps what it remembers itself."""
        given = zip((each.input for each in self.config.memory), self._memory, strict=True)
        return {**dict(self._module.named_buffers()), **dict(given)}

    def memories(self) -> dict[str, np.ndarray]:
        return {name: value.double().numpy().copy() for name, value in self._kept().items()}

    def remember(self, memories: Mapping[str, np.ndarray]) -> None:
        import torch

        kept = self._kept()
        for name, values in memories.items():
            before = _same_size(kept, name, values, self.path)
            before.copy_(torch.from_numpy(values.reshape(before.shape)).to(before.dtype))

    def act(self, observations: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        import torch

        given = [torch.from_numpy(values).to(self._type) for values in observations.values()]
        if self.config.batch:
            given = [values[None] for values in given]
        with torch.inference_mode():
            found = self._module(*given, *self._memory)
        found = found if isinstance(found, (tuple, list)) else (found,)
        self._memory = [found[_place(each.output)].clone() for each in self.config.memory]
        roles = {"action": 0, **self.config.outputs}
        return {role: found[_place(output)].double().numpy().ravel()
                for role, output in roles.items()}  # fmt: skip


def _place(output: str | int) -> int:
    """The place of an output of TorchScript, which has no names; raises ValueError for a name."""
    if not isinstance(output, int):
        raise ValueError(f"outputs of TorchScript have places, not names such as {output!r}")
    return output


def script_module(content: bytes, path: Path) -> Any:
    """The module in TorchScript, which runs; raises ConfigError naming the file that holds none."""
    import torch

    try:
        return torch.jit.load(io.BytesIO(content), map_location="cpu").train(False)
    except Exception as error:
        raise ConfigError(f"is no TorchScript ({error})", source=path) from None


def _with_module(
    content: bytes, path: Path, config: PolicyFileConfig, module: bytes, memory: list[Any]
) -> ScriptNetwork:
    network = ScriptNetwork(content, path, config)
    network._module, network._memory = script_module(module, path), memory
    return network
