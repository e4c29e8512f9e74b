"""What a training gives that is resumed from a checkpoint of an undisturbed run."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from poise.training.learning import callbacks
from poise.training.learning.checkpoints import read_state
from poise.training.learning.config import train_config
from poise.training.learning.policy_files import STATE, find_checkpoint
from poise.training.learning.train import train

from .commands import checkpoint_content, trained


class Resumed:
    """Undisturbed runs with all their checkpoints, made when they are first asked for."""

    def __init__(self, room: Path):
        self.room = room / "checkpoints"
        self.config = room / "train.yaml"
        self.found: dict[tuple[int, str], dict[str, Any]] = {}

    def result(self, stopped: Path | None, seed: int) -> dict[str, Any]:
        """Of the run that `stopped` copies; raises AssertionError if its checkpoint is another."""
        whole = self.room / str(seed)
        if not whole.exists():
            self._train(whole, seed)
        checkpoint = None if stopped is None else find_checkpoint(stopped / "last")
        if checkpoint is None:
            return trained(whole / "run")
        name = _name(checkpoint)
        own = whole / name / "last"
        assert own.exists(), f"an undisturbed run has no checkpoint {name}"
        assert checkpoint_content(checkpoint) == checkpoint_content(own), f"checkpoint {name}"
        if (seed, name) not in self.found:
            train(self._config(seed), whole / name, resume=True, progress=False)
            self.found[seed, name] = trained(whole / name)
            shutil.copytree(checkpoint, own, dirs_exist_ok=True)  # for the next comparison
        return self.found[seed, name]

    def _train(self, whole: Path, seed: int) -> None:
        save = callbacks.save_checkpoint

        def and_copy(folder: Path, *rest: Any) -> None:
            save(folder, *rest)
            if folder.name == "last":
                ignored = shutil.ignore_patterns("tensorboard", ".*")
                copy = whole / _name(folder)
                shutil.copytree(folder.parent, copy, ignore=ignored, dirs_exist_ok=True)

        with mock.patch.object(callbacks, "save_checkpoint", and_copy):
            train(self._config(seed), whole / "run", progress=False)

    def _config(self, seed: int) -> Any:
        return replace(train_config(self.config), seed=seed, threads=1)


def _name(checkpoint: Path) -> str:
    """Its steps and evaluations."""
    state = read_state(checkpoint / STATE)
    return f"{state['timesteps']}-{len(state['evaluations'])}"
