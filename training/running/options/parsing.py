"""Parsing of arguments by a function's signature, with one-line errors."""

import contextlib
import functools
import io
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

import tyro

from poise.configs.errors import ConfigError, shown
from poise.configs.problems import Problem
from poise.training.running.terminal import terminal

from .described import Option, arguments_of
from .pages import print_help
from .spelling import suggestion

T = TypeVar("T")
HELP = {"-h", "--help", "--help-all"}
NUMBERS = {r"invalid literal for int\(\) with base 10: (.*)": "a whole number",
           r"could not convert string to float: (.*)": "a number"}  # fmt: skip
CHOICE = re.compile(r"invalid choice ('.*') for argument '(.*)'. Expected one of \((.*?),?\)")
NO_VALUE = re.compile(r"Missing value for argument '(.*)'. Expected (\d+) value")


def parsed(function: Callable[..., T], args: Sequence[str], prog: str) -> Callable[[], T]:
    """Return the function bound to these arguments, not yet called.

    Raises:
        ConfigError: an unknown option, with the most similar one; a value that does not parse; a
            missing argument.
        SystemExit: help was requested and printed.
    """

    @functools.wraps(function)
    def later(*given: Any, **named: Any) -> Callable[[], T]:
        return functools.partial(function, *given, **named)

    with one_line_errors(prog, arguments_of(function), args):
        return tyro.cli(later, prog=prog, args=list(args))


def answered(function: Callable[..., object], args: Sequence[str], prog: str) -> int:
    """Call a function with these arguments, or print its help; return the int that it returns as
    exit code, else 0.

    Raises as `parsed`, and whatever the function raises.
    """
    if not HELP.isdisjoint(args):
        print_help(function, prog, terminal())
        return 0
    code = parsed(function, args, prog)()
    return code if isinstance(code, int) else 0


@contextlib.contextmanager
def one_line_errors(prog: str, options: Iterable[Option], args: Sequence[str]) -> Iterator[None]:
    """Convert tyro's error output and exit with code 2 to a ConfigError."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            yield
    except SystemExit as end:
        if not end.code:
            raise
        raise _error(said.getvalue(), prog, list(options), args) from None


def _error(said: str, prog: str, options: list[Option], args: Sequence[str]) -> ConfigError:
    """Return the error in a box printed by tyro, as one line."""
    lines = _first_part(said)
    text = " ".join(line.strip() for line in lines)
    if "nrecognized" in text:
        return _unknown(text, prog, [each.name for each in options if each.name[:1] == "-"], args)
    if lines and lines[0].lstrip().startswith("Missing from"):
        headings = {option.name: option.heading for option in options}
        found = [line.strip() for line in lines if re.match(r" {4}\S", line)]
        needed = [headings.get(line.split()[0], line) for line in found]
        return Problem("needs", _command(prog), what=", ".join(needed))
    if wrong := re.match(r"Error parsing ([^:]+): (.*)", text):
        for pattern, expected in NUMBERS.items():
            if no := re.search(pattern, wrong[2]):
                return Problem("type", _command(prog), wrong[1], expected=expected, value=no[1])
        return ConfigError(wrong[2], source=_command(prog), field=wrong[1])
    if choice := CHOICE.match(text):
        return Problem("choice", _command(prog), choice[2], valid=choice[3], value=choice[1])
    if lacking := NO_VALUE.match(text):
        return Problem("no value", _command(prog), lacking[1], count=lacking[2])
    return ConfigError(text or "cannot be read", source=_command(prog))


def _command(prog: str) -> str:
    """Return the command's name in an error, whose line already begins with `poise`."""
    return prog.removeprefix("poise ")


def _first_part(said: str) -> list[str]:
    """Return the lines of a box down to its first rule, without the box and its title.

    With ASCII output a box is a title above a rule.
    """
    lines: list[str] = []
    titled = "╭" in said
    for line in said.splitlines():
        inner = line[2:].rstrip("│ ") if line.startswith("│") else line.rstrip()
        if line.startswith(("╭", "╰")) or not inner.strip():
            continue
        if not inner.strip(" ─-"):
            if titled:
                break
            titled, lines = True, []
            continue
        lines.append(inner if line.startswith("│") else line[2:].rstrip())
    return lines


def _unknown(text: str, prog: str, options: list[str], args: Sequence[str]) -> ConfigError:
    """Return the error of the first unknown argument."""
    named = re.split(r"[,\s]+", text.partition(":")[2].strip())[0]
    wrong = next((arg for arg in args if arg.partition("=")[0] == named), named)
    flag = wrong.partition("=")[0]
    if not flag.startswith("-"):
        return Problem("unknown argument", _command(prog), value=shown(flag), prog=prog)
    hint = f"{suggestion(flag, options) or ';'} {prog} --help lists them"
    return Problem("unknown option", _command(prog), flag, hint=hint)
