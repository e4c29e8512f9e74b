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
from poise.training.cli.train import BASIC, Command, options
from poise.training.learning.config import train_config
from poise.training.running.options.described import entries

COMMON = {**COMMANDS, **{f"motion {name}": each for name, each in MOTION.items()}}


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
