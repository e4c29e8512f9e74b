"""The terminal, and what it shows while an evaluation runs."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

WIDTH = 120  # of tables that no terminal shows


def terminal() -> Console:
    """Where a command prints."""
    console = Console()
    return console if console.is_terminal else Console(width=WIDTH)


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
