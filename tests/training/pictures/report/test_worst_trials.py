"""training/pictures/report/worst_trials.py and training/benchmarking/trials/signals.py."""

from __future__ import annotations

import base64
import csv
import dataclasses
import io
import math

import numpy as np
import pytest
from PIL import Image

from poise.training.benchmarking.results.read import Record, Results, load_results
from poise.training.benchmarking.trials.table import COLUMNS
from poise.training.pictures.report import worst_trials
from poise.training.pictures.report.worst_trials import (
    choose_exhibits,
    film_again,
    frame_times,
    signals_csv,
    smallest_lost,
)
from tests.support.report_folders import finished


@pytest.fixture(scope="module")
def results() -> Results:
    return load_results(finished("random"))


def record(trial: int, name: str, recovered: bool, fraction: float, **line: str) -> Record:
    """A trial in which the fall came at once."""
    line = dict.fromkeys(COLUMNS, "") | {
        "trial": str(trial), "seed": "1", "impulse": str(fraction), "direction": "0", **line,
    }  # fmt: skip
    fall = math.nan if recovered else 1.0
    start = float(line["start"]) if line["start"] else None
    numbers = (fraction, 0.0, 0.1, fraction, fall, start)
    return Record(trial, name, recovered, not recovered, *numbers, "", line)


def made(results: Results, *records: Record) -> Results:
    return dataclasses.replace(results, records=records)


def test_a_rival_is_shown_where_the_baseline_did_better(results: Results) -> None:
    """The smallest push that only the other lost; without one, the smallest that it lost."""
    trials = made(
        results,
        *(record(0, "a", False, 0.5), record(0, "b", False, 0.5)),
        *(record(1, "a", True, 0.9), record(1, "b", False, 0.9), record(1, "c", True, 0.9)),
        *(record(2, "a", True, 1.2), record(2, "b", False, 1.2)),
    )
    a, b = choose_exhibits(trials, "a", ["a", "b", "c"])  # c lost nothing
    assert a.record.trial == 0 and a.baseline is None
    assert b.record.trial == 1 and b.baseline is not None and b.baseline.controller == "a"
    assert b.others == ("c",) and "a did" in b.reason
    (alone,) = choose_exhibits(made(results, *trials.records[:2]), "a", ["b"])
    assert alone.record.trial == 0 and alone.baseline is None and "did not recover" in alone.reason
    assert [r.trial for r in smallest_lost(trials, "b")] == [0, 1, 2]


def test_only_equal_pushes_are_compared(results: Results) -> None:
    """Trials of one number in which the pushes differ, and errors, are not."""
    trials = made(
        results,
        *(record(0, "a", True, 0.5), record(0, "b", False, 0.6)),
        record(1, "b", False, 0.1, error="ValueError: no"),
    )
    (case,) = choose_exhibits(trials, "a", ["b"])
    assert case.record.trial == 0 and case.baseline is None


def test_a_film_is_the_trial(results: Results) -> None:
    """Played again without pictures: it ends as recorded, and the signals say what happened."""
    lost = smallest_lost(results, "zero")[0]
    played = film_again(results, lost, frame_times(lost), draw=False)
    t, columns = played.signals.t, played.signals.columns
    assert played.same and not played.frames and t[0] == 0.0
    assert t[-1] == pytest.approx(lost.fall_time) and np.all(np.diff(t) > 0)
    assert {name: values.shape for name, values in columns.items()} == {
        "com": (len(t), 2), "cop": (len(t), 2), "capture_point": (len(t), 2),
        "support": (len(t), 2, 2), "angular_momentum": (len(t), 3), "torque": (len(t),),
    }  # fmt: skip
    assert np.allclose(columns["com"][0], 0.0, atol=0.1) and np.all(columns["torque"] == 0.0)


@pytest.mark.usefixtures("can_render")
def test_frames_are_taken_at_their_times(results: Results) -> None:
    """From the push to the fall, each at most a policy step late, as pictures that show much."""
    lost = smallest_lost(results, "zero")[0]
    times = frame_times(lost)
    frames = film_again(results, lost, times).frames
    assert len(times) == worst_trials.FRAMES and times[0] == float(lost.line["start"])
    assert 1 < len(frames) <= len(times)
    for (time, picture), wanted in zip(frames, times, strict=False):
        assert wanted - 1e-6 <= time <= wanted + 0.021
        image = Image.open(io.BytesIO(picture))
        assert image.size == worst_trials.SIZE and np.asarray(image).std() > 10.0
        assert len(picture) < 20_000


def test_signals_are_handed_out_in_numbers() -> None:
    """A line for every time with all columns."""
    t = np.linspace(0.0, 2.0, 5)
    columns = {name: np.column_stack([0 * t, t**3]) for name in ("com", "cop", "capture_point")}
    columns["support"] = np.tile([[-0.1, 0.1], [-0.15, 0.15]], (5, 1, 1))
    columns |= {"angular_momentum": np.zeros((5, 3)), "torque": 0.5 + 0 * t}
    text = base64.b64decode(signals_csv("trial", t, columns).url.split(",")[1]).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 5 and float(rows[-1]["t"]) == 2.0 and float(rows[-1]["com_y"]) == 8.0
    assert float(rows[0]["support_y_high"]) == 0.15 and float(rows[0]["L_z"]) == 0.0
