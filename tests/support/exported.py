"""Policies to export, one of them spoiled, and one that is exported already."""

from __future__ import annotations

import copy
import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest

from poise.training.deploy.export.export import export_policy
from poise.training.learning.policy import Policy, load_policy
from tests.support.shared import finished_run, policies_here, robot, robot_of

pytest.importorskip("safetensors", reason="exports policies: pip install 'poise[export]'")
pytest.importorskip("onnxruntime", reason="plays ONNX files: pip install 'poise[onnx]'")
SHIPPED = policies_here()
SYMMETRIC = "residual-step"


@functools.cache
def policy(name: str) -> Policy:
    """A packaged policy, or that of a small training run."""
    if name == "run":
        return load_policy(finished_run(), robot())
    return load_policy(name, robot(robot_of(name)))


@functools.cache
def exported() -> Path:
    """The folder of `SYMMETRIC`, exported; do not write into it."""
    _folders.append(tempfile.TemporaryDirectory(prefix="poise-export-"))
    out = Path(_folders[-1].name) / "policy"
    assert export_policy(SYMMETRIC, out) <= 1e-6
    return out


def spoiled(policy: Policy, layer: int, entry: float) -> Policy:
    """The policy with another number in one of its weights."""
    other = copy.copy(policy)
    other.layers = [(weight.copy(), bias.copy()) for weight, bias in policy.layers]
    weight = other.layers[layer][0]
    row, column = np.unravel_index(np.abs(weight).argmax(), weight.shape)
    weight[row, column] += entry
    return other


_folders: list[tempfile.TemporaryDirectory] = []  # removed at the end of the process
