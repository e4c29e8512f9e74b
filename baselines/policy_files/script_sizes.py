"""What TorchScript takes and gives, which its file does not say: it is asked."""

from pathlib import Path

from poise.configs.reading import read_bytes

from .networks import script_module
from .onnx.files import BYTES


def script_sizes(path: Path) -> tuple[int | None, int | None]:
    """The numbers that TorchScript takes and gives; None where that cannot be found out.

    Nothing in the file says them, and the order of its weights is that of their names: an LSTM
    before the layers may come behind them. So it is asked with each size that one of its weights
    could take, with an axis for a batch and without. A module that takes a memory, too, cannot be
    asked so: what its recurrent layer takes, or its first matrix, and its last layer tell.

    It runs: ask `check_allowed` before.
    """
    module = script_module(read_bytes(path, BYTES), path)
    weights = {name: each.shape for name, each in module.state_dict().items()}
    # a normaliser's mean, the weights of a recurrent layer, those of a layer
    sizes = dict.fromkeys(shape[-1] for shape in weights.values() if len(shape) in (1, 2, 3))
    for size in sorted(sizes, key=lambda size: size == 1):  # one number goes with any mean
        for batch in ((1,), ()):
            given = _answer_size(path, (*batch, size))
            if given is not None:
                return size, given
    matrices = {name: shape for name, shape in weights.items() if len(shape) == 2}
    recurrent = [shape for name, shape in matrices.items() if "weight_ih" in name]
    layers = [shape for name, shape in matrices.items()
              if "weight_ih" not in name and "weight_hh" not in name]  # fmt: skip
    first, last = (recurrent + layers)[:1], layers[-1:]
    return (first[0][1] if first else None), (last[0][0] if last else None)


def _answer_size(path: Path, shape: tuple[int, ...]) -> int | None:
    """The numbers of the first answer to zeros of a shape; None where it does not take them."""
    import torch

    module = script_module(read_bytes(path, BYTES), path)  # resets one that is recurrent
    kinds = (value.dtype for value in module.parameters())
    kind = next((each for each in kinds if each.is_floating_point), torch.float32)
    try:
        with torch.inference_mode():
            found = module(torch.zeros(shape, dtype=kind))
    except Exception:  # of other sizes, or it takes more than an observation
        return None
    first = found[0] if isinstance(found, (tuple, list)) else found
    return int(first.numel()) if isinstance(first, torch.Tensor) else None
