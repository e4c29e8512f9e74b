"""configs/errors.py: what an exception of a user's own code says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.configs.errors import raised
from poise.configs.schema import read_yaml

OWN = """import json
import numpy as np


def inner(x):
    return np.linalg.inv(x)


def outer(x):
    y = 2 * x
    return inner(y)


def of_a_library(x):
    return json.loads("{")


def of_poise(x):
    return read(x)
"""


@pytest.fixture
def own(tmp_path: Path) -> dict[str, Any]:
    """The names of a user's file."""
    names: dict[str, Any] = {"__name__": "mine", "read": read_yaml}
    exec(compile(OWN, str(tmp_path / "my file.py"), "exec"), names)
    return names


@pytest.mark.parametrize(
    ("function", "argument", "place"),
    [
        ("outer", np.zeros((2, 2)), "my file.py:6"),  # not in NumPy, which raised
        ("of_a_library", None, "my file.py:15"),
        ("of_poise", Path("nowhere.yaml"), "my file.py:19"),
    ],
)
def test_an_error_has_its_place_in_the_users_file(
    own: dict[str, Any], function: str, argument: Any, place: str
) -> None:
    """The last line of the user's that ran, whatever it called."""
    with pytest.raises(Exception) as error:
        own[function](argument)
    text = raised(error.value)
    assert text.endswith(f" ({place})") and text.startswith(f"{error.type.__name__}: ")
    assert "\n" not in text


def test_an_error_without_a_place() -> None:
    """One that nobody has raised."""
    assert raised(ValueError("a\nb")) == "ValueError: a b"
