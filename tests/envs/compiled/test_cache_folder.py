"""envs/compiled/cache_folder.py: kernels are kept where nobody else can put any."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from poise.envs.compiled import cache_folder
from poise.envs.compiled.cache_folder import KEPT, file_folder, kernel_folder


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which a user may have caches, while nothing can be written beside the sources."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(cache_folder, "_BESIDE", tmp_path / "file")
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path


def test_the_first_folder_that_can_be_written(room: Path, monkeypatch) -> None:
    """First NUMBA_CACHE_DIR, then beside the sources, then the user's caches, then none."""
    folder, _ = kernel_folder([])
    assert folder is not None and folder.parent == room / "caches" / "poise"
    monkeypatch.setenv("XDG_CACHE_HOME", str(room / "file"))
    assert kernel_folder([])[0] is None
    monkeypatch.setattr(cache_folder, "_BESIDE", room / "beside")
    assert kernel_folder([])[0].parent == room / "beside"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(room / "numba"))
    assert kernel_folder([])[0].parent == room / "numba" / "poise"


def test_it_is_closed_to_others(room: Path) -> None:
    """Whatever the umask says: it, and what had to be made above it."""
    before = os.umask(0)
    try:
        folder, _ = kernel_folder([])
    finally:
        os.umask(before)
    for place in (folder, folder.parent, folder.parent.parent):
        assert place.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("place", ["caches", "caches/poise", "caches/poise/NAME"])
def test_a_folder_that_others_may_write_is_refused(room: Path, place: str) -> None:
    """The folder itself, or one above, in which it could be exchanged for another."""
    folder, _ = kernel_folder([])
    open_place = room / place.replace("NAME", folder.name)
    open_place.chmod(0o777)
    assert kernel_folder([]) == (
        None, f"{folder.parent}: others may write to {open_place}"
    )  # fmt: skip


def test_a_folder_of_somebody_else_is_refused(room: Path, monkeypatch) -> None:
    """Also if it is closed."""
    folder, _ = kernel_folder([])
    if os.geteuid() == 0:
        os.chown(folder.parent, 54321, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 54321)
    folder, problem = kernel_folder([])
    assert folder is None and "belongs to another user" in problem


def test_a_link_is_no_folder(room: Path) -> None:
    """In the place of the folder; a link to all caches is the user's business."""
    folder, _ = kernel_folder([])
    folder.rename(room / "elsewhere")
    folder.symlink_to(room / "elsewhere")
    assert kernel_folder([])[1].endswith(f"{folder} is no folder")
    (room / "caches").rename(room / "disk")
    (room / "caches").symlink_to(room / "disk")
    (room / "disk" / "poise" / folder.name).unlink()
    assert kernel_folder([])[0] == room / "disk" / "poise" / folder.name


def test_none_below_the_working_folder(room: Path, monkeypatch) -> None:
    """That is a stranger's, perhaps; unless the user's home lies there, too, or the sources do."""
    monkeypatch.chdir(room)
    monkeypatch.setenv("HOME", "/nowhere")
    assert kernel_folder([])[1] == f"{room}/caches/poise: lies below the working folder"
    assert not (room / "caches").exists()
    monkeypatch.setattr(cache_folder, "_BESIDE", room / "beside")
    assert kernel_folder([])[0].parent == room / "beside"
    monkeypatch.setattr(cache_folder, "_BESIDE", room / "file")
    for home in (room, room / "home"):
        monkeypatch.setenv("HOME", str(home))
        assert kernel_folder([])[0].parent == room / "caches" / "poise"


@pytest.mark.parametrize("caches", ["~/.cache", "caches", "./caches"])
def test_a_relative_folder_is_refused(room: Path, monkeypatch, caches: str) -> None:
    """It would be another one for each working folder; `~` stays where there is no home."""
    monkeypatch.setenv("XDG_CACHE_HOME", caches)
    assert kernel_folder([])[1] == f"{Path(caches)}/poise: is no absolute path"


def test_without_a_cache_one_line_says_so(tmp_path: Path) -> None:
    """When something compiles; and it compiles."""
    code = (
        "from poise.envs.compiled import jit; jit.patience.tell('a pendulum'); "
        "from poise.envs.compiled.maths.pendulum import compiled_rate; "
        "print(compiled_rate(9.81, 1.0))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"NUMBA_CACHE_DIR": "here"}, cwd=tmp_path,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    why = "no kernels are kept: here/poise: is no absolute path"
    assert done.stderr == f"poise: compiling a pendulum, in every process again: {why}\n"
    assert float(done.stdout) > 3.0 and not list(tmp_path.iterdir())


def test_folders_do_not_pile_up(tmp_path: Path, monkeypatch) -> None:
    """Of each file the last ones used stay; of other files all."""
    digest = iter(range(100))
    monkeypatch.setattr(cache_folder, "source_digest", lambda file: f"{next(digest):016}")
    folders = []
    for _ in range(KEPT + 2):
        file_folder.cache_clear()
        folders.append(file_folder(tmp_path, "/x/room/a.py"))
        file_folder(tmp_path, "/x/room/b.py")
        for at, each in enumerate(folders):
            if each.exists() and at != 1:
                os.utime(each, (at, at))
    file_folder.cache_clear()
    # the second has just been used, all others long ago
    assert [each.exists() for each in folders] == [False, True, False] + [True] * (KEPT - 1)
    assert len(list(tmp_path.glob("room.b-*"))) == KEPT
