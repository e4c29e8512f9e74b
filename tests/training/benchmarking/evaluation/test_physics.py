"""`--physics`: a suite in another engine, kept, gone on with, and played again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.envs.physics.engines import config
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.results.pages import check_alike
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import film, replay
from tests.support.evaluations import RANDOM, InProcess, write_suite
from tests.support.shared import robot


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcess]:
    """Trials are played in this process."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    return InProcess


def test_an_engine_that_is_not_there_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(config.importlib.util, "find_spec", lambda name: None)
    suite = write_suite(tmp_path, RANDOM)
    with pytest.raises(ConfigError, match="drake is not installed: pip install 'poise"):
        evaluate(["zero"], suite, out=tmp_path / "out", physics="drake")
    assert not (tmp_path / "out").exists()


def test_a_suite_in_drake_is_kept_gone_on_with_and_played_again(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")
    suite, out = write_suite(tmp_path, RANDOM), tmp_path / "drake"
    for folder in (out, tmp_path / "again"):
        summary = evaluate(["zero"], suite, out=folder, seed=3, physics="drake", trials=2)
    assert summary["physics"] == "drake"
    one, two = ((f / "trials.csv").read_bytes() for f in (out, tmp_path / "again"))
    assert one == two
    plain = evaluate(["zero"], suite, out=tmp_path / "mujoco", seed=3, trials=2)
    assert "physics" not in plain and (tmp_path / "mujoco" / "trials.csv").read_bytes() != one
    assert in_process.played == 6
    evaluate(["zero"], suite, out=out, seed=3, physics="drake", trials=2)
    assert in_process.played == 6  # nothing was left to play
    with pytest.raises(ConfigError, match="holds a result with other"):
        evaluate(["zero"], suite, out=out, seed=3, trials=2)
    number = json.loads((out / "trials.jsonl").read_text().splitlines()[0])[0][1]
    assert not replay(out, number).differences
    with pytest.raises(ConfigError, match="physics"):
        check_alike({"a": summary, "b": plain}, lambda of: {})


@pytest.mark.usefixtures("can_render", "few_frames")
def test_a_trial_in_drake_is_filmed_as_drake_steps_it(
    tmp_path: Path, in_process: type[InProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo draws the states; its own steps take no part, even after the fall."""
    pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")
    from poise.envs.physics.engines.drake import DrakeEngine

    out = tmp_path / "drake"
    evaluate(["zero"], write_suite(tmp_path, RANDOM), out=out, seed=3, physics="drake", trials=2)
    steps, states, own = 0, set(), DrakeEngine._step

    def counted(engine: DrakeEngine) -> None:
        nonlocal steps
        own(engine)
        steps += 1
        states.add(engine.data.qpos.tobytes())

    monkeypatch.setattr(DrakeEngine, "_step", counted)
    film(out, 0, ["zero"], tmp_path / "trial.mp4", size=(64, 48))
    assert (tmp_path / "trial.mp4").read_bytes()[4:8] == b"ftyp"
    record = load_results(out).record("zero", 0)
    fall, timestep = float(record.line["fall_time"]), robot("humanoid").model.opt.timestep
    assert steps >= round(fall / timestep) and len(states) == steps


def test_what_drake_does_not_hold_is_refused_before_anything_is_written(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")
    with pytest.raises(ConfigError, match=r"drake does not hold terrain \(stairs\)"):
        evaluate(["walk"], "stairs", out=tmp_path / "out", physics="drake")
    assert not (tmp_path / "out").exists()
    bumps = tmp_path / "bumps.yaml"
    bumps.write_text("ground: {bumps: 0.02}\n")
    with pytest.raises(ConfigError, match=r"drake does not hold terrain \(bumps\)"):
        evaluate(["zero"], write_suite(tmp_path, RANDOM), out=tmp_path / "out", physics="drake",
                 realism=str(bumps))  # fmt: skip
