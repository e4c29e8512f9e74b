"""envs/compiled/warmup.py: parts are compiled again if a file has changed that they are made of."""

from __future__ import annotations

import importlib
import io
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from poise.baselines.warmup import FURTHER, NAMES, PARTS
from poise.envs.compiled import jit, warmup
from poise.envs.compiled.maths import pendulum
from poise.envs.compiled.maths.pendulum import compiled_rate
from tests.envs.compiled import test_kernel_cache
from tests.envs.compiled.test_kernel_cache import total

MODULE = "poise.baselines.environments.kernels"


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The parts that would be compiled, in turn; a cache that is empty."""
    found: list[list[str]] = []

    compiled_rate(9.81, 1.0), total(np.ones(2), np.ones(2))  # kernels of two files

    def compile_apart(module: str, parts: list[str]) -> bool:
        found.append(list(parts))
        for part in parts:
            warmup.end(module, part)
        return True

    monkeypatch.setattr(jit, "CACHE", tmp_path)
    monkeypatch.setattr(warmup, "_compile_apart", compile_apart)
    monkeypatch.setattr(warmup, "_tried", set())
    return found


def test_a_part_is_compiled_once_for_its_sources(asked, monkeypatch) -> None:
    """Then again when the digest of a file has changed whose kernels it has; others are not."""
    warmup.fill_cache(MODULE, NAMES, ("solver", "steps"))
    monkeypatch.setattr(warmup, "_tried", set())
    warmup.fill_cache(MODULE, NAMES, ("solver", "steps"))
    assert asked == [["solver", "steps"]]
    files = [
        line.split(" ", 1)[1] for line in warmup._record(MODULE, "steps").read_text().split("\n")
    ]
    assert {pendulum.__file__, test_kernel_cache.__file__} <= set(files)
    (first, *_), before = files, warmup.source_digest
    monkeypatch.setattr(warmup, "source_digest", lambda f: "" if f == first else before(f))
    warmup._record(MODULE, "solver").write_text(f"{before(files[1])} {files[1]}")
    warmup.fill_cache(MODULE, NAMES, ("solver", "steps"))
    assert asked[1:] == [["steps"]]


def test_a_line_says_what_is_compiled(asked, capsys: pytest.CaptureFixture[str]) -> None:
    """Of every group what is missing, and nothing of what is there."""
    warmup.fill_cache(MODULE, NAMES, ("steps",))
    warmup.fill_cache(MODULE, NAMES, ("steps", "solver"), ("walking", "planner"))
    lines = capsys.readouterr().err.splitlines()
    end = "for the first use: up to a minute, once"
    assert lines == [
        f"poise: compiling physics {end}",
        f"poise: compiling the QP solver {end}",
        f"poise: compiling walking, planned steps {end}",
    ]


def test_every_part_is_named_and_compiled_by_setup() -> None:
    """Those that the module has."""
    module = importlib.import_module(MODULE)
    own = {name for name, value in vars(module).items() if callable(value)
           and getattr(value, "__module__", "") == MODULE and not name.startswith("_")}  # fmt: skip
    assert own == {*PARTS, *FURTHER} == {*NAMES}


@pytest.mark.parametrize("record", ["", "abc /nowhere.py", "garbage", None])
def test_a_record_that_says_nothing_counts_for_nothing(asked, record: str | None) -> None:
    """Empty, of a file that is gone, of no file, or missing."""
    if record is not None:
        warmup._record(MODULE, "solver").write_text(record)
    warmup.fill_cache(MODULE, NAMES, ("solver",))
    assert asked == [["solver"]]


@pytest.mark.parametrize(
    ("processors", "shares"),
    [(1, ["abcde"]), (2, ["ace", "bd"]), (8, ["a", "b", "c", "d", "e"])],
)
def test_each_processor_has_a_process(
    processors: int, shares: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every part is compiled once, in the order of the group."""
    started: list[str] = []

    class Process:
        stdin = io.BytesIO()

        def __init__(self, command: list[str], **_: object):
            started.append(command[-1].rpartition("; ")[2])

        def wait(self) -> int:
            return 0

        kill = wait

    monkeypatch.setattr(warmup.subprocess, "Popen", Process)
    monkeypatch.setattr(warmup.os, "sched_getaffinity", lambda _: set(range(processors)), False)
    assert warmup._compile_apart("module", tuple("abcde"))
    assert started == [f"compile_here(functions, {tuple(share)})" for share in shares]


def test_a_part_is_noted_when_it_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that ends in the middle of its second part has the first one noted."""
    done: list[str] = []
    module = ModuleType("parts")
    module.first = lambda: done.append("compiled")
    module.second = lambda: done.append(1 / 0)
    monkeypatch.setattr(warmup, "end", lambda module, part: done.append(f"{module}.{part}"))
    for name in ("begin", "gc.freeze", "gc.set_threshold"):
        monkeypatch.setattr(f"{warmup.__name__}.{name}", lambda *_: None)
    with pytest.raises(ZeroDivisionError):
        warmup.compile_here(module, ("first", "second"))
    assert done == ["compiled", "parts.first"]
