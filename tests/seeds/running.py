"""Commands of rows, run: in this process, where they begin at once, or in one of their own."""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from .rows import ROOT, Row, Run

WIDE = {"COLUMNS": "200", "TERM": "dumb", "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'src'}"}


def prepare(folder: Path) -> Path:
    """A folder that has what the commands read; what they write stays in it."""
    for name in ("configs", "docs", "tests"):
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    return folder


def run_alone(run: Run, folder: Path) -> tuple[int, str]:
    """The exit code and the output of a command in a process of its own."""
    words = shlex.split(run.run)
    poise = [str(Path(sys.executable).with_name("poise"))]
    program = poise if words[0] == "poise" else [sys.executable]
    place = ROOT if words[1:3] == ["-m", "pytest"] else folder
    done = subprocess.run(
        [*program, *words[1:]], cwd=place, env={**os.environ, **WIDE}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def run_here(run: Run, folder: Path) -> tuple[int, str]:
    """The same of a command of `poise`, in this process."""
    from poise.training.cli.entry import main

    words, output = shlex.split(run.run), io.StringIO()
    assert words[0] == "poise", run
    kept = {name: os.environ.get(name) for name in WIDE}
    os.environ |= WIDE
    try:
        with contextlib.chdir(folder), contextlib.redirect_stdout(output):
            code = main(words[1:])
    finally:
        for name, value in kept.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return code, output.getvalue()


def faults(run: Run, code: int, output: str) -> Iterator[str]:
    """What a command does not do as its row says."""
    if code != run.exit:
        yield f"{run.run}: exit code {code}, not {run.exit}\n{output[-2000:]}"
        return
    for figure in run.figures:
        try:
            value = figure.read(output)
        except ValueError as error:
            yield f"{run.run}: {error}"
            continue
        if not figure.holds(value):
            yield (f"{run.run}: {figure.reads!r} is {value:g}, not {figure.is_:g} ± "
                   f"{figure.within:g} {figure.unit}")  # fmt: skip


def runs_of(rows: Iterable[Row], *, daily: bool = False) -> list[Run]:
    """Commands of rows in order, each once, with the figures of all rows that have it."""
    runs: dict[str, Run] = {}
    for run in (run for row in rows for run in row.runs if run.daily or not daily):
        before = runs.get(run.run, run)
        runs[run.run] = replace(run, figures=tuple(dict.fromkeys(before.figures + run.figures)))
    return list(runs.values())
