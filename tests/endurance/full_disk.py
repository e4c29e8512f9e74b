"""A disk that is full, as root: `python -m tests.endurance.full_disk`.

Each command writes to a disk in memory that holds but a part of what it needs. The bar: one line
that names a file, exit code 2, whole files; and once there is space the same command goes on to the
result of an undisturbed run, byte by byte but for what `commands.py` names.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .commands import Command, commands
from .kills import Undisturbed, look_at_files, stopped_runs
from .processes import Running

PAGE = 4096  # [bytes] what the smallest file takes
PLENTY = 2**28  # [bytes]


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", nargs="*", default=[])
    options.add_argument("--parts", nargs="*", type=float, default=[0.0, 0.3, 0.6, 0.9])
    given = options.parse_args(arguments)
    failed = 0
    with tempfile.TemporaryDirectory(prefix="poise-full-") as folder:
        room = Path(folder)
        whole = Undisturbed(room)
        for command in commands(room):
            if given.only and command.name not in given.only:
                continue
            whole.run(command)
            for part in given.parts:
                failed += not _case(command, part, whole)
    return 1 if failed else 0


def _case(command: Command, part: float, whole: Undisturbed) -> bool:
    """Print how it went."""
    need = _bytes(whole.room / "whole" / command.name)
    size = max(PAGE, int(part * need) // PAGE * PAGE)
    try:
        with _disk(whole.room / "disk", size) as disk:
            told = _fill_and_go_on(command, disk, whole)
    except Exception as error:
        print(f"{command.name}, {size} of {need}: FAILED: {type(error).__name__}: {error}")
        return False
    print(f"{command.name}, {size} of {need} bytes: {told}", flush=True)
    return True


def _fill_and_go_on(command: Command, disk: Path, whole: Undisturbed) -> str:
    """Raises AssertionError for whatever is not as it should be."""
    out = disk / "out"
    running = Running(command.line(out))
    code = running.wait()
    told = [line for line in running.output.splitlines() if line.startswith("poise: ")]
    assert code == 2 and "Traceback" not in running.output, f"{code}: {running.output[-3000:]}"
    assert len(told) == 1 and "No space left" in told[0], running.output[-3000:]
    assert running.left(0.0) == 0
    look_at_files(out)
    stopped = stopped_runs(command, out, whole.room / "stopped") if out.exists() else {}
    subprocess.run(["mount", "-o", f"remount,size={PLENTY}", str(disk)], check=True)
    again = Running(command.line(out))
    assert again.wait() == 0, again.output[-3000:]
    result, expected = command.result(out), whole.result(command, stopped)
    differing = [key for key in expected if result[key] != expected[key]]
    assert not differing, f"differ: {differing}"
    left = [path.name for path in out.rglob(".*")]
    assert not left, f"left behind: {left}"
    return told[0]


@contextmanager
def _disk(path: Path, size: int) -> Iterator[Path]:
    path.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path)], check=True)
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", str(path)], check=True)
        path.rmdir()


def _bytes(folder: Path) -> int:
    """What it takes on a disk in memory."""
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    return sum(-(-size // PAGE) * PAGE for size in sizes)


if __name__ == "__main__":
    sys.exit(main())
