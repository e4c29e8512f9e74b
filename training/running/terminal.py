"""The terminal, and what it shows while an evaluation runs."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

WIDTH = 120  # of tables that no terminal shows


class Terminal(Console):
    """A console that leaves a pipe that nobody reads to `cli.main`; Rich would exit with 1."""

    def on_broken_pipe(self) -> None:
        raise  # what Rich has just caught


def terminal() -> Console:
    """The console that a command prints to."""
    console = Terminal()
    return console if console.is_terminal else Terminal(width=WIDTH)


def progress_bar(console: Console) -> Progress:
    """A bar with trials, recovery rates (its field `rates`) and the time left."""
    return Progress(
        TextColumn("trials"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("recovered: {task.fields[rates]}", markup=False),
        TimeRemainingColumn(),
        console=console,
        disable=console.quiet,
    )


def print_paths(paths: Sequence[Path], console: Console) -> None:
    """Print one path a line, whole, as it is to be copied."""
    for path in paths:
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)
