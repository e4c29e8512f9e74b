"""Small commands of a few seconds each, and what of their results must never differ.

Not compared, as it tells of the run and not of its outcome: in summary.json and seeds.json the
`command`, `versions`, `machine`, `workers`, `backend`, `commit`, `seconds` and `tick_us`; the order
of lines in trials.jsonl; report.html; tensorboard/.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from poise.configs.schema import to_yaml
from poise.training.learning.checkpoints import read_state
from poise.training.learning.policy_files import STATE, find_checkpoint
from tests.support.benchmarks_small import SMALL
from tests.support.evaluations import random_suite
from tests.support.shared import tiny_config

RUN = ("command", "versions", "machine", "workers", "backend", "commit", "seconds", "tick_us")
WORKERS = "2"
WALKS = {
    "duration": 3.0,
    "walk": {"commands": [{"ahead": 0.0}, {"ahead": 0.4}], "trials": 8},
}
TUNING = {
    "controller": "momentum-qp",
    "gains": {"com.stiffness": [0.2, 12.0], "com.offset": [-0.06, 0.06]},
    "pushes": {"directions": [0.0, 180.0], "levels": [1.0], "seconds": 1.5},
    "generations": 6,
    "population": 6,
}


@dataclass(frozen=True)
class Command:
    """A command line but for its folder; `kept` counts what a stop must not lose."""

    name: str
    arguments: tuple[str, ...]
    result: Callable[[Path], dict[str, Any]]
    kept: Callable[[Path], int]
    resumes: Callable[[Path], bool] = lambda out: False  # whether it wants --resume there
    has_workers: bool = True
    file: str = ""  # that is written in the folder, where the command wants no folder

    def line(self, out: Path) -> list[str]:
        """To start, or to go on."""
        place = str(out / self.file) if self.file else str(out)
        return [*self.arguments, "--out", place, *(["--resume"] if self.resumes(out) else [])]


def commands(room: Path, trials: int = 60) -> list[Command]:
    """Writes their configurations to `room`."""
    small = {**SMALL, "mix": {"trials": trials // 3, "delay": [0.008]}}
    train = to_yaml(tiny_config(steps=1536))
    files = {
        "suite": yaml.safe_dump(random_suite(trials)),
        "small": yaml.safe_dump(small),
        "train": train,
        "tune": yaml.safe_dump(TUNING),
        "walks": yaml.safe_dump(WALKS),
    }
    for name, text in files.items():
        (room / f"{name}.yaml").write_text(text)
    both, workers = ("momentum-qp", "zero"), ("--workers", WORKERS)
    policies = ("residual", "residual-step")
    return [
        Command(
            "evaluate",
            ("evaluate", *both, "--suite", f"{room}/suite.yaml", "--seed", "3", *workers),
            _evaluation, lambda out: _lines(out / "trials.jsonl"),
        ),
        Command(
            "benchmark",
            ("benchmark", "--controllers", *both, "--suite", f"{room}/small.yaml", "--no-report",
             "--seed", "2", *workers),
            _benchmark, lambda out: _lines(out / "trials.jsonl"),
        ),
        Command(
            "tune", ("tune", "--config", f"{room}/tune.yaml", *workers),
            _files("gains.yaml", "history.jsonl", "config.yaml"),
            lambda out: _lines(out / "history.jsonl"), lambda out: (out / "config.yaml").exists(),
        ),
        Command(
            "train", ("train", "--config", f"{room}/train.yaml"), trained, _steps,
            lambda out: find_checkpoint(out / "last") is not None, has_workers=False,
        ),
        Command(
            "train --seeds",
            ("train", "--config", f"{room}/train.yaml", "--seeds", "0", "1", *workers),
            _seeds, lambda out: sum(_steps(folder) for folder in out.glob("seed-*")),
            lambda out: (out / "seeds.json").exists(),
        ),
        Command(
            "policies",
            ("evaluate", *policies, "--suite", f"{room}/suite.yaml", "--seed", "4", *workers),
            _evaluation, lambda out: _lines(out / "trials.jsonl"),
        ),
        Command(
            "walk", ("evaluate", "walk", "--suite", f"{room}/walks.yaml", "--seed", "1", *workers),
            _evaluation, lambda out: _lines(out / "trials.jsonl"),
        ),
        Command(
            "motion", ("motion", "import", "humanoid_punch"), _files("punch.npz"), lambda out: 0,
            has_workers=False, file="punch.npz",
        ),
    ]  # fmt: skip


def trained(out: Path) -> dict[str, Any]:
    """Weights, statistics and state of a run, and its evaluations."""
    found: dict[str, Any] = {"evaluations": _bytes(out / "evaluations.csv")}
    for name in ("best", "last"):
        content = checkpoint_content(out / name)
        found |= {f"{name} {kind}": value for kind, value in content.items()}
    return found


def checkpoint_content(folder: Path) -> dict[str, Any]:
    """Weights, statistics and state of a policy folder."""
    with zipfile.ZipFile(folder / "policy.zip") as archive:
        tensors = weights(archive.read("policy.pth"))
    with np.load(folder / "vecnormalize.npz") as data:
        moments = {key: data[key].tobytes() for key in data.files}
    return {"weights": tensors, "statistics": moments, "state": _bytes(folder / "state.json")}


def weights(content: bytes) -> str:
    """The hash of the tensors in a file of torch."""
    import torch

    tensors = torch.load(io.BytesIO(content), weights_only=True)
    parts = [f"{name}{tensor.numpy().tobytes().hex()}" for name, tensor in tensors.items()]
    return hashlib.sha256("".join(parts).encode()).hexdigest()


def _evaluation(out: Path) -> dict[str, Any]:
    plots = {path.name: path.read_bytes() for path in out.glob("*.png")}
    return {**_files("trials.csv", "settings.yaml")(out), **plots, "summary": _summary(out)}


def _benchmark(out: Path) -> dict[str, Any]:
    log = sorted((out / "trials.jsonl").read_bytes().splitlines())
    return {**_files("trials.csv", "settings.yaml")(out), "log": log, "summary": _summary(out)}


def _seeds(out: Path) -> dict[str, Any]:
    runs = {folder.name: trained(folder) for folder in sorted(out.glob("seed-*"))}
    return {**runs, "seeds": _without(json.loads((out / "seeds.json").read_text()))}


def _files(*names: str) -> Callable[[Path], dict[str, Any]]:
    return lambda out: {name: _bytes(out / name) for name in names}


def _bytes(path: Path) -> bytes:
    return path.read_bytes()


def _summary(out: Path) -> Any:
    return _without(json.loads((out / "summary.json").read_text()))


def _without(value: Any) -> Any:
    """What a summary says of the outcome."""
    if isinstance(value, dict):
        return {key: _without(entry) for key, entry in value.items() if key not in RUN}
    return [_without(entry) for entry in value] if isinstance(value, list) else value


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _steps(out: Path) -> int:
    """Of the last checkpoint."""
    checkpoint = find_checkpoint(out / "last")
    return 0 if checkpoint is None else int(read_state(checkpoint / STATE)["timesteps"])
