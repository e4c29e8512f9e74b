"""training/running/folder_lock.py: one process at a time writes to a folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from poise.configs.errors import PoiseError
from poise.configs.files import write_atomic
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.learning.seeds.train import train_seeds
from poise.training.learning.train import train
from poise.training.learning.tuning.search import tune
from poise.training.learning.tuning.tasks import TuneConfig, TuningPushes
from poise.training.running.folder_lock import HOLDER, FolderLock
from tests.support.shared import tiny_config

HOLD = """
import sys
from pathlib import Path
from poise.training.running.folder_lock import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def test_who_holds_a_folder_is_named_and_a_dead_process_blocks_nobody(tmp_path: Path) -> None:
    """Its number and its command, while it lives; killed, it leaves nothing that matters."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "out")]
    holder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None and holder.stdin is not None
    with holder.stdout, holder.stdin:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(PoiseError, match=rf"process {holder.pid} \(-c .*out\) is writing"):
            FolderLock(tmp_path / "out")
        holder.kill()
        holder.wait()
    assert (tmp_path / "out" / HOLDER).exists()
    with FolderLock(tmp_path / "out"):
        assert (tmp_path / "out" / HOLDER).read_text().startswith(f"{os.getpid()}\n")
        with pytest.raises(PoiseError, match=f"process {os.getpid()} "):
            FolderLock(tmp_path / "out")
    assert (tmp_path / "out").is_dir() and not list((tmp_path / "out").iterdir())


def test_nothing_stays_of_a_lock(tmp_path: Path) -> None:
    """Nor of the folder that it has made, unless something was written there."""
    FolderLock(tmp_path / "out").release()
    assert not (tmp_path / "out").exists()
    with FolderLock(tmp_path / "out"):
        (tmp_path / "out/file").write_text("mine")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["file"]


def test_half_files_of_dead_processes_go(tmp_path: Path) -> None:
    """Those of living processes and of others stay."""
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    names = {".trials.csv.{}.part", ".film.{}.part.mp4"}
    for name in names:
        for process in (dead.pid, os.getpid()):
            (tmp_path / name.format(process)).write_text("half")
    (tmp_path / ".notes.part").write_text("mine")
    with FolderLock(tmp_path):
        pass
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {".notes.part", *(name.format(os.getpid()) for name in names)}


def test_every_command_that_writes_to_a_folder_holds_it(tmp_path: Path) -> None:
    """The second is refused, and writes nothing. (`benchmark`: evaluation/test_folder.py.)"""
    out = tmp_path / "out"
    search = TuneConfig(
        controller="momentum-qp", gains={"com.stiffness": (0.2, 12.0)},
        pushes=TuningPushes(directions=(0.0,), levels=(1.0,), seconds=1.0),
    )  # fmt: skip
    with FolderLock(out):
        for call in (
            lambda: evaluate(["zero"], "quiet", out=out, trials=1, workers=1),
            lambda: train(tiny_config(), out, progress=False),
            lambda: train_seeds(tiny_config(), [0], out),
            lambda: tune(search, out),
        ):
            with pytest.raises(PoiseError, match=f"out: process {os.getpid()} .*is writing there"):
                call()
        assert [path.name for path in out.iterdir()] == [HOLDER]


@pytest.mark.parametrize("there", [True, False])
def test_nothing_is_written_through_a_link(tmp_path: Path, there: bool) -> None:
    """That a received folder holds in place of the lock's file or of a half file."""
    mine, out = tmp_path / "mine", tmp_path / "out"
    out.mkdir()
    if there:
        mine.write_text("mine")
    (out / HOLDER).symlink_to(mine)
    with pytest.raises(PoiseError, match=rf"out/{HOLDER}: is a link"):
        FolderLock(out)
    assert (out / HOLDER).is_symlink()
    (out / HOLDER).unlink()
    (out / f".file.{os.getpid()}.part").symlink_to(mine)
    write_atomic(out / "file", "new")
    assert (out / "file").read_text() == "new" and not (out / "file").is_symlink()
    assert mine.read_text() == "mine" if there else not mine.exists()


def test_a_pipe_in_place_of_the_locks_file_is_not_waited_for(tmp_path: Path) -> None:
    """Neither to write nor to read who holds the folder."""
    os.mkfifo(tmp_path / HOLDER)
    with FolderLock(tmp_path):
        with pytest.raises(PoiseError, match="another process is writing there"):
            FolderLock(tmp_path)
