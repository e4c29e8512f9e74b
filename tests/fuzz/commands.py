"""Command lines. Where a long run would begin it does not: all arguments were good."""

from __future__ import annotations

import contextlib
import io
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import stable_baselines3
from hypothesis import strategies as st

from poise.training.benchmarking.evaluation import run
from poise.training.cli import entry
from poise.training.deploy.qp_set import export
from poise.training.learning.seeds import train as train_seeds
from poise.training.learning.tuning import search
from poise.training.pictures.figures import video
from poise.training.pictures.report import page
from poise.training.pictures.view import view as viewing

from .samples import copy_sample
from .texts import Draw
from .values import Json

GOOD: list[list[str]] = [
    ["list"],
    ["demo", "--out", "out", "--workers", "1", "--seed", "0"],
    ["evaluate", "zero", "pd", "--suite", "quiet", "--out", "out", "--trials", "2"],
    ["evaluate", "zero", "--suite", "envelope", "--robot", "humanoid", "--overwrite"],
    ["evaluate", "momentum-qp", "--limits", "humanoid", "--write-limits", "limits.yaml"],
    ["evaluate", "residual", "--suite", "bad.yaml", "--workers", "1", "--seed", "3"],
    ["benchmark", "--out", "out", "--controllers", "zero", "--suite", "quick", "--trials", "1"],
    ["benchmark", "--out", "benchmark", "--backend", "local", "--workers", "2", "--overwrite"],
    ["compare", "evaluation", "benchmark"],
    ["compare", "benchmark", "benchmark"],
    ["leaderboard", "benchmark", "--page", "page.md"],
    ["replay", "evaluation", "--trial", "0", "--controller", "zero"],
    ["replay", "benchmark", "--trial", "1", "--plot", "plot.png", "--video", "film.mp4"],
    ["report", "evaluation", "--out", "page.html", "--no-films"],
    ["tune", "--out", "out", "--config", "momentum-qp", "--generations", "1", "--seed", "1"],
    ["tune", "--out", "out", "--controller", "momentum-qp", "--robot", "humanoid", "--resume"],
    ["qp-set", "--out", "out", "--count", "3", "--form", "full", "--controller", "momentum-qp"],
    ["train", "--out", "out", "--config", "torque", "--steps", "64", "--ppo.n-envs", "2"],
    ["train", "--out", "out", "--robot", "compact", "--seed", "1", "--threads", "1"],
    ["train", "--out", "out", "--ppo.n-envs", "2", "--env.duration", "1.0", "--resume"],
    ["train", "--out", "out", "--seeds", "1", "2", "--backend", "local", "--workers", "1"],
]
TOKENS = [
    *("", "-", "--", "-1", "0", "1", "1.5", "1e3", "nan", "inf", "99999999999999999999", "1000000"),
    *("humanoid", "compact", "residual", "zero", "pd", "capture-step", "nosuch", "nosuch.yaml"),
    *("nosuch:Class", "nosuch.py:Class", "evaluation", "benchmark", "bad.yaml", "latin.yaml", ".."),
    *(".", "/dev/null", "/dev/null/a", "/proc/nowhere/a", "x" * 300, "x" * 5000, "\u00e9\u4e2d"),
    *("\udcff", "a b", "a\nb", "*", "~", "%s", "--help", "--sede", "--seed", "--out", "--trials"),
    *("--workers", "--suite", "--robot", "--overwrite", "--resume", "--no-report", "--config"),
    *("--ppo.net-arch", "--env.pushes", "None", "--env.pushes:None", "True", "quick", "random"),
    *("--start-from", "--controller", "--gate", "--action", "step", "torque", "file", "-h", "--="),
]
COMMANDS = sorted(entry.COMMANDS)


class Begun(BaseException):
    """A long run would begin here."""


def _begin(*_: object, **__: object) -> Any:
    raise Begun


@st.composite
def cases(draw: Draw) -> Json:
    """The words of a good command line, one to three of them changed."""
    words = [*draw(st.sampled_from(GOOD))]
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(words)))
        change = draw(st.sampled_from(["replace", "replace", "replace", "add", "drop", "command"]))
        if change == "command":
            words[:1] = [draw(st.sampled_from(COMMANDS))]
        elif change == "drop" and len(words) > 1:
            del words[place : place + 1]
        else:
            words[place : place + (change == "replace")] = [draw(st.sampled_from(TOKENS))]
    return {"words": words}


@cache
def _stops() -> tuple[tuple[Any, str], ...]:
    """What long runs begin with."""
    return (
        (run, "Executor"), (search, "Executor"), (train_seeds, "Executor"),
        (stable_baselines3.PPO, "learn"), (export, "recoveries"), (page, "film_again"),
        (video, "record"), (viewing, "_serve"),
    )  # fmt: skip


def play(case: Json, folder: Path) -> None:
    """Run it here: code 2 with one line, or usage, or a result; raises AssertionError otherwise."""
    for name in ("evaluation", "benchmark"):
        copy_sample(name, folder)
    (folder / "bad.yaml").write_text("random: {trials: many}\n")
    (folder / "latin.yaml").write_bytes(b"kind: \xe9\xff\n")
    (folder / "file").write_text("text\n")
    out, err = io.BytesIO(), io.BytesIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        io.TextIOWrapper(out, "utf-8", write_through=True) as stdout,
        io.TextIOWrapper(err, "utf-8", "backslashreplace", write_through=True) as stderr,
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
    ):
        for place, name in _stops():
            patch.setattr(place, name, _begin)
        code = _code(case["words"])
        _check(code, err.getvalue().decode())


def _code(words: list[str]) -> int | str | None:
    if words[:1] == ["train"] and "--ppo.n-envs" not in words:
        words = ["train", "--ppo.n-envs", "2", *words[1:]]  # 32 reserve 2.5 GiB, and take seconds
    try:
        return entry.main(words)
    except Begun:
        return "begun"
    except SystemExit as end:  # of the parser: its own words
        return "usage" if end.code in (0, 2) else end.code


def _check(code: Any, text: str) -> None:
    assert code in (0, 1, 2, "usage", "begun"), f"exit code {code}"
    assert "Traceback" not in text, "a traceback"
    if "not enough memory" in text:
        raise MemoryError
    if code == 2:
        lines = text.splitlines()
        assert text.startswith("poise: ") and len(lines) == 1, f"{len(lines)} lines: {lines[:3]}"
