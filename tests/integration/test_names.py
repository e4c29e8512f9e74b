"""A public name is defined once, so that it says which thing is meant."""

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("envs", "baselines", "training")

COMMAND = "a command of `poise`, and the function of the library that it calls"
PARTS = "a command, and a command of its parts"
TERM = "a term of an observation, named as users name it, and what it reads"
#: the names of functions and classes that several modules define, and why
KEPT = {
    "benchmark": COMMAND,
    "compare": COMMAND,
    "evaluate": COMMAND,
    "follow": COMMAND,
    "leaderboard": COMMAND,
    "replay": COMMAND,
    "train": COMMAND,
    "tune": COMMAND,
    "view": COMMAND,
    "check": "`poise motion check` and `poise policies check`",
    "play": "`poise motion play`, and the part of a thread of `StepSchedule`",
    "contacts": "a term, and a part of what `prepare` compiles",
    "steps": "a term, and a part of what `prepare` compiles",
    "command_turn": TERM,
    "command_velocity": TERM,
    "push_force": TERM,
    "time_left": TERM,
    "turn_error": TERM,
}


def definitions() -> dict[str, set[str]]:
    """Public functions and classes at the top of a module → the files that define them."""
    found: dict[str, set[str]] = defaultdict(set)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text("utf-8")).body:
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                    found[node.name].add(str(path.relative_to(ROOT)))
    return {name: files for name, files in found.items() if name[0] != "_" and name != "main"}


def test_public_names_are_defined_once() -> None:
    """Name one after what it is in particular, or add it to `KEPT` with the reason."""
    several = {name: files for name, files in definitions().items() if len(files) > 1}
    assert {name: sorted(several[name]) for name in several.keys() - KEPT.keys()} == {}
    assert sorted(KEPT.keys() - several.keys()) == []  # none that is defined once by now
    assert len(KEPT) <= 20
