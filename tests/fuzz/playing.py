"""Playing one case: what came of it, how long it took, how much memory."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import mujoco
import numpy as np

import poise
from poise.configs.errors import PoiseError
from poise.envs.viewing.offscreen import OffScreen

from . import memory
from .kinds import Kind
from .values import Json

SECONDS = 8.0  # of the processor that a case may take, but for what OpenGL draws without a GPU
MEBIBYTES = 1024.0  # that a case may take besides what the process has
TEXT = 5000  # characters of an error; some list the choices
ROOT = Path(poise.__file__).parents[2]


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes:
        verdict: worked, refused (a PoiseError), traceback, hang, crash or memory.
        what: for those that must not be, what and where; equal for the same fault.
        seconds: of the processor.
        mebibytes: by which the memory in use grew at its peak.
        details: the traceback.
    """

    verdict: str
    what: str = ""
    seconds: float = 0.0
    mebibytes: float = 0.0
    details: str = ""

    @property
    def good(self) -> bool:
        return self.verdict in ("worked", "refused")


@contextlib.contextmanager
def _drawing() -> Iterator[list[float]]:
    """A list that gets the processor's seconds of each picture that is drawn meanwhile."""
    draw, drawn = OffScreen.draw, list[float]()

    def timed(screen: OffScreen, scene: mujoco.MjvScene) -> np.ndarray:
        started = time.process_time()
        try:
            return draw(screen, scene)
        finally:
            drawn.append(time.process_time() - started)

    with mock.patch.object(OffScreen, "draw", timed):
        yield drawn


def play(kind: Kind, case: Json) -> Outcome:
    """Play a case here and now; only what ends the process or does not end is not seen."""
    memory.reset_peak()
    before, started = memory.in_use(), time.process_time()
    with _drawing() as drawn:
        verdict, what, details = _verdict(kind, case)
    seconds, grown = time.process_time() - started - sum(drawn), memory.peak() - before
    if verdict in ("worked", "refused") and seconds > SECONDS:
        verdict, what = "hang", f"{kind.name}: took {seconds:.0f} s"
    if verdict in ("worked", "refused") and grown > MEBIBYTES:
        verdict, what = "memory", f"{kind.name}: took {grown:.0f} MiB"
    return Outcome(verdict, what, seconds, max(grown, 0.0), details)


def _verdict(kind: Kind, case: Json) -> tuple[str, str, str]:
    with _folder() as folder:
        try:
            _play_in(kind, case, folder)
        except PoiseError as error:
            problem = _bad_text(error)
            return ("traceback", problem, _trace(error)) if problem else ("refused", "", "")
        except MemoryError as error:
            return "memory", _where(error), _trace(error)
        except (Exception, SystemExit) as error:
            return "traceback", _where(error), _trace(error)
    return "worked", "", ""


def _play_in(kind: Kind, case: Json, folder: Path) -> None:
    with warnings.catch_warnings():
        if kind.name != "commands":  # where a warning would be a second line
            warnings.simplefilter("ignore")
        try:
            kind.play(case, folder)
        finally:
            parts = [path.name for path in folder.rglob("*.part")]
    assert not parts, "a file is half-written"


def _bad_text(error: PoiseError) -> str:
    """What is wrong with the text of an error, if anything."""
    text = str(error)
    if "\n" in text:
        return f"an error of several lines: {_where(error)}"
    return f"an error of {TEXT} characters or more: {_where(error)}" if len(text) >= TEXT else ""


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    """An empty folder, which is the current one."""
    before, folder = Path.cwd(), Path(tempfile.mkdtemp(prefix="case-"))
    os.chdir(folder)
    try:
        yield folder
    finally:
        os.chdir(before)
        shutil.rmtree(folder, ignore_errors=True)


def _where(error: BaseException) -> str:
    """The error's class and the innermost line of this project, without the fuzzer's own."""
    own = [f for f in traceback.extract_tb(error.__traceback__) if _of_project(f.filename)]
    inside = [f for f in own if "/tests/" not in f.filename] or own
    place = f"{Path(inside[-1].filename).relative_to(ROOT)}:{inside[-1].lineno}" if inside else ""
    said = f" ({str(error).splitlines()[0][:60]})" if isinstance(error, AssertionError) else ""
    return f"{type(error).__name__}{said} at {place}"


def _of_project(path: str) -> bool:
    return path.startswith(f"{ROOT}/") and "/.venv/" not in path


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error, limit=-12, chain=False))[-4000:]
