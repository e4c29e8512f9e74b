"""configs/texts.py: what strangers have written is shown, never followed."""

from __future__ import annotations

import html
import io
import string
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.configs.texts import LONGEST, check_shown, code, plain, printable
from poise.training.running.terminal import Terminal

#: texts that a page, Markdown, MDX, a spreadsheet or a terminal would take for more than a text
TRAPS = (
    "x`<img src=q onerror=alert(1)>`",
    "<script>alert(1)</script>",
    "[a](javascript:alert(1))",
    "![a](http://elsewhere.example/a.png)",
    "{alert(1)} ${alert(1)} {{7*7}}",
    "a | b\n\n# heading\n\n---\n<b>",
    "&lt;b&gt; &#60;",
    "*a* _b_ __c__ ~~d~~ \\`",
    "\x1b]0;title\x07\x1b[2J",
    "\u202eevil",
)


@pytest.mark.parametrize("text", TRAPS)
def test_markdown_shows_it_as_it_is(text: str) -> None:
    """No character is left that begins markup of Markdown, HTML or MDX; a reader sees the text."""
    shown = plain(text)
    assert "\n" not in shown and shown.isprintable()
    assert not set(shown) & set("<>`{}[]*|\\~!$\"'")
    assert shown.replace("&#", "").count("&") == 0
    if text.isprintable():
        assert html.unescape(shown) == text


@pytest.mark.parametrize("text", TRAPS)
def test_code_in_markdown_holds_it(text: str) -> None:
    """As it is, between backticks that nothing in it closes; else as `plain`."""
    shown = code(text)
    inside = shown[1:-1] if shown.startswith("`") else ""
    assert shown == plain(text) or (not set(inside) & set("`|\n") and inside.isprintable())
    assert code("residual-torque") == "`residual-torque`" and code("a|b") == "a&#124;b"


def test_names_stay_readable() -> None:
    """Of controllers, robots, joints and files."""
    for name in ("residual-torque", "left_knee_pitch", "runs/a.yaml", "my_file.py:Class", "π 0.4"):
        assert plain(name) == name
    marks = set(string.punctuation) - set(".,:/()+%=-_@")
    assert all(plain(mark).startswith("&#") for mark in marks)


@pytest.mark.parametrize("text", TRAPS)
def test_a_terminal_gets_no_commands(text: str) -> None:
    """Whoever has written what is printed."""
    stream = io.StringIO()
    Terminal(file=stream, force_terminal=True, width=200).print(text, markup=False)
    assert "\x1b]" not in stream.getvalue() and "\x07" not in stream.getvalue()
    assert "\x1b[2J" not in stream.getvalue() and "\u202e" not in stream.getvalue()
    assert printable("a\tb\nc\x1b") == "a\tb\nc\\x1b"


@pytest.mark.parametrize("name", [*TRAPS[-2:], "a\nb", "\x1b[0m", "x" * (LONGEST + 1)])
def test_such_a_name_is_refused(name: str) -> None:
    """In one line that shows it, naming where it stands."""
    with pytest.raises(ConfigError, match=r"summary.json: ranking: ") as caught:
        check_shown(name, Path("summary.json"), "ranking")
    assert str(caught.value).isprintable() and len(str(caught.value)) < 400
