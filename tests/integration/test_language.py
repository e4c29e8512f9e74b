"""Written as the field writes: no private words, and no names of files that are not there.

docs/glossary.md has one word for one thing. `PRIVATE` lists what was said instead, with the word of
the field. To hold another kind of text to it, such as sources or what a command prints, add its
glob to `GLOBS`; `OTHERS` are exempt as a whole, `MEANT` are the phrases in which a word is meant.
"""

from __future__ import annotations

import ast
import functools
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOBS = (
    *("*.md", "docs/*.md", "configs/**/*.yaml", "examples/*.py", ".github/ISSUE_TEMPLATE/*.yml"),
    *(f"{package}/**/*.py" for package in ("baselines", "configs", "envs", "src", "training")),
    *(f"training/**/*.{kind}" for kind in ("j2", "js", "css")),
)
OTHERS = {"CHANGELOG.md", "docs/seeds.md"}  # of its days; is being rewritten

#: private word or phrase (a regular expression, whatever the case) → the field's
PRIVATE = {
    r"\btold\b": "commanded; reported, printed, warned",
    r"\bbelie(?:f|fs|ve|ves|ved)\b": "estimate, estimated",
    r"\b(?:is|are|was|were) full\b|\bfull at\b|\bfull (?:motor|cone)": "saturated, at its limit",
    r"\bled (?:from|to|there|on)\b": "blended, guided",
    r"\bwhat (?:\w+ )?ankles (?:hold|bear)\b": "ankle limit",
    r"\bhold(?:s|ing)? (?:a|the|such a) push\b": "resist, recover from",
    r"\bfeet (?:\w+ )?in place\b": "feet fixed",
    r"\bin the air\b": "swing, flight",
    r"\bdrawn (?:robots?|bod(?:y|ies)|anew)\b": "randomised",
    r"\blevels? of realism\b": "realism level",
    r"\b(?:sensing|sensors|commands|motors|servos) (?:\w+ )?late\b": "sensing delay, command delay",
    r"\blate (?:sensing|sensors)\b": "sensing delay",
    r"\bthe mix\b": "random suite",
    r"\bhalf at\b": "J50",
    r"\b(?:re)?played\b": "run, evaluated, repeated",
    r"\banew\b": "again",
    r"\blikewise\b": "also",
    r"\bbesides\b": "in addition",
    r"\bof theirs\b": "their",
    r"\bwhat it gives\b": "the outcome",
    r"\bwhat (?:be)?came of\b|\bnothing came of\b": "the outcome",
    r"\bwhat (?:is|was) asked for\b": "the command",
    r"\b(?:no|some)body(?: else)?\b": "the person or program that acts",
    r"\bfrom nowhere\b": "external, of a soft root",
    r"\bthe documents?\b": "author and year",
    r"\bthe house\b|\brooms\b|\b(?:a|one|its|this) room\b": "package, module",
    r"\b(?:lower|upper|higher|one|same|their) floors?\b": "layer",
    r"\b(?:QP|controller|planner|policy|estimator|robot)s? (?:knows?|knew)\b": "models",
    r"\bthinks?\b|\bwants to\b": "code is not a person",
}

#: page → phrases, of these patterns, in which the word is meant or an older name is read
MEANT: dict[str, tuple[str, ...]] = {
    "training/benchmarking/results/summary.py": ('"played"',),
}

#: names that stand for a file of the reader
READERS = {"file.py", "mine.py", "my.py", "my_controller.py", "my_file.py", "path/to/file.py"}
FILE = re.compile(r"(?<![\w/.*{}<…-])((?:[\w-]+/)*[a-z][\w-]*\.(?:py|md|j2))(?![\w*])")
FOLDERS = ("baselines", "configs", "docs", "envs", "examples", "src", "tests", "training")


@functools.cache
def texts() -> dict[str, str]:
    """File → what a reader reads of it: of a page neither code nor the addresses of links."""
    found = {}
    for pattern in GLOBS:
        for path in sorted(ROOT.glob(pattern)):
            name = str(path.relative_to(ROOT))
            if name not in OTHERS:
                text = path.read_text(encoding="utf-8")
                found[name] = prose(text) if path.suffix == ".md" else text
    return found


