"""`poise evaluate`: evaluation/run.py and tables.py, trials/jobs.py."""

from __future__ import annotations

import csv
import io
import json
import multiprocessing
from pathlib import Path
from typing import Any

import pytest
import yaml
from rich.console import Console

from poise.configs.errors import PoiseWarning
from poise.configs.files import resolve
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate, measured_limits
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.summary import read_summary
from poise.training.benchmarking.trials.table import CASE_COLUMNS
from poise.training.running.executor import Executor
from poise.training.running.provenance import Circumstances
from poise.training.running.summary import Summary
from tests.support.benchmarks_small import TRIALS, write_small
from tests.support.evaluations import ENVELOPE, RANDOM, InProcess, random_suite, write_suite
from tests.support.refused import invalid

BOTH = ("momentum-qp", "zero")


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcess]:
    """Trials are played in this process."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    return InProcess


def lines(folder: Path) -> list[dict[str, str]]:
    with (folder / "trials.csv").open(newline="") as file:
        return list(csv.DictReader(file))


PUSHES = {"magnitude": [1.0, 1.0], "unit": "impulse"}


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"levels": ["nowhere.yaml"], "quiet": {}}, "realism"),
        ({"random": {"trials": 1, "pushes": {**PUSHES, "bodies": ["tail"]}}}, "bodies"),
        ({"random": {"trials": 1, "pushes": {**PUSHES, "magnitude": [1e15, 1e15]}}}, "impulse"),
    ],
)
def test_what_does_not_fit_names_the_suites_file(
    tmp_path: Path, fields: dict[str, Any], field: str
) -> None:
    """Also where the robot, or what is drawn, shows it."""
    suite = write_suite(tmp_path, fields)
    with invalid(field, source=str(suite)):
        evaluate(["zero"], suite, out=tmp_path / "out")


@pytest.mark.weekly
def test_results_do_not_depend_on_the_number_of_workers(
    tmp_path: Path, in_process: type[InProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    """trials.csv has the same bytes from two processes and from one, in whatever order."""
    suite = write_suite(tmp_path, RANDOM)
    evaluate(BOTH, suite, out=tmp_path / "one", seed=3)
    monkeypatch.setattr(evaluation, "Executor", Executor)
    evaluate(BOTH, suite, out=tmp_path / "two", seed=3, workers=2)
    one, two = ((tmp_path / name / "trials.csv").read_bytes() for name in ("one", "two"))
    assert one == two
    summaries = [json.loads((tmp_path / n / "summary.json").read_text()) for n in ("one", "two")]
    for name in ("controllers", "pairs", "suite", "seed", "robot"):
        assert summaries[0][name] == summaries[1][name]


def test_controllers_meet_the_same_trials(tmp_path: Path, in_process: type[InProcess]) -> None:
    """One line per trial and controller, alike in everything but the outcome."""
    out = tmp_path / "out"
    summary = evaluate(BOTH, write_suite(tmp_path, RANDOM), out=out, seed=1)
    rows = lines(out)
    assert [(row["trial"], row["controller"]) for row in rows] == [
        (str(n), name) for n in range(4) for name in BOTH
    ]
    for a, b in zip(rows[::2], rows[1::2], strict=True):
        shared = [name for name in CASE_COLUMNS if name != "controller"]
        assert [a[name] for name in shared] == [b[name] for name in shared]
    assert len({row["seed"] for row in rows}) == 4
    pair, trials = summary["pairs"][0], summary["controllers"]["zero"]["trials"]
    assert trials == 4
    assert pair["both"] + pair["only_a"] + pair["only_b"] + pair["neither"] == 4
    assert (pair["a"], pair["b"]) == BOTH


def test_the_summary_has_what_readers_rely_on(tmp_path: Path, in_process: type[InProcess]) -> None:
    """The keys of summary.json, the plots, and the table of a suite that measures J50."""
    out, text = tmp_path / "out", io.StringIO()
    console = Console(file=text, width=140)
    evaluate(BOTH, write_suite(tmp_path, ENVELOPE), out=out, seed=2, console=console)
    summary = json.loads((out / "summary.json").read_text())
    assert set(summary) == Summary.__required_keys__ > Circumstances.__required_keys__
    for entry in summary["controllers"].values():
        assert {
            "trials", "recovered", "recovered_rate", "recovered_ci95", "solver_failures",
            "j50_mean", "j50_mean_ci95", "eta_mean", "eta_min", "directions",
        } <= set(entry)  # fmt: skip
        assert entry["trials"] == 2 * (3 + 2 * 2) == len(lines(out)) // 2
        for direction in entry["directions"]:
            assert {"direction", "j50", "j50_ci95", "eta"} <= set(direction)
    assert {
        "a", "b", "both", "only_a", "only_b", "neither", "p_mcnemar", "j50_gain", "j50_gain_ci95",
    } <= set(summary["pairs"][0])  # fmt: skip
    assert [row["stage"] for row in lines(out)].count("1") == 2 * 3 * 2
    for name in ("polar_envelope.png", "fall_probability.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")
        assert str(out / name) in text.getvalue()
    assert "mean J50 [N·s]" in text.getvalue() and "zero against momentum-qp" in text.getvalue()


def test_the_summary_tells_a_level(tmp_path: Path, in_process: type[InProcess]) -> None:
    suite = write_suite(tmp_path, RANDOM)
    evaluate(["zero"], suite, out=tmp_path / "out", trials=1, realism="late+arms")
    summary = read_summary(tmp_path / "out/summary.json")
    assert summary["realism"] == "late+arms"


def test_a_controller_that_ran_in_place_of_another_is_named(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """In the summary, with its trials, and in a line under the table; not where none ran."""
    suite, text = write_suite(tmp_path, random_suite(2)), io.StringIO()
    names = ["feedback-step", "momentum-qp"]
    for level, expected in (("field", {"feedback-step-field": 2}), ("ideal", None)):
        console = Console(file=text, width=200)
        out = tmp_path / level
        summary = evaluate(names, suite, out=out, realism=level, console=console)
        entries = summary["controllers"]
        assert entries["feedback-step"].get("stand_ins") == expected
        assert "stand_ins" not in entries["momentum-qp"]
        assert read_summary(out / "summary.json")["controllers"].keys() == entries.keys()
    line = "feedback-step: feedback-step-field ran in its place in 2 of 2 trials"
    assert text.getvalue().count(line) == 1


def test_a_stopped_evaluation_ends_as_if_it_had_not_been(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """After Ctrl-C there is no summary; the same call goes on, in both stages, to the same end."""
    suite, out = write_suite(tmp_path, ENVELOPE), tmp_path / "out"
    evaluate(["momentum-qp"], suite, out=tmp_path / "whole", seed=2)
    total = in_process.played
    for stop in (2, 8):
        in_process.played, in_process.stop_after = 0, stop - (2 if stop == 8 else 0)
        with pytest.raises(KeyboardInterrupt):
            evaluate(["momentum-qp"], suite, out=out, seed=2)
        assert {path.name for path in out.iterdir()} == {"settings.yaml", "trials.jsonl"}
    in_process.played, in_process.stop_after = 0, None
    evaluate(["momentum-qp"], suite, out=out, seed=2)
    assert in_process.played == total - 8
    assert (out / "trials.csv").read_bytes() == (tmp_path / "whole/trials.csv").read_bytes()


def test_a_finished_evaluation_is_not_played_again(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """A lost table is written anew; another controller adds its own trials only, unless trials
    depend on who takes part."""
    suite, out = write_suite(tmp_path, RANDOM), tmp_path / "out"
    before = evaluate(["zero"], suite, out=out, seed=1)
    rows = (out / "trials.csv").read_bytes()
    (out / "trials.csv").unlink()
    evaluate(["zero"], suite, out=out, seed=1)
    assert in_process.played == 4 and (out / "trials.csv").read_bytes() == rows
    summary = evaluate(["momentum-qp"], suite, out=out, seed=1)
    assert in_process.played == 8 and list(summary["controllers"]) == ["zero", "momentum-qp"]
    assert summary["controllers"]["zero"] == before["controllers"]["zero"]
    envelope = write_suite(tmp_path, ENVELOPE, "envelope")
    evaluate(["zero"], envelope, out=tmp_path / "env")
    with invalid("controllers"):
        evaluate(["momentum-qp"], envelope, out=tmp_path / "env")


def test_a_finished_result_stays_readable_while_others_are_added(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """One that cannot be added changes nothing; a stop leaves what was finished, and goes on."""
    suite, out, own = write_suite(tmp_path, RANDOM), tmp_path / "out", tmp_path / "own.yaml"
    own.write_text("kind: pd\n")
    before = evaluate([str(own)], suite, out=out, seed=1)
    files = {path.name: path.read_bytes() for path in out.iterdir()}
    own.write_text("kind: pd\nperiod: 0.002\n")
    with invalid("controllers", "own.yaml"):
        evaluate(["zero"], suite, out=out, seed=1)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == files
    own.write_text("kind: pd\n")
    in_process.played, in_process.stop_after = 0, 2
    with pytest.raises(KeyboardInterrupt):
        evaluate(["zero"], suite, out=out, seed=1)
    results = load_results(out)
    assert results.summary["controllers"].keys() == before["controllers"].keys() == {str(own)}
    assert results.settings.controllers.keys() == {str(own)} and len(results.records) == 4
    in_process.stop_after = None
    evaluate(["zero"], suite, out=out, seed=1)
    assert in_process.played == 4 and load_results(out).controllers == (str(own), "zero")


def test_one_command_plays_what_the_other_has_suites_for(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """Factors, margins and the mix, with the plots of an evaluation; every pair is compared."""
    names = ["zero", "pd", "momentum-qp"]
    summary = evaluate(names, write_small(tmp_path), out=tmp_path / "out", seed=2)
    assert summary["rated"] == "mix" and summary["scale"] == "baseline J50"
    assert [(pair["a"], pair["b"]) for pair in summary["pairs"]] == [
        ("zero", "pd"), ("zero", "momentum-qp"), ("pd", "momentum-qp"),
    ]  # fmt: skip
    for entry in summary["controllers"].values():
        assert entry["trials"] == 2 and entry["evaluated"] == TRIALS and entry["factors"]
    assert (tmp_path / "out/polar_envelope.png").exists()


def test_a_quiet_suite_counts_falls_and_drift(tmp_path: Path, in_process: type[InProcess]) -> None:
    """Without a push there are no plots, and the table shows the drift."""
    text = io.StringIO()
    suite = write_suite(tmp_path, {"duration": 2.5, "quiet": {"trials": 2}})
    summary = evaluate(
        ["momentum-qp"], suite, out=tmp_path / "out", console=Console(file=text, width=140)
    )
    entry = summary["controllers"]["momentum-qp"]
    assert entry["fallen"] == 0 and entry["recovered"] == 2 and entry["com_drift_max"] < 0.02
    assert not list((tmp_path / "out").glob("*.png")) and "CoM drift" in text.getvalue()


def test_measured_limits_are_what_the_random_suite_pushes_by(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """An envelope's J50s, written to a file, scale the pushes of the next evaluation."""
    summary = evaluate(["momentum-qp"], write_suite(tmp_path, ENVELOPE), out=tmp_path / "env")
    limits = tmp_path / "limits.yaml"
    measured_limits(summary, limits, "humanoid")
    table = yaml.safe_load(limits.read_text())["table"]
    j50 = [d["j50"] for d in summary["controllers"]["momentum-qp"]["directions"]]
    assert table["impulses"] == pytest.approx(j50, abs=1e-3)
    suite = write_suite(tmp_path, random_suite(2))
    found = evaluate(["momentum-qp"], suite, out=tmp_path / "random", limits=limits)
    assert found["controllers"]["momentum-qp"]["fraction_of"] == "baseline J50"
    with invalid("suite"):
        measured_limits(found, tmp_path / "none.yaml", "humanoid")
    own = str(resolve("robots", "compact"))
    share = {"magnitude": [0.5, 0.5], "unit": "controller_fraction"}
    suite = write_suite(tmp_path, {"duration": 1.6, "random": {"trials": 1, "pushes": share}})
    with pytest.warns(PoiseWarning, match="no J50 of compact is known.*ankle limit"):
        evaluate(["momentum-qp"], suite, out=tmp_path / "own", robot=own)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"controllers": []}, ("controller",)),
        ({"controllers": ["zero", "zero"]}, ("controllers", "'zero'")),
        ({"controllers": ["pid"]}, ("controller", "'pid'", "momentum-qp")),
        ({"suite": "rndom"}, ("suite", "'rndom'", "envelope")),
        ({"robot": "robby"}, ("robot", "'robby'", "humanoid")),
        ({"seed": -1}, ("seed", "0", "-1")),
        ({"workers": 0}, ("workers", "1", "0")),
        ({"trials": 0}, ("trials", "1", "0")),
        ({"limits": "nowhere"}, ("limits",)),
    ],
)
def test_bad_input_is_refused_and_nothing_is_written(
    tmp_path: Path, arguments: dict[str, Any], message: tuple[str, ...]
) -> None:
    """One clear error, before the folder is made."""
    given = {"controllers": ["zero"], "suite": "quiet", "out": tmp_path / "out", **arguments}
    with invalid(*message):
        evaluate(**given)
    assert not (tmp_path / "out").exists()


