"""The terminal: console, progress and widths of tables."""

import codecs
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Column

from poise.configs.errors import PoiseWarning
from poise.configs.texts import printable

#: replacements in a terminal whose encoding lacks the character; "?" for any other
PLAIN = {"°": "deg", "·": "*", "×": "x", "≤": "<=", "≥": ">=", "–": "-", "−": "-", "…": "...",
         "→": "->", "±": "+-", "²": "2", "³": "3", "⁻": "-", "Δ": "d"}  # fmt: skip
WIDTH = 120  # of tables outside a terminal
PADDING = 3  # characters of a table's column in addition to its text
SHORTEST, LONGEST = 10.0, 300.0  # [s] between progress lines outside a terminal
GROWTH = 0.1  # time between lines over elapsed time


def speak_plainly() -> None:
    """Replace characters that a terminal's encoding lacks, instead of ending the command.

    Print each `PoiseWarning` as one line, like an error.
    """
    codecs.register_error("poise.plain", _plain)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="poise.plain")
    others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, PoiseWarning):
            print(f"poise: warning: {message}", file=sys.stderr)
        else:
            others(message, category, *where, **more)

    warnings.showwarning = show


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(PLAIN.get(sign, "?") for sign in lost), error.end


class Terminal(Console):
    """A console that leaves a broken pipe to `cli.main`; Rich would exit with 1.

    Control characters in texts are made harmless.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """See `Console`."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)

    def on_broken_pipe(self) -> None:
        raise  # the error that Rich has just caught


def terminal(stderr: bool = False) -> Console:
    """Return the console of a command, on the standard error where a result is piped."""
    console = Terminal(emoji=False, stderr=stderr)  # mine.py:B: names a controller
    return console if console.is_terminal else Terminal(width=WIDTH, emoji=False, stderr=stderr)


class ProgressLines(Progress):
    """A bar in a terminal, elsewhere plain lines at growing intervals, the first at once."""

    _started = _due = -1.0  # [s], monotonic

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """See `Progress`."""
        super().update(task_id, **changes)
        if self.disable or self.console.is_terminal:
            return
        now = time.monotonic()
        if self._started < 0.0:
            self._started = self._due = now
        if now >= self._due:
            self._due = now + min(max(GROWTH * (now - self._started), SHORTEST), LONGEST)
            for task in self.tasks:
                cells = [column(task) for column in self.columns
                         if not isinstance(column, (str, BarColumn))]  # fmt: skip
                line = " ".join(filter(None, (str(cell) for cell in cells)))
                self.console.print(line, markup=False, highlight=False, soft_wrap=True)


def progress_bar(console: Console) -> Progress:
    """Return a bar, or lines, with trials, time left and recovery rates (field `rates`)."""
    return _bar(
        "trials", MofNCompleteColumn(), "not fallen, recovered: {task.fields[rates]}", console
    )


def steps_bar(label: str, console: Console | None = None) -> ProgressLines:
    """Return a bar, or lines, with training steps, time left and rates (field `rate`)."""
    steps = TextColumn("{task.completed:,.0f}/{task.total:,.0f}")
    return _bar(label, steps, "{task.fields[rate]}", console)


def trials_bar(console: Console) -> Progress:
    """Return a bar, or lines, with trials, time left and what a trial is at (field `rate`)."""
    return _bar("trials", MofNCompleteColumn(), "{task.fields[rate]}", console)


def clips_bar(console: Console | None = None) -> Progress:
    """Return a bar, or lines, with clips and the one that is made (field `rate`); None: neither."""
    console = console or Console(quiet=True)
    return _bar("clips", MofNCompleteColumn(), "{task.fields[rate]}", console)


@contextmanager
def filming(seconds: float, console: Console | None = None) -> Iterator[Callable[[float], None]]:
    """Show a bar, or lines, of `seconds` that are filmed; yields what takes the time [s]."""
    count = TextColumn("{task.completed:.0f}/{task.total:.0f} s")
    with _bar("filming", count, "", console or Console(quiet=True)) as bar:
        task = bar.add_task("", total=seconds)
        yield lambda time: bar.update(task, completed=min(time, seconds))


def _bar(label: str, count: ProgressColumn, rates: str, console: Console | None) -> ProgressLines:
    """Return a progress display; the longest column is last, where it may be cut."""
    console = console or Console()
    width = 40 if console.width >= WIDTH else 10
    last = TextColumn(rates, markup=False, table_column=Column(ratio=1, no_wrap=True))
    columns = (TextColumn(label), BarColumn(width), count, TimeRemainingColumn(), last)
    return ProgressLines(*columns, console=console, disable=console.quiet, expand=True)


def print_paths(paths: Sequence[Path], console: Console) -> None:
    """Print one path per line, unwrapped, ready to copy."""
    for path in paths:
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def in_parts(cells: Mapping[str, Sequence[str]], room: int) -> list[dict[str, int]]:
    """Return headings and widths of their columns, in parts as wide as `room`.

    A column fits its longest word, and whole texts where room is left.
    """
    parts: list[dict[str, int]] = [{}]
    left = room
    for heading, texts in cells.items():
        word = max(len(word) for text in (heading, *texts) for word in text.split())
        if parts[-1] and word + PADDING > left:
            parts.append({})
            left = room
        parts[-1][heading] = word
        left -= word + PADDING
    for part in parts:
        left = room - sum(part.values()) - PADDING * len(part)
        for heading in part:
            more = min(max(map(len, (heading, *cells[heading]))) - part[heading], left)
            part[heading] += max(more, 0)
            left -= max(more, 0)
    return parts
