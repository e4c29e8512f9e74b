"""README and docs/: every Python block runs, every command parses, every named file exists.

A Python block is run as a script in a folder that looks like the root of the repository. It is not
run where `<!-- not run: reason -->` stands above it.
"""

from __future__ import annotations

import functools
import importlib.util
import re
import runpy
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from poise.training.cli import entry, train
from poise.training.cli.motion import commands as motion

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "docs" / "log").glob("*.md"))
LANGUAGES = {"python", "bash", "yaml", "diff", ""}  # "" is a figure: an equation, a tree, a listing
SCRIPTS = ("git ", "tensorboard ", "pip install ", "docker ")  # commands of others
INLINE = re.compile(r"`(poise\s[^`]+)`")
FOLDERS = "envs|baselines|training|configs|tests|examples"
PLACES = {"N": "1", "K": "1", "…": "", "CONTROLLER…": "momentum-qp"}  # where a page names no value
NEEDED = {"train": "--out", "benchmark": "--out", "tune": "--out", "qp-set": "--out",
          "export": "--out"}  # fmt: skip


class Block(NamedTuple):
    """A fenced block: where it begins, its language, its text, and why it is not run."""

    where: str
    language: str
    text: str
    reason: str


def blocks() -> list[Block]:
    """All of all pages, in order."""
    found = []
    fence = re.compile(r"(?:<!-- not run: ([^>]+) -->\n)?^```(\w*)\n(.*?)^```$", re.M | re.S)
    for page in PAGES:
        text = page.read_text()
        for match in fence.finditer(text):
            where = f"{page.relative_to(ROOT)}:{text[: match.start()].count(chr(10)) + 1}"
            found.append(Block(where, match[2], match[3], match[1] or ""))
    return found


def of(language: str) -> list[Block]:
    return [block for block in blocks() if block.language == language]


def inline() -> list[tuple[str, str]]:
    """Commands within a sentence or a table: page, command."""
    found = []
    for page in PAGES:
        prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
        for command in INLINE.findall(prose):
            found.append((str(page.relative_to(ROOT)), " ".join(command.split())))
    return sorted(set(found))


def ids(items: list[Block]) -> list[str]:
    return [block.where for block in items]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the folders that a page may name."""
    for name in ("configs", "docs", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def parsed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the sub-commands that were called, in place of what they do."""
    called: list[str] = []

    def recorder(name: str, function: Callable[..., object]) -> Callable[..., object]:
        @functools.wraps(function)
        def record(*_: object, **__: object) -> None:
            called.append(name)

        return record

    recorders = {name: recorder(name, function) for name, function in entry.COMMANDS.items()}
    monkeypatch.setattr(entry, "COMMANDS", recorders)
    clips = {name: recorder("motion", function) for name, function in motion.MOTION.items()}
    monkeypatch.setattr(motion, "MOTION", clips)
    monkeypatch.setattr(
        train, "run_train", lambda args: (train.parse_train(args), called.append("train"))
    )
    monkeypatch.setattr(entry, "check_flags", lambda *_: None)  # not all files of pages exist
    return called


def test_no_block_is_of_another_language() -> None:
    """One with a misspelt language would not be looked at; commands are not merely indented."""
    assert {block.language for block in blocks()} <= LANGUAGES
    indented = [
        f"{page.name}: {line}"
        for page in PAGES
        for line in re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S).splitlines()
        if re.match(r"    (poise|python|pip|make) ", line)
    ]
    assert indented == []


@pytest.mark.parametrize("block", of("python"), ids=ids(of("python")))
def test_python_runs(block: Block, folder: Path) -> None:
    """As a script; it raises nothing."""
    if block.reason:
        pytest.skip(block.reason)
    path = folder / "block.py"
    path.write_text(block.text)
    runpy.run_path(str(path), run_name="__main__")


@pytest.mark.parametrize("block", of("bash"), ids=ids(of("bash")))
def test_commands_parse(block: Block, parsed: list[str]) -> None:
    """`poise …` by the command's own parser, `python -m …` and `make …` by what exists."""
    for line in block.text.splitlines():
        words = shlex.split(re.sub(r"^([A-Z_]+=\S+ )+", "", line), comments=True)
        if words[0] == "poise":
            parse(words[1:], parsed)
        elif words[:2] == ["python", "-m"]:
            assert importlib.util.find_spec(words[2]), line
        elif words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.M), line
        else:
            assert line.startswith(SCRIPTS), line


