"""training/running/options/parsing.py and spelling.py."""

from __future__ import annotations

import io
import re

import pytest

from poise.configs.errors import ConfigError, meant
from poise.training.running.options.parsing import parsed
from poise.training.running.options.spelling import respelled, suggestion


def mine(*, seed: int = 0, share: float = 0.5, out: str) -> tuple[int, float, str]:
    """Somebody's command.

    Args:
        seed: of it.
        share: of it, too.
        out: where to.
    """
    return seed, share, out


def test_what_is_read_is_called_later() -> None:
    assert parsed(mine, ["--out", "a", "--seed", "3"], "poise mine")() == (3, 0.5, "a")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ([], "mine: needs --out NAME"),
        (["--out", "a", "--sede", "1"], "mine: --sede: no such option, did you mean --seed? "),
        (["--out", "a", "--zzz"], "mine: --zzz: no such option; poise mine --help lists them"),
        (["--out", "a", "b"], "mine: takes no 'b': see poise mine --help"),
        (["--out", "a", "--seed", "one"], "mine: --seed: must be a whole number, not 'one'"),
        (["--out", "a", "--share", "half"], "mine: --share: must be a number, not 'half'"),
        (["--out"], "mine: --out: needs 1 behind it"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_what_cannot_be_read_is_one_line(
    args: list[str], message: str, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a box is drawn with."""
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding))
    with pytest.raises(ConfigError, match=f"^{re.escape(message)}"):
        parsed(mine, args, "poise mine")


def test_older_spellings_are_read() -> None:
    """Of controllers, before the flags or behind one."""
    assert respelled("replay", ["d", "--controller", "a"]) == ["d", "--controllers", "a"]
    assert respelled("walk", ["--controllers=walk"]) == ["--controller=walk"]
    given = ["--out", "o", "--controllers", "a", "b", "--seed", "1"]
    assert respelled("benchmark", given) == ["a", "b", "--out", "o", "--seed", "1"]
    assert respelled("gait", ["--controller", "a"]) == ["--controller", "a"]


@pytest.mark.parametrize(
    ("flag", "meant_is"),
    [("--gamma", "--ppo.gamma"), ("--gama", "--ppo.gamma"), ("--ppo.gama", "--ppo.gamma"),
     ("--learning_rate", "--ppo.learning-rate"), ("--sede", "--seed")],
)  # fmt: skip
def test_options_of_a_section_are_found_by_their_own_names(flag: str, meant_is: str) -> None:
    options = ["--seed", "--ppo.gamma", "--ppo.learning-rate", "--ppo.final-learning-rate"]
    assert suggestion(flag, options) == f", did you mean {meant_is}?"


def test_a_word_of_a_name_will_do() -> None:
    """Of robots above all."""
    robots = ["humanoid", "unitree_g1", "unitree_h1", "booster_t1"]
    assert meant("g1", robots) == ", did you mean unitree_g1?"
    assert meant("T1", robots) == ", did you mean booster_t1?"
    assert meant("robby", robots) == ""
