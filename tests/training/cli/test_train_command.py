"""training/cli/train.py: what `poise train` says of its end."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from poise.envs.sensing.realism import load_realism
from poise.training.cli.entry import main
from poise.training.cli.train import gained, last_words, parse_train, steps_note
from poise.training.learning.callbacks import Progress
from tests.support.refused import refused
from tests.support.shared import finished_run, tiny_config


@pytest.mark.parametrize(
    ("steps", "note"),
    [(192, ""), (193, "steps come in rollouts of 64: it ended at 256"), (64, "")],
)
def test_a_run_that_does_not_end_at_its_steps_says_so(
    tmp_path: Path, steps: int, note: str
) -> None:
    """Steps come in rollouts of all environments."""
    assert steps_note(tiny_config(steps=steps), tmp_path, resume=False) == note


def test_a_run_that_is_finished_says_so() -> None:
    """One that goes on counts from where it is."""
    out = finished_run()
    assert steps_note(tiny_config(), out, resume=True) == (
        f"{out} has 192 steps already; --steps says how many it is to have"
    )
    more = replace(tiny_config(), steps=200)
    assert steps_note(more, out, resume=True).endswith("it ended at 256")


def test_a_run_ends_with_what_it_measured_and_what_comes_next() -> None:
    """The rates are those of evaluations.csv; the commands name the run."""
    out = finished_run()
    with (out / "evaluations.csv").open(newline="") as file:
        first, *trained = list(csv.DictReader(file))
    best = max(trained, key=lambda row: float(row["recovered"]))
    measured, gain, evaluate, view = last_words(tiny_config(), out)
    assert measured == (
        f"of 5 held-out pushes recovered: {float(first['recovered']):.1%} by momentum-qp, "
        f"{float(best['recovered']):.1%} by {out}/best (at step {best['timesteps']})"
    )
    assert gain.startswith("gain: ") and gain.endswith(
        "0 is within: train on, or evaluate on more pushes"
    )
    assert evaluate == f"next: poise evaluate momentum-qp {out} --out out/run"
    assert view == f"      poise view {out}"


def test_the_robot_is_as_real_as_it_is_asked() -> None:
    """`--realism` is a name or a file, and the robot is else that of the configuration."""
    asked = parse_train(["--out", "run", "--realism", "lab"]).settings.env.realism
    assert asked == load_realism("lab") != parse_train(["--out", "run"]).settings.env.realism
    with refused("unknown name", "realism", value="'lap'", hint=", did you mean lab?"):
        parse_train(["--out", "run", "--realism", "lap"])


def test_a_gain_is_told_with_its_interval() -> None:
    """Of the first evaluation and the best, as independent rates [Newcombe98]."""
    start, best = ({"recovered": rate, "timesteps": 0.0} for rate in (0.5625, 0.765625))
    assert gained(start, best, 256) == "gain: +20.3 points, 95 % +12.2 to +28.1"


def test_what_comes_next_fits_the_run() -> None:
    """Its robot, an external controller, a walk; a policy alone is compared with nothing."""
    out = finished_run()
    other = replace(tiny_config(), robot="tall", controller="mine.py:Mine")
    *_, evaluate, view = last_words(other, out)
    assert evaluate.endswith(f"evaluate mine.py:Mine {out} --robot tall --out out/run "
                             "--allow mine.py:Mine")  # fmt: skip
    assert view.endswith(f"view {out} --robot tall --allow mine.py:Mine")
    assert "--suite walk-push" in last_words(replace(tiny_config(), action="walk"), out)[2]
    first, _, evaluate, _ = last_words(replace(tiny_config(), action="position"), out)
    assert "by the first policy" in first and f"evaluate {out} --out" in evaluate
    assert last_words(tiny_config(), Path("nowhere")) == []


def test_the_progress_line_tells_the_exploring_policy_from_the_held_out_rate(
    capsys: pytest.CaptureFixture[str],
) -> None:
    progress = Progress(tiny_config(steps=100))
    progress.num_timesteps = 50
    progress.locals = {"infos": [{"is_success": True}, {"is_success": False}, {}]}
    progress._on_training_start()
    progress._on_step()
    progress._on_rollout_end()
    progress.close()
    assert "recovered in training 50%" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "more", "text"),
    [
        ("x" * 300, [], "cannot be written (File name too long)"),
        ("x" * 300, ["--resume"], "cannot be written (File name too long)"),
        ("x" * 300, ["--resume", "--seeds", "0"], "cannot be written (File name too long)"),
        ("\udcff", [], "must be a name in UTF-8"),
        ("\udcff", ["--resume", "--seeds", "0"], "holds no runs to resume"),
    ],
)
def test_a_folder_that_cannot_be_is_told_in_a_line(
    name: str, more: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Too long for a file system; of bytes that are no text."""
    monkeypatch.chdir(tmp_path)
    assert main(["train", "--out", name, "--ppo.n-envs", "2", "--steps", "64", *more]) == 2
    error = capsys.readouterr().err
    assert error.startswith("poise: ") and error.count("\n") == 1 and text in error
    assert not list(tmp_path.iterdir())