@pytest.mark.parametrize(("page", "command"), inline(), ids=lambda value: value)
def test_commands_of_sentences_parse(page: str, command: str, parsed: list[str]) -> None:
    """Placeholders get a value; of `a|b|c` the first is taken; `--out` may be left out."""
    text = re.sub(r"(\\\|\w+)+", "", command).replace("\\|", "|")
    words = [PLACES.get(word, word) for word in shlex.split(text)[1:]]
    words = [word for word in words if word]
    if words[:1] == ["policies"] and len(words) > 1:  # that one's own parser is not replaced
        assert words[1] == "check", page
        return
    if words[:1] == ["motion"] and len(words) == 2:
        assert words[1] in motion.MOTION, page
        return
    if len(words) == 1 or words[1] in ("--help", "--help-all") or words[0] == "--print-completion":
        assert words[0] in {*entry.COMMANDS, "COMMAND", "--print-completion"}, page
        return
    if words[0] in NEEDED and "--out" not in words:
        words += ["--out", "out"]
    parse(words, parsed)


def parse(words: list[str], parsed: list[str]) -> None:
    """Fails with the parser's message where it refuses the words."""
    parsed.clear()
    assert entry.main(words) == 0
    assert parsed == words[:1]


@pytest.mark.skipif(shutil.which("git") is None, reason="patches are read by git")
@pytest.mark.parametrize("block", of("diff"), ids=ids(of("diff")))
def test_patches_apply(block: Block) -> None:
    """To this tree, as they are printed; nothing is changed."""
    check = ["git", "apply", "--check", "-"]
    found = subprocess.run(check, cwd=ROOT, input=block.text, text=True, capture_output=True)
    assert found.returncode == 0, found.stderr


def test_files_that_pages_name_exist() -> None:
    """Paths of the repository in backticks, and modules of tests. Python makes caches itself."""
    wrong = []
    for page in PAGES:
        text = page.read_text()
        for path in re.findall(rf"`((?:{FOLDERS})/[a-z0-9_./-]+)`", text):
            if "__pycache__" not in path and not (ROOT / path).exists():
                wrong.append(f"{page.name}: {path}")
        for module in re.findall(r"`?python -m (tests[\w.]+)", text):
            place = ROOT / module.replace(".", "/")
            if not (place.with_suffix(".py").exists() or (place / "__main__.py").exists()):
                wrong.append(f"{page.name}: {module}")
    assert wrong == []


GENERATED = ("scenarios", "walking-leaderboard", "leaderboard")  # and those of other robots
NO_PROSE = {"seeds", "references"}
READ = sorted(
    page.stem
    for page in (ROOT / "docs").glob("*.md")
    if not page.stem.startswith(GENERATED) and page.stem not in NO_PROSE
)
LONGEST = 30  # words of a sentence


def sentences(page: str) -> list[str]:
    """Of the prose of a page, without tables and formulas; code in a sentence is one word."""
    text = re.sub(r"^```.*?^```$|<!--.*?-->", "", page, flags=re.M | re.S)
    text = re.sub(r"^(?:\||#|!\[| {4}).*$", "", text, flags=re.M)
    text = re.sub(r"^\s*(?:[-*]|\d+\.) ", "\n", text, flags=re.M)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`", "code", text)
    ends = re.compile(r"(?<=[.!?])[)\"]?\s+(?=[A-ZΔξω*c(_\d])|(?<=:)\s+(?=[A-Z])")
    return [each for part in text.split("\n\n") for each in ends.split(" ".join(part.split()))]


@pytest.mark.parametrize("page", READ)
def test_sentences_are_short(page: str) -> None:
    """A reader understands each at the first reading."""
    found = sentences((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"))
    assert len(found) > 20
    counts = {each: len(re.findall(r"\S*\w\S*", each)) for each in found}
    assert {each: n for each, n in counts.items() if n > LONGEST} == {}
