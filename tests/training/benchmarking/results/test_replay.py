"""training/benchmarking/results/replay.py."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
import yaml
from rich.console import Console

from poise.configs.errors import ConfigError
from poise.envs.physics.collapse import DURATION
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.results.replay import film, replay
from tests.support.evaluations import RANDOM, InProcess, write_suite


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished evaluation of a controller's file and of no control."""
    path = tmp_path_factory.mktemp("replay")
    (path / "soft.yaml").write_text("kind: momentum-qp\ncom: {stiffness: 5.0}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "Executor", InProcess)
        InProcess.stop_after = None
        suite = write_suite(path, RANDOM)
        evaluate([str(path / "soft.yaml"), "zero"], suite, out=path / "out", seed=4)
    return path


def test_every_trial_ends_as_recorded(folder: Path) -> None:
    """Played again alone, each trial has the same outcome, bit for bit, as in its evaluation."""
    for trial in range(4):
        for name in (str(folder / "soft.yaml"), "zero"):
            again = replay(folder / "out", trial, name)
            assert again.controller == name and again.differences == {}
    assert replay(folder / "out", 0).controller == "zero"


def test_another_outcome_is_told(folder: Path, tmp_path: Path) -> None:
    """What differs from the record is named, with both values."""
    for name in ("settings.yaml", "summary.json", "trials.csv"):
        (tmp_path / name).write_text((folder / "out" / name).read_text())
    path = tmp_path / "trials.csv"
    again = replay(tmp_path, 1, "zero")
    path.write_text(path.read_text().replace(str(again.outcome.max_com), "0.5"))
    assert replay(tmp_path, 1, "zero").differences == {
        "max_com": ("0.5", str(again.outcome.max_com))
    }


def test_a_plot_over_time_is_written(folder: Path, tmp_path: Path) -> None:
    """The signals of the trial, in a picture."""
    replay(folder / "out", 2, str(folder / "soft.yaml"), plot=tmp_path / "trial.png")
    assert (tmp_path / "trial.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("can_render", "few_frames")
def test_a_video_is_written(folder: Path, tmp_path: Path) -> None:
    """The trial as an MP4."""
    replay(folder / "out", 2, "zero", video=tmp_path / "trial.mp4")
    assert (tmp_path / "trial.mp4").read_bytes()[4:8] == b"ftyp"


def test_wrong_names_are_refused(folder: Path, tmp_path: Path) -> None:
    """No such folder, trial or controller; the text says what there is."""
    with pytest.raises(ConfigError, match="settings.yaml, summary.json, trials.csv missing"):
        replay(tmp_path, 0)
    with pytest.raises(ConfigError, match="no trial 4; they are numbered from 0 to 3"):
        replay(folder / "out", 4)
    with pytest.raises(ConfigError, match="'pid' took no part.*choices.*zero"):
        replay(folder / "out", 0, "pid")


def test_what_has_changed_since_is_refused(folder: Path, tmp_path: Path) -> None:
    """Other gains or another robot under the same name are not what was evaluated."""
    for name in ("settings.yaml", "summary.json", "trials.csv"):
        (tmp_path / name).write_text((folder / "out" / name).read_text())
    settings = yaml.safe_load((tmp_path / "settings.yaml").read_text())
    name = next(iter(settings["controllers"]))
    for change, message in (
        ({"controllers": {**settings["controllers"], name: "0"}}, "controller.*has changed"),
        ({"robot_fingerprint": "0"}, "robot 'humanoid' has changed"),
    ):
        (tmp_path / "settings.yaml").write_text(yaml.safe_dump({**settings, **change}))
        with pytest.raises(ConfigError, match=message):
            replay(tmp_path, 0, name)


def test_a_stopped_evaluation_cannot_be_replayed(folder: Path, tmp_path: Path) -> None:
    """Without a summary there is no finished evaluation."""
    (tmp_path / "settings.yaml").write_text((folder / "out/settings.yaml").read_text())
    with pytest.raises(ConfigError, match="no finished result: summary.json, trials.csv missing"):
        replay(tmp_path, 0)


@pytest.mark.usefixtures("can_render")
def test_several_controllers_are_filmed_side_by_side(folder: Path, tmp_path: Path) -> None:
    """As an animation for pages, too: small, until the last one has ended."""
    from PIL import Image

    names = ["zero", str(folder / "soft.yaml")]
    told = io.StringIO()
    film(
        folder / "out",
        2,
        names,
        tmp_path / "trial.webp",
        fps=5.0,
        size=(64, 48),
        console=Console(file=told),
    )
    assert re.search(r"filming \d/\d s", told.getvalue())
    outcomes = [replay(folder / "out", 2, name).outcome for name in names]
    # a robot that has fallen is shown until it lies on the ground
    ends = [1.6 if o.fall_time is None else o.fall_time + DURATION for o in outcomes]
    with Image.open(tmp_path / "trial.webp") as shown:
        assert shown.size == (128, 48)
        lasts = []
        for frame in range(shown.n_frames):
            shown.seek(frame)
            shown.load()
            lasts.append(shown.info["duration"])
    assert max(ends) <= sum(lasts) / 1000.0 <= max(ends) + 0.4