@pytest.mark.weekly
def test_a_dead_worker_costs_nothing_that_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A process killed from outside is one line; the trials are those of an undisturbed run."""
    suite = write_suite(tmp_path, random_suite(12))
    appended, killed = evaluation.ResultFolder.append, []

    def append_and_kill(folder: Any, *finished: Any) -> None:
        appended(folder, *finished)
        if not killed:
            killed.extend(multiprocessing.active_children())
            for process in killed:
                process.kill()

    with monkeypatch.context() as patch:
        patch.setattr(evaluation.ResultFolder, "append", append_and_kill)
        evaluate(["zero"], suite, out=tmp_path / "out", workers=1)
    assert len(killed) == 1 and capsys.readouterr().err.count("has died by SIGKILL") == 1
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.stop_after = None
    evaluate(["zero"], suite, out=tmp_path / "whole")
    same = [(tmp_path / name / "trials.csv").read_bytes() for name in ("out", "whole")]
    assert same[0] == same[1]


def test_a_suite_is_played_again_at_levels(tmp_path: Path, in_process: type[InProcess]) -> None:
    """Figures of each level stand beside the first; all else is of the first alone, bit for bit."""
    parts = {**ENVELOPE, "quiet": {"trials": 2}}
    alone = evaluate(BOTH, write_suite(tmp_path, parts), out=tmp_path / "alone", seed=3)
    told = io.StringIO()
    suite = write_suite(tmp_path, {**parts, "levels": ["field"]})
    summary = evaluate(
        BOTH, suite, out=tmp_path / "again", seed=3, console=Console(file=told, width=120)
    )
    for name in BOTH:
        entry: dict[str, Any] = dict(summary["controllers"][name])
        ideal, field = entry.pop("levels")
        assert (ideal["level"], field["level"]) == ("ideal", "field")
        assert ideal["j50_mean"] == entry["j50_mean"]
        if name == "momentum-qp":  # of the other, nothing stands
            assert ideal["torque_variation_median"] < field["torque_variation_median"]
        assert field["unpushed"] == 2
        assert entry.pop("evaluated") == 2 * alone["controllers"][name]["evaluated"]
        before: dict[str, Any] = dict(alone["controllers"][name])
        before.pop("evaluated")
        for each in (entry, before):
            each.pop("losses", None)
        assert entry == before
    one, two = summary["controllers"]["momentum-qp"]["levels"]
    assert (one["j50_mean_bound"], two["j50_mean_bound"]) == ("upper", None)
    assert two["j50_kept"] is None  # nothing is kept of a bound
    assert f"≤ {one['j50_mean']:.1f} " in told.getvalue()
    assert "by realism level" in told.getvalue()
    marks = {line["part"]: line["realism"] for line in lines(tmp_path / "again")}
    assert marks["quiet@field"] == marks["envelope@field"] == "field"
    assert not marks["quiet"]
    load_results(tmp_path / "again")
