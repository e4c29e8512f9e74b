"""Help pages: options in groups, each with description, default and range."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from .described import Option
from .names import KINDS, Named

HEADINGS = {"j50": "J50 [N·s]", "action": "moves", "on": "on top of", "about": ""}
INDENT = 6  # of a sentence below its option


def print_options(title: str, options: Iterable[Option], console: Console) -> None:
    """Print a group of options below its title."""
    console.print(Text(f"\n{title}", style="bold"))
    for option in options:
        console.print(Text(f"  {option.name} {option.kind}".rstrip()), soft_wrap=True)
        default = f"default {option.default}" if option.default else ""
        facts = "; ".join(filter(None, (default, option.bounds)))
        text = f"{option.sentence} ({facts})" if facts else option.sentence
        console.print(Padding(Text(text), (0, 0, 0, INDENT), expand=False))


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
    """Print the first sentence of each command's docstring."""
    console.print(Text(usage))
    table = Table.grid(padding=(0, 2))
    for name, function in commands.items():
        table.add_row(Text(f"  {name}"), Text(first_sentence(inspect.getdoc(function))))
    console.print(table)


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
