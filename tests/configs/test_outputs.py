"""configs/outputs.py: what cannot be written is refused, and nothing is made."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from poise.configs import outputs
from poise.configs.errors import WriteError
from poise.configs.outputs import check_out_file, check_out_folder
from tests.support.refused import invalid


def test_what_can_be_written_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders above it need not be there; a path may be relative."""
    monkeypatch.chdir(tmp_path)
    for out in (tmp_path, tmp_path / "a/b", Path("c"), Path("d/e")):
        check_out_folder(out)
        check_out_file(out / "f.json")
    assert list(tmp_path.iterdir()) == []


def test_the_wrong_kind(tmp_path: Path) -> None:
    """A file is no folder, a folder no file, and in a file there is nothing."""
    file = tmp_path / "file"
    file.write_text("mine")
    with invalid("out", source="file"):
        check_out_folder(file)
    with invalid("plot", source=str(tmp_path)):
        check_out_file(tmp_path, "plot")
    for check in (check_out_folder, check_out_file):
        with pytest.raises(WriteError) as caught:
            check(file / "a/b")
        assert (caught.value.path, caught.value.reason) == (str(file / "a/b"), "Not a directory")
        with invalid("out", r"'a\x00b'"):
            check("a\0b")
        with invalid("out", "must not be empty"):
            check("")


def test_where_nothing_may_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest folder that is there decides; the superuser may everywhere."""
    asked: list[object] = []

    def access(path: Path, mode: int) -> bool:
        asked.append(path)
        assert mode == os.W_OK | os.X_OK
        return False

    monkeypatch.setattr(outputs.os, "access", access)
    with pytest.raises(WriteError) as caught:
        check_out_folder(tmp_path / "a/b")
    assert (caught.value.path, caught.value.reason) == (str(tmp_path / "a/b"), "Permission denied")
    assert asked == [tmp_path]
