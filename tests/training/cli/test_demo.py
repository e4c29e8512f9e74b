"""training/cli/demo.py, and training/benchmarking/results/replay.py, which it ends with."""

from __future__ import annotations

import io
import shlex
from pathlib import Path

import imageio_ffmpeg
import pytest
from rich.console import Console

from poise.configs.errors import PoiseError
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.results.read import load_results
from poise.training.cli import demo
from poise.training.cli.entry import main
from tests.support.evaluations import ENVELOPE, RANDOM, InProcess, write_suite

BOTH = ("zero", "momentum-qp")


@pytest.fixture(autouse=True)
def played(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> type[InProcess]:
    """Trials are played in this process, small suites take the place of the demo's."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    envelope = write_suite(tmp_path, ENVELOPE, "envelope")
    monkeypatch.setattr(demo, "SUITE", envelope)
    monkeypatch.setattr(demo, "FULL_SUITES", (envelope, write_suite(tmp_path, RANDOM, "random")))
    InProcess.played, InProcess.stop_after = 0, None
    return InProcess


def run(out: Path, full: bool = False) -> list[str]:
    """Lines that the demo prints."""
    text = io.StringIO()
    console = Console(file=text, width=140)
    demo.run_demo(out, full=full, controllers=BOTH, console=console)
    return text.getvalue().rstrip().splitlines()


def test_a_table_two_plots_and_a_video(can_render: None, few_frames: None, tmp_path: Path) -> None:
    """The video shows the hardest push that the best controller recovers, of all side by side; the
    command that is printed makes it again."""
    folder = tmp_path / "my demo"
    lines = run(folder)
    *_, polar, fall, _, video, command = lines
    assert polar.endswith("polar_envelope.png") and fall.endswith("fall_probability.png")
    assert all(Path(path).is_file() for path in (polar, fall, video))
    results = load_results(folder)
    trial = demo.hardest(results)
    won = {r.trial: r.fraction for r in results.of("momentum-qp") if r.recovered}
    assert trial in won and won[trial] == max(won.values())
    words = shlex.split(command)
    assert words == ["poise", "replay", str(folder), "--trial", str(trial), "--controllers", *BOTH,
                     "--video", video]  # fmt: skip
    Path(video).unlink()
    assert main(words[1:]) == 0
    assert next(imageio_ffmpeg.read_frames(video))["size"] == (960, 480)


def test_the_full_demo_has_a_folder_for_each_suite(tmp_path: Path) -> None:
    """It names a plot of each."""
    polar, fall = run(tmp_path / "demo", full=True)[-2:]
    assert polar.endswith("envelope/polar_envelope.png")
    assert fall.endswith("random/fall_probability.png")
    assert Path(polar).is_file() and Path(fall).is_file()


def test_it_goes_on_where_it_was_stopped(
    tmp_path: Path, played: type[InProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No finished trial is played again; where nothing can be drawn, a line says so."""

    def nothing(*_: object) -> None:
        raise PoiseError("no OpenGL")

    monkeypatch.setattr(demo, "film", nothing)
    played.stop_after = 7
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "demo")
    played.stop_after = None
    lines = run(tmp_path / "demo")
    assert "continuing after 7 finished trials" in lines
    assert lines[-1] == "no video: no OpenGL"
    count = played.played
    run(tmp_path / "demo")
    assert played.played == count == 28
