"""training/running/terminal.py."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from poise.training.running import terminal
from poise.training.running.terminal import progress_bar, steps_bar


def test_progress_is_lines_where_no_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, every ten seconds at first, then every tenth of the time that has passed."""
    clock = [0.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: clock[0])
    text = io.StringIO()
    with progress_bar(Console(file=text, width=100)) as bar:
        task = bar.add_task("", total=300, rates="")
        for second in range(300):
            clock[0] = float(second)
            bar.update(task, completed=second, rates="a 50%")
        *lines, _ = text.getvalue().splitlines() + [""]
    counts = [int(line.split("/")[0].split()[-1]) for line in lines]
    assert all("recovered: a 50%" in line and "━" not in line for line in lines)
    assert counts[:11] == list(range(0, 110, 10))
    assert counts[11:] == [110, 121, 134, 148, 163, 180, 198, 218, 240, 264, 291]


@pytest.mark.parametrize("width", [80, 120])
def test_a_bar_shows_the_time_left_in_eighty_columns(width: int) -> None:
    """What stands last is cut where there is no room, nothing else; the usual rates are whole."""
    for rate, whole in (("recovered in training 55%, 5,321/s", True), ("a" * 90, False)):
        text = io.StringIO()
        console = Console(file=text, width=width, force_terminal=True, color_system=None)
        with steps_bar("training", console) as bar:
            bar.update(bar.add_task("", total=503_808, rate=rate), completed=503_808)
        line = [each for each in text.getvalue().split("\r") if "503,808/503,808" in each][-1]
        assert "0:00:00" in line and line.count("━") == (40 if width == 120 else 10)
        assert (rate in line) == whole and ("…" in line) != whole


def test_a_quiet_console_shows_no_progress() -> None:
    """Nor does a terminal get lines beside its bar."""
    for quiet, is_terminal in ((True, False), (False, True)):
        text = io.StringIO()
        console = Console(file=text, width=100, quiet=quiet, force_terminal=is_terminal)
        with progress_bar(console) as bar:
            bar.update(bar.add_task("", total=2, rates=""), completed=1, rates="")
        assert ("trials" in text.getvalue()) == is_terminal


def test_filming_and_clips_are_shown_where_there_is_a_console(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The first line comes at once; without a console there is none."""
    text = io.StringIO()
    for console in (None, Console(file=text, width=100)):
        with terminal.filming(8.0, console) as watch:
            watch(2.0)
        with terminal.clips_bar(console) as bar:
            bar.update(bar.add_task("", total=3, rate=""), completed=1, rate="a_wave")
        assert ("filming 2/8 s" in text.getvalue()) == (console is not None)
        assert ("a_wave" in text.getvalue()) == (console is not None)
    assert capsys.readouterr().out == ""


def test_a_class_of_one_letter_is_no_emoji(capsys: pytest.CaptureFixture[str]) -> None:
    """Rich would print my.py and a red letter."""
    terminal.terminal().print("my.py:B: 3")
    assert capsys.readouterr().out == "my.py:B: 3\n"
