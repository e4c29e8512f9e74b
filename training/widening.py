"""A larger network that begins as a smaller one: the same function, units to spare [Chen16]."""

from collections.abc import Mapping

import torch


def widened(
    small: Mapping[str, torch.Tensor], large: Mapping[str, torch.Tensor]
) -> dict[str, torch.Tensor]:
    """Weights of the network `large` with which it computes what `small` does.

    Weights W (out, in) and biases (out,) of both, of as many layers. The units that are new keep
    what comes in as initialised in `large`; nothing goes out of them yet: their columns are zero.

    Raises:
        ValueError: other layers, or a layer of `small` that is larger.
    """
    if small.keys() != large.keys():
        raise ValueError("has other layers")
    weights = {}
    for name, old in small.items():
        new = large[name].clone()
        if old.dim() != new.dim() or any(o > n for o, n in zip(old.shape, new.shape, strict=True)):
            raise ValueError(f"{name} has shape {tuple(old.shape)}, not {tuple(new.shape)} or less")
        if old.dim() == 2:
            new[: old.shape[0]] = 0.0
        new[tuple(slice(length) for length in old.shape)] = old
        weights[name] = new
    return weights
