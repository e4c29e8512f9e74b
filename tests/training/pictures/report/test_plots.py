"""training/pictures/report/plots.py: what a report draws of a result; here, the limits of steps."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.training.pictures.report.page import write_report
from tests.support.report_folders import copied
from tests.support.weekly import daily
from tests.training.pictures.report.test_page import Page

DOTS = {1: "1.3 2", 2: "1.3 3.9"}  # the dashes of the limits of one and of two steps


@pytest.mark.parametrize("kind", daily(["benchmark-steps", "envelope-steps"]))
def test_limits_of_steps_are_shown_where_somebody_steps(kind: str, tmp_path: Path) -> None:
    """Lines with their names, shares in the table; an old folder, without them, has neither."""
    folder = copied(kind, tmp_path)
    source = json.loads((folder / "summary.json").read_text())
    text = write_report(folder, films=False).read_text()
    for k, name in ((1, "one-step limit"), (2, "two-step limit")):
        assert f"<span>{name}</span>" in text and text.count(f'dasharray="{DOTS[k]}"') == 1
    entries = source["controllers"]["capture-step"]["directions"]
    rows = list(csv.DictReader(io.StringIO(Page(text).files["directions.csv"])))
    shares = [row["step_share_inf"] for row in rows]
    assert [float(share) for share in shares if share] == [e["step_share_inf"] for e in entries]
    assert [row["controller"] for row, share in zip(rows, shares, strict=True) if share] == [
        "capture-step"
    ] * len(entries)
    source["step_limits"] = []
    for entry in entries:
        for key in [key for key in entry if key.startswith("step_")]:
            del entry[key]
    (folder / "summary.json").write_text(json.dumps(source))
    text = write_report(folder, films=False).read_text()
    assert (
        not any(f'dasharray="{dots}"' in text for dots in DOTS.values())
        and "-step limit" not in text
    )
    assert "step_share" not in Page(text).files["directions.csv"]


@pytest.mark.parametrize(
    "value",
    [
        "far",
        [{"controllers": ["nobody"], "curves": {}}],
        [{"controllers": 5}],
        [{"controllers": ["zero"]}],
        [{"controllers": [], "steps": {}, "curves": {"directions": [0.0], "1": [1.0], "2": [1.0]}}],
        [{"controllers": ["zero"], "steps": {}, "curves": {"directions": [0.0], "1": [True]}}],
        [{"controllers": ["zero"], "steps": {}, "curves": {"directions": [0.0], "1": [1.0, 2.0]}}],
        [{"controllers": ["zero"], "steps": {}, "curves": {"directions": [0.0], "1": [1.0]}}],
        [{"controllers": ["zero"], "steps": {}, "curves": {}}],
    ],
)
def test_limits_of_steps_of_another_form_are_refused(value: object, tmp_path: Path) -> None:
    """One line that names the field."""
    folder = copied("envelope", tmp_path)
    data = json.loads((folder / "summary.json").read_text()) | {"step_limits": value}
    (folder / "summary.json").write_text(json.dumps(data))
    with pytest.raises(ConfigError, match=r"summary\.json"):
        write_report(folder, films=False)
