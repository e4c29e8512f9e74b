"""training/pictures/report/factors.py, and the ranking of a suite with a mix."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from markupsafe import escape

from poise.configs.errors import ConfigError
from poise.training.benchmarking.evaluation.evaluate import benchmark
from poise.training.benchmarking.results.read import Results, load_results
from poise.training.pictures.report import factors as factor_tables
from poise.training.pictures.report.cells import Table
from poise.training.pictures.report.tables import ranking
from tests.support.benchmarks_small import play_in_process, write_small
from tests.support.report_folders import copied, finished


@pytest.fixture(scope="module")
def results() -> Results:
    return load_results(finished("benchmark"))


def rows(table: Table | None) -> list[dict[str, str]]:
    assert table is not None
    return list(csv.DictReader(io.StringIO(table.csv())))


def test_every_level_is_in_the_table_and_a_picture(results: Results) -> None:
    """Rates are those of the trials, the standard case is among the levels."""
    table = rows(factor_tables.factor_table(results))
    for row in table:
        level = "standard" if row["level"] in ("0.8", "0", "1") else row["level"]
        factors = (row["factor"], "standard")
        own = [
            record.recovered
            for record in results.of(row["controller"])
            if record.line["level"] == level and record.line["factor"] in factors
        ]
        assert (len(own), sum(own)) == (int(row["trials"]), int(row["recovered"]))
    factors = tuple(dict.fromkeys(row["factor"] for row in table))
    assert factors == ("friction", "delay", "mass_error", "pushes")
    pictures = factor_tables.factor_plots(results, results.summary["ranking"])
    assert [p["title"] for p in pictures] == [
        "Friction", "Delay of the sensors [s]", "Error of the masses", "Number of pushes",
    ]  # fmt: skip
    for row in table:
        rate, low, high = (
            f"{float(row[f'recovered_rate{end}']):.0%}" for end in ("", "_low", "_high")
        )
        picture = pictures[factors.index(row["factor"])]["picture"]
        assert str(escape(f"{row['controller']}: {rate} ({low} to {high})")) in picture


def test_sensitivity_is_the_worst_level(results: Results) -> None:
    """In percent points against the standard case of the same controller."""
    name = results.controllers[0]
    levels = [(level["recovered_rate"], bool(level["standard"]))
              for factor in results.summary["controllers"][name]["factors"]
              if factor["factor"] == "mass_error" for level in factor["levels"]]  # fmt: skip
    (base,) = [rate for rate, standard in levels if standard]
    row = rows(factor_tables.sensitivity(results, [name]))[0]
    assert float(row["standard"]) == base
    worst = min(rate for rate, standard in levels if not standard)
    assert float(row["mass_error"]) == pytest.approx(100 * (worst - base))


def test_indicators_are_those_of_the_summary(results: Results) -> None:
    """Sway, time, and a margin for each direction in which it was sought."""
    for row in rows(factor_tables.indicators(results, results.summary["ranking"])):
        found = results.summary["controllers"][row["controller"]]["eurobench"]
        assert row["body_sway_mean"] == ("" if found["body_sway_mean"] is None
                                         else str(found["body_sway_mean"]))  # fmt: skip
        (margin,) = found["margins"]
        if "margin_90_force" in row:
            assert row["margin_90_force"] == str(margin.get("force", ""))


def test_the_ranking_counts_the_mix(results: Results) -> None:
    """J50 of the envelope, rate, trials, lost and won of the random mix, time of a tick."""
    for row in rows(ranking(results, results.reference)):
        entry = results.summary["controllers"][row["controller"]]
        assert float(row["j50_mean"]) == entry["j50_mean"] and float(row["tick_us"]) == 12.5
        mix = [r for r in results.of(row["controller"]) if r.part == "mix"]
        assert int(row["trials"]) == entry["trials"] == len(mix) == 2
        assert float(row["recovered_rate"]) == sum(r.recovered for r in mix) / 2
        pair = results.summary["pairs"][0]
        if row["controller"] == pair["b"]:
            assert (int(row["lost"]), int(row["won"])) == (pair["only_a"], pair["only_b"])


def test_errors_are_listed_with_their_seeds(tmp_path: Path) -> None:
    """What a controller raised, and where."""
    folder = copied("benchmark", tmp_path)
    with open(folder / "trials.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    last = lines[-1]
    assert last["error"] == "" and last["recovered"] == "False"
    last["error"] = "ValueError: <no>"
    with open(folder / "trials.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, list(last))
        writer.writeheader()
        writer.writerows(lines)
    results = load_results(folder)
    (row,) = rows(factor_tables.error_table(results))
    assert row["error"] == "ValueError: <no>" and row["seed"] == last["seed"]
    assert factor_tables.error_table(load_results(finished("benchmark"))) is None


def test_training_seeds_have_a_row_for_each_group(tmp_path: Path) -> None:
    """Means with intervals; nothing where no folders of one configuration took part."""
    folder = copied("benchmark", tmp_path)
    data = json.loads((folder / "summary.json").read_text())
    assert factor_tables.seed_table(load_results(folder)) is None
    figures = {"iqm": 0.8, "iqm_ci95": [0.7, 0.9], "tasks": 2, "values": [0.65, 0.9],
               "worst": 0.65, "worst_seed": 1}  # fmt: skip
    data["seeds"] = [{"name": "runs", "members": ["runs/0", "runs/1"], "seeds": [0, 1],
                      "eta": figures}]  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(data))
    (row,) = rows(factor_tables.seed_table(load_results(folder)))
    assert row["name"] == "runs" and row["eta_iqm_high"] == "0.9" and row["eta_worst"] == "0.65"
    assert "recovered_iqm" not in row


def first(data: dict[str, Any]) -> dict[str, Any]:
    return next(iter(data["controllers"].values()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.update(robot="humanoid"), "robot: must be a mapping"),
        (lambda data: data.update(pairs={}), "pairs: must be a list"),
        (lambda data: data.update(controllers=[]), "controllers: must be a mapping"),
        (lambda data: data.update(rated=3), "rated: must be text"),
        (lambda data: first(data).update(factors="all"), "factors: must be a list"),
        (lambda data: first(data)["factors"][0]["levels"][0].update(trials=None), "trials"),
        (
            lambda data: first(data)["factors"][0]["levels"][0].update(level=3),
            "level: must be text",
        ),
        (
            lambda data: first(data)["eurobench"].update(margins=[1]),
            "margins[0]: must be a mapping",
        ),
    ],
)
def test_a_summary_of_another_form_is_refused(
    change: Callable[[dict[str, Any]], None], message: str, tmp_path: Path
) -> None:
    """One line that names the file and the field."""
    folder = copied("benchmark", tmp_path)
    data = json.loads((folder / "summary.json").read_text())
    change(data)
    (folder / "summary.json").write_text(json.dumps(data))
    with pytest.raises(ConfigError) as caught:
        load_results(folder)
    assert message in str(caught.value) and "summary.json" in str(caught.value)


def test_without_a_mix_all_trials_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rate is then that of everything that was played."""
    play_in_process(monkeypatch)
    suite = write_small(tmp_path, mix=None, factors=None)
    benchmark(["momentum-qp", "zero"], suite, out=tmp_path / "out")
    results = load_results(tmp_path / "out")
    assert results.summary["rated"] is None
    for name, entry in results.summary["controllers"].items():
        assert entry["trials"] == len(results.of(name)) == entry["evaluated"]
        assert entry["recovered"] == sum(r.recovered for r in results.of(name))
    (pair,) = results.summary["pairs"]
    assert pair["all"] is not None and pair["both"] == pair["all"]["both"]