def prose(page: str) -> str:
    """A page without code, comments and addresses; lines stay where they are."""

    def blank(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    text = re.sub(r"^```.*?^```$|<!--.*?-->|^ {4}.*?$", blank, page, flags=re.M | re.S)
    text = re.sub(r"`[^`]*`", blank, text)
    return re.sub(r"\]\([^)]*\)", "]", text)


def said(text: str, meant: tuple[str, ...] = ()) -> list[tuple[int, str]]:
    """Line and words of each private phrase in a text."""
    for phrase in meant:
        text = text.replace(phrase, " " * len(phrase))
    found = []
    for pattern in PRIVATE:
        words = pattern.replace(" ", r"\s+")  # a phrase may go on in the next line
        for match in re.finditer(words, text, re.IGNORECASE):
            found.append((text[: match.start()].count("\n") + 1, " ".join(match[0].split())))
    return sorted(found)


@pytest.mark.parametrize("name", sorted(texts()))
def test_no_private_words(name: str) -> None:
    """docs/glossary.md has the word that is meant."""
    assert said(texts()[name], MEANT.get(name, ())) == []


def test_private_words_are_found() -> None:
    """Across lines and in links; in code and addresses they are names."""
    page = "A walk is told 0.5 m/s, feet\nin place.\n`told` [x](told.md)\n\n```yaml\ntold: 1\n```\n"
    assert said(prose(page)) == [(1, "feet in place"), (1, "told")]
    assert said(prose("[Nobody](a.md) knows."), ()) == [(1, "Nobody")]
    assert said("of the mix", ("of the mix",)) == []


@pytest.mark.parametrize("name", sorted(MEANT))
def test_what_is_meant_is_still_there(name: str) -> None:
    """An exception that nothing needs is taken out."""
    assert all(phrase in texts()[name] for phrase in MEANT[name])


def explained() -> Iterator[tuple[str, str]]:
    """File, and its docstrings and comments, or the prose and code spans of a page."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "__pycache__" in path.parts:
                continue
            with tokenize.open(path) as file:
                source = file.read()
            nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
            of = [node for node in ast.walk(ast.parse(source)) if isinstance(node, nodes)]
            strings = [ast.get_docstring(node, clean=False) or "" for node in of]
            comments = re.findall(r"(?:^|\s)(#:? .*)$", source, re.M)
            yield str(path.relative_to(ROOT)), "\n".join([*strings, *comments])
    for pattern in ("*.md", "docs/*.md"):
        for path in sorted(ROOT.glob(pattern)):
            text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
            if path.name != "CHANGELOG.md":  # tells of what was
                yield str(path.relative_to(ROOT)), text


def ends() -> set[str]:
    """Every file of the repository by each end of its path."""
    paths = [path.relative_to(ROOT).parts for path in ROOT.glob("*") if path.is_file()]
    for folder in (*FOLDERS, ".github"):
        paths += [path.relative_to(ROOT).parts for path in (ROOT / folder).rglob("*.*")]
    return {"/".join(parts[start:]) for parts in paths for start in range(len(parts))}


def stale(text: str, known: set[str]) -> set[str]:
    """Names of files in a text that nothing in the repository ends in."""
    names = {match[1] for match in FILE.finditer(text)}
    return {name for name in names - READERS if re.sub(r"^(?:\.\./)+", "", name) not in known}


def test_files_that_are_named_exist() -> None:
    """In docstrings, comments and pages: a file that was moved or joined is named as it is now."""
    known = ends()
    assert {where: found for where, text in explained() if (found := stale(text, known))} == {}


def test_a_name_of_no_file_is_found() -> None:
    """By its end, with and without folders."""
    known = {"tick.py", "whole_body/tick.py", "baselines/whole_body/tick.py"}
    assert stale("see `whole_body/tick.py`, `tick.py` and my_file.py:Class", known) == set()
    assert stale("see `task_rows.py`, `balance/tick.py`", known) == {
        "task_rows.py",
        "balance/tick.py",
    }
