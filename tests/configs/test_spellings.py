"""configs/spellings.py: older names are read, once with a line that names them."""

from __future__ import annotations

import warnings

import pytest

from poise.configs.errors import PoiseWarning
from poise.configs.spellings import respelled

NAMES = {"told": "commanded", "full": "saturated"}


def test_older_names_are_read_at_any_depth() -> None:
    """With one warning for all of them; what has the present name, too, keeps both."""
    old = {"told": 1, "walks": [{"full": 2}, {"full": 3, "saturated": 4}], "x": None}
    with pytest.warns(PoiseWarning) as caught:
        new = respelled(old, NAMES, "a.json")
    assert new == {
        "commanded": 1, "walks": [{"saturated": 2}, {"full": 3, "saturated": 4}], "x": None,
    }  # fmt: skip
    assert old["told"] == 1 and list(new) == ["commanded", "walks", "x"]
    (said,) = [str(each.message) for each in caught]
    assert said.startswith("a.json: ") and "'told' is now 'commanded', 'full' is now" in said


def test_names_of_a_user_stay() -> None:
    """So do files of today, without a warning."""
    entries = {"controllers": {"told": {"full": 1}}}
    with pytest.warns(PoiseWarning):
        assert respelled(entries, NAMES, "a", free="controllers") == {
            "controllers": {"told": {"saturated": 1}}
        }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for same in ({"commanded": 1}, [], None, "told", {"controllers": {"told": 1}}):
            assert respelled(same, NAMES, "a", free="controllers") == same
