"""Checkpoints of a training, which are often taken for the network that was trained."""

import zipfile
from pathlib import Path

from poise.configs.errors import ConfigError

PICKLE = b"\x80"  # the first byte of one
SAVED = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."  # that torch.save began with before PyTorch 1.6
DATA, CONSTANTS = "data.pkl", "constants.pkl"  # of torch.save and torch.jit.save; the latter only


def check_no_checkpoint(path: Path) -> None:
    """Raise ConfigError, about the file, for weights without a network. Nothing of it is run.

    A file that cannot be opened, or is something else, is left to those that read it.
    """
    try:
        with open(path, "rb") as file:
            first = file.read(len(SAVED))
        pickled = first[:1] == PICKLE
        names = () if pickled else _names(path)
    except (OSError, ValueError):
        return
    if pickled or (DATA in names and CONSTANTS not in names):
        what = "a pickle" if pickled and first != SAVED else "a checkpoint of weights"
        raise ConfigError(f"is {what}, without a network: export the policy as ONNX or TorchScript "
                          "with the program that trained it", source=path)  # fmt: skip


def _names(path: Path) -> set[str]:
    """Names in an archive, without their folders."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.rpartition("/")[2] for name in archive.namelist()}
    except (zipfile.BadZipFile, NotImplementedError):
        return set()
