"""Help pages of all commands: usage, and options in groups with meaning, default and range."""

import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, repeat

from rich.console import Console
from rich.table import Table
from rich.text import Text

from .described import Option, arguments_of
from .names import KINDS, Named

HEADINGS = {"j50": "J50 [N·s]", "action": "moves", "on": "on top of", "about": ""}
INDENT = 6  # of a sentence below its option
WIDTH = 80  # of help


def print_help(function: Callable[..., object], prog: str, console: Console) -> None:
    """Print a command's usage, what it does, and its arguments in groups."""
    arguments = arguments_of(function)
    groups = {
        "arguments": [each for each in arguments if not each.name.startswith("--")],
        "required options": [
            each for each in arguments if each.required and each.name.startswith("--")
        ],
    }
    named = [each for group in groups.values() for each in group]
    groups["options"] = [each for each in arguments if each not in named]
    words = [each.heading if each.required else f"[{each.heading}]" for each in named]
    more = ["[OPTIONS]"] if groups["options"] else []
    print_lines(" ".join(["usage:", prog, *words, *more]), console)
    for paragraph in paragraphs(function):
        console.print()
        print_lines(paragraph, console)
    for title, options in groups.items():
        if options:
            print_options(title, options, console)


def print_options(title: str, options: Iterable[Option], console: Console) -> None:
    """Print a group of options below its title."""
    console.print()
    print_lines(title, console, style="bold")
    for option in options:
        print_lines(option.heading, console, 2, hang=2 * INDENT)
        default = f"default {option.default}" if option.default else ""
        facts = "; ".join(filter(None, (default, option.bounds)))
        text = f"{option.sentence} ({facts})" if facts else option.sentence
        print_lines(text, console, INDENT)


def print_lines(
    text: str, console: Console, indent: int = 0, style: str = "", hang: int = 0
) -> None:
    """Print a text in lines of at most 80 columns, or as wide as a terminal that is narrower.

    Lines after the first are indented by `hang` more.
    """
    lines = textwrap.wrap(
        text, min(WIDTH, console.width), initial_indent=" " * indent,
        subsequent_indent=" " * (indent + hang), break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    for line in lines:
        console.print(Text(line, style=style), soft_wrap=True)


def paragraphs(function: Callable[..., object]) -> list[str]:
    """Return what a command's docstring says of it, and of its exit code."""
    text = inspect.getdoc(function) or ""
    about, returns = re.split(r"\n\n(?=Args:)", text)[0], re.search(r"Returns:\n(.*)", text, re.S)
    found = [" ".join(part.split()) for part in about.split("\n\n") if part.strip()]
    return [*found, *([f"Exit code: {' '.join(returns[1].split())}"] if returns else [])]


def grouped(options: Sequence[Option], titles: Mapping[str, str]) -> dict[str, list[Option]]:
    """Return options by section, under the section's title where it has one."""
    found: dict[str, list[Option]] = {}
    for option in options:
        group = option.group
        title = f"{group}: {titles[group]}" if group in titles else group
        found.setdefault(title, []).append(option)
    return found


def print_commands(usage: str, commands: Mapping[str, Callable[..., object]],
                   console: Console) -> None:  # fmt: skip
    """Print a usage, and the first sentence of each command's docstring in a column beside it."""
    console.print(Text(usage), soft_wrap=True)
    start = max(map(len, commands)) + 4
    for name, function in commands.items():
        lines = textwrap.wrap(
            first_sentence(inspect.getdoc(function)), max(min(WIDTH, console.width) - start, 20),
            break_on_hyphens=False,
        )  # fmt: skip
        for before, line in zip(chain([f"  {name}"], repeat("")), lines, strict=False):
            console.print(Text(f"{before:{start}}{line}"), soft_wrap=True)


def print_names(
    kinds: Mapping[str, list[Named]], suites: Mapping[str, str], console: Console
) -> None:
    """Print a table for each kind of names, and the suite of J50 for each robot."""
    for kind, entries in kinds.items():
        console.print(Text(f"\n{kind} ({KINDS[kind]})", style="bold"))
        table = Table.grid(padding=(0, 2))
        keys = [key for key in Named.__annotations__ if any(key in entry for entry in entries)]
        if len(keys) > 2:
            table.add_row(*(Text(HEADINGS.get(key, key), style="dim") for key in keys))
        for entry in entries:
            cells = (entry.get(key, "") for key in keys)
            table.add_row(*(Text(f"{x:.1f}" if isinstance(x, float) else str(x)) for x in cells))
        console.print(table)
    used = ", ".join(f"{suite} on {robot}" for robot, suite in suites.items())
    console.print(Text(f"\nJ50: mean over all directions, as on the leaderboards; suite {used}"))


def first_sentence(text: str | None) -> str:
    """Return the first sentence of a text, at most its first paragraph."""
    paragraph = " ".join((text or "").partition("\n\n")[0].split())
    return paragraph.partition(". ")[0].rstrip(".") + "." if paragraph else ""
