"""A policy's numbers as safetensors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from poise.training.learning.policy import ACTOR, Policy

from .libraries import library
from .onnx_graph import narrowed


def tensors(policy: Policy) -> dict[str, np.ndarray]:
    """All numbers that decide the policy's actions, by name.

    The actor's layers have the names and the shape (out, in) that they have in SB3's state_dict.
    `observation.mean`, `.scale` (no,) and `.clip` () normalise; a symmetric policy has `.order` and
    `.sign` of its mirror images, for `observation.` and `action.`. Weights have 32 bits where these
    hold them exactly, as those of every policy that was trained here.
    """
    *hidden, (weight, bias) = policy.layers
    found = {"action_net.weight": weight.T, "action_net.bias": bias}
    for i, (weight, bias) in enumerate(hidden):  # the activations between them count, too
        found |= {f"{ACTOR}{2 * i}.weight": weight.T, f"{ACTOR}{2 * i}.bias": bias}
    found = {name: np.ascontiguousarray(narrowed(values)) for name, values in found.items()}
    found["observation.mean"], found["observation.scale"] = policy.mean, policy.scale
    found["observation.clip"] = np.array(policy.clip)
    for side, mirror in zip(("observation", "action"), policy.mirrors or (), strict=False):
        found[f"{side}.order"] = mirror.order.astype(np.int64)
        found[f"{side}.sign"] = mirror.sign
    return found


def safetensors_bytes(policy: Policy, metadata: Mapping[str, str]) -> bytes:
    """The file of `tensors` with these metadata; the same policy gives the same bytes."""
    return bytes(library("safetensors.numpy").save(tensors(policy), metadata=dict(metadata)))
