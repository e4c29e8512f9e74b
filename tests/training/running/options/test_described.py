"""training/running/options/described.py and pages.py: what help says is what the docstrings say."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import get_type_hints

import pytest
import tyro

from poise.training.cli.commands import COMMANDS
from poise.training.cli.entry import main
from poise.training.cli.motion.commands import MOTION
from poise.training.cli.policies import check, show
from poise.training.cli.train import BASIC, Command, options
from poise.training.learning.config import train_config
from poise.training.running.options.described import Option, arguments_of, entries, options_of

COMMON = {**COMMANDS, **{f"motion {name}": each for name, each in MOTION.items()}}
FUNCTIONS = {**COMMON, "policies": show, "policies check": check}
FUNCTIONS = {name: each for name, each in FUNCTIONS.items() if name not in ("train", "motion")}
PAGES = ["", "train", "motion", *FUNCTIONS]


def help_of(command: str, capsys: pytest.CaptureFixture[str], flag: str = "--help") -> str:
    assert main([*command.split(), flag]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", [*PAGES, "train --help-all"])
def test_all_help_looks_alike(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Plain text within 80 columns: usage, what it does, groups of options, each with a text."""
    words, _, flag = command.partition(" --help")
    page = help_of(words, capsys, f"--help{flag}")
    lines = page.splitlines()
    assert lines[0].startswith(" ".join(["usage: poise", *words.split()]))
    assert max(map(len, lines)) <= 80
    for wrong in ("None", "(default: )", "default none", "(default )", "STR", "╭", "│"):
        assert wrong not in page
    for number, line in enumerate(lines):
        if re.match(r"  (--|[A-Z]{2}|\[)", line) and page.count("\n\n") > 1:
            assert re.match(r" {6,}\S", lines[number + 1]), line  # its text, or more of a long name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_has_every_argument_of_a_command(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """With what it is and its default; the options are those that tyro reads."""
    page = " ".join(help_of(name, capsys).split())
    arguments = arguments_of(FUNCTIONS[name])
    for each in arguments:
        assert re.fullmatch(r"[A-Z.\[].{7,}\.", each.sentence), each
        assert (
            each.kind in ("", each.kind.strip())
            and " ".join(f"{each.heading} {each.sentence}".split()) in page
        )
    with pytest.raises(SystemExit):
        tyro.cli(FUNCTIONS[name], args=["--help"])
    read = set(re.findall(r"^[│ ] (--[a-z][\w-]*)", capsys.readouterr().out, re.MULTILINE))
    assert {each.name for each in arguments if each.name.startswith("--")} == read


def test_what_help_says_of_a_default() -> None:
    """Nothing where none is set, and both forms of a switch that has two."""
    found = {each.name: each for each in arguments_of(COMMANDS["evaluate"])}
    assert found["--trials"] == Option("--trials", "N", found["--trials"].sentence, "")
    assert (
        found["--get-up"].heading == "--get-up, --no-get-up" and found["--get-up"].default == "no"
    )
    assert (found["--json"].heading, found["--json"].default) == ("--json", "")
    config = {each.name: each for each in options_of(train_config("residual-torque"))}
    assert config["--ppo.symmetric"].heading == "--ppo.symmetric, --ppo.no-symmetric"


@pytest.mark.parametrize("config", ["residual-torque", "residual-walk", "position"])
def test_every_option_of_a_training_has_its_own_sentence(config: str) -> None:
    """None is empty, and options of different names share none."""
    names: dict[str, set[str]] = {}
    for option in options(train_config(config)):
        assert re.fullmatch(r"[A-Z].{8,}\.", option.sentence), option
        names.setdefault(option.sentence, set()).add(re.split(r"\.|--", option.name)[-1])
    assert {text: shared for text, shared in names.items() if len(shared) > 1} == {}


def test_the_options_that_help_lists_are_those_that_are_read(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As tyro has them, which reads them."""
    config = train_config("residual-torque")
    with pytest.raises(SystemExit):
        tyro.cli(Command, args=["--help"], default=Command(config),
                 config=(tyro.conf.AvoidSubcommands,))  # fmt: skip
    read = set(re.findall(r"^[│ ] (--[a-z][\w.*-]+)", capsys.readouterr().out, re.MULTILINE))
    assert {option.name for option in options(config)} == read


@pytest.mark.parametrize("name", [name for name in COMMON if name not in ("train", "motion")])
def test_every_parameter_of_a_command_is_described(name: str) -> None:
    """In its docstring, by a text of its own; or by its type, which several commands share."""
    function: Callable[..., object] = COMMON[name]
    told = entries(inspect.getdoc(function))
    hints = get_type_hints(function, include_extras=True)
    by_type = {key for key, hint in hints.items() for each in getattr(hint, "__metadata__", ())
               if getattr(each, "help", None)}  # fmt: skip
    assert {*inspect.signature(function).parameters} == {*told} | by_type
    assert not {*told} & by_type
    assert len(set(told.values())) == len(told)


def test_help_of_train_begins_with_what_a_first_run_needs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """All of the others come with --help-all, by section, with defaults and ranges."""
    assert main(["train", "--help"]) == 0
    first = capsys.readouterr().out
    found = re.findall(r"^  --([\w.-]+)", first, re.MULTILINE)
    assert set(found) == set(BASIC) and found[0] == "out" and "--help-all" in first
    assert main(["train", "--help-all"]) == 0
    everything = " ".join(capsys.readouterr().out.split())
    assert (
        "--ppo.gamma NUMBER Discount γ of a reward that comes one policy step later." in everything
    )
    assert "(default 0.99; above 0.0, at most 1.0)" in everything
    assert everything.index("--out") < everything.index("env.pushes: ") < everything.index("ppo: ")
