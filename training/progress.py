"""What the terminal shows while an evaluation runs."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


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


@contextmanager
def patience(console: Console) -> Iterator[None]:
    """Say why nothing happens if the block takes long."""
    message = "getting ready: the first run compiles for about half a minute …"
    timer = threading.Timer(4.0, console.print, (message,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
