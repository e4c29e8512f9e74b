"""tests/fuzz: a few cases of every kind, those that were ever found, and the fuzzer itself."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings

from tests.fuzz import faulty, runner
from tests.fuzz.child import SETTINGS
from tests.fuzz.kinds import NAMES, kind
from tests.fuzz.playing import play
from tests.fuzz.runner import FOUND, Runner, table
from tests.fuzz.values import NUMBERS, OBJECTS, TEXTS, Json, decode

CASES = {"networks": 4, "commands": 10, "results": 20}  # of each kind, of the others 40: seconds
WEEKLY = pytest.mark.weekly
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded on Linux alone")


@pytest.mark.parametrize("name", NAMES)
def test_works_or_says_in_one_line_what_is_wrong(name: str) -> None:
    """The same cases in every run; `make fuzz` draws others."""
    played = kind(name)

    @settings(SETTINGS, max_examples=CASES.get(name, 40), derandomize=True)
    @given(played.cases)
    def test(case: Json) -> None:
        outcome = play(played, case)
        assert outcome.good, f"{outcome.what}\n{outcome.details}"

    test()


@pytest.mark.parametrize("name", NAMES)
def test_every_sort_of_case_can_be_drawn(name: str) -> None:
    """What cases are made from has not moved away."""

    @settings(SETTINGS, max_examples=60, derandomize=True)
    @given(kind(name).cases)
    def test(case: Json) -> None:
        json.dumps(case)

    test()


@pytest.mark.parametrize("path", sorted(FOUND.glob("*.json")), ids=lambda path: path.stem)
def test_what_was_found_stays_mended(path: Path) -> None:
    """Cases that once ended in a traceback, a hang or a crash."""
    entry = json.loads(path.read_text())
    outcome = play(kind(entry["kind"]), entry["case"])
    if outcome.verdict == "hang":  # the first case of a process imports, and makes what is read
        outcome = play(kind(entry["kind"]), entry["case"])
    assert outcome.good, f"{outcome.what}\n{outcome.details}"


TURNS = 50  # more than a busy machine needs to meet a fault twice


@pytest.mark.parametrize(
    ("way", "verdict"),
    [
        ("traceback", "traceback"),
        pytest.param("crash", "crash", marks=WEEKLY),
        pytest.param("hang", "hang", marks=WEEKLY),
        pytest.param("half-written", "traceback", marks=WEEKLY),
        pytest.param("memory", "memory", marks=[LINUX, WEEKLY]),
    ],
)
def test_the_fuzzer_sees_what_goes_wrong(
    way: str, verdict: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is counted, the smallest case is kept, and the next turn goes on."""
    monkeypatch.setenv(faulty.WAY, way)
    monkeypatch.setattr(runner, "SECONDS", 0.3)
    fuzzer = Runner(1, tmp_path)
    try:
        count = fuzzer.counts["faulty"]
        for _ in range(TURNS):
            fuzzer.turn("faulty", 0.2)
            if count.verdicts[verdict] >= 2:
                break
    finally:
        fuzzer.close()
    assert count.verdicts[verdict] >= 2 and count.cases > count.verdicts[verdict]
    (path,) = tmp_path.glob(f"faulty-{verdict}-*.json")
    entry = json.loads(path.read_text())
    assert entry["kind"] == "faulty" and entry["case"] >= 10
    if verdict in ("traceback", "memory"):
        assert entry["case"] == 10
    assert f"{count.verdicts[verdict]}" in table(fuzzer.counts)


def test_every_value_can_be_made_and_kept() -> None:
    """Cases are JSON: what a file gives back is what was drawn."""
    for value in [*NUMBERS, *TEXTS, *({"$object": name} for name in OBJECTS)]:
        decode(value)
        assert json.loads(json.dumps(value)) == value
    assert decode({"$pairs": [[1, {"$tuple": [1]}]]}) == {1: (1,)}
    assert decode({"a": [{"$bytes": "/w=="}]}) == {"a": [b"\xff"]}
