"""The libraries that an export needs besides Poise's own; named once, where they are missing."""

import importlib
from typing import Any

from poise.configs.errors import ConfigError
from poise.configs.extras import how_to_install

NAMES = ("onnx", "onnxruntime", "safetensors")


def check_libraries() -> None:
    """Raise ConfigError, saying how to get them, unless all `NAMES` can be imported."""
    for name in NAMES:
        library(name)


def library(name: str, extra: str = "export") -> Any:
    """A module of one of `NAMES`, or of another `extra`; raises ConfigError where it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.split(".")[0]
        raise ConfigError(
            f"needs the package {package}: {how_to_install(extra)}", source=extra
        ) from None
