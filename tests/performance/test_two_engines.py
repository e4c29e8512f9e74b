"""tests/performance/two_engines.py: it goes on where it ended, and pairs the same trials."""

from pathlib import Path

import pytest

from tests.performance.two_engines import KEY, play, rows_of, table

BLOCK = {
    "block": "quiet",
    "robot": "humanoid",
    "controllers": ["momentum-qp"],
    "trials": 2,
    "seed": 3,
    "starts": [0, 1],
    "suite": {"duration": 1.1, "quiet": {"trials": 1}},
    "variants": ["mujoco", "fine=step:0.001"],
}
LATE = "24:00"


def test_it_goes_on_where_it_ended(tmp_path: Path) -> None:
    """A trial whose line is there is not played again; after the given time none begins."""
    out = tmp_path / "out.jsonl"
    play([BLOCK], out, "00:00")
    assert rows_of(out) == []
    play([BLOCK], out, LATE)
    whole = out.read_text().splitlines()
    assert len({tuple(row[key] for key in KEY) for row in rows_of(out)}) == len(whole) == 8
    assert not any(row["fallen"] or row["error"] for row in rows_of(out))
    out.write_text("\n".join(whole[:3]) + "\n")
    play([BLOCK], out, LATE)
    again = rows_of(out)
    assert out.read_text().splitlines()[:3] == whole[:3] and len(again) == 8
    chatter = {tuple(row[key] for key in KEY): row["chatter"] for row in again}
    assert len(set(chatter.values())) > 4  # of two starts and two time steps


def test_the_table_pairs_the_trials_of_both(capsys: pytest.CaptureFixture[str]) -> None:
    """A trial that one variant lacks counts for neither."""
    common = {"block": "b", "robot": "r", "controller": "c", "start": 0, "fallen": False,
              "drift": None, "cpu": 1.0, "sim": 2.0}  # fmt: skip
    rows = [
        {**common, "variant": name, "trial": k, "recovered": recovered, "chatter": chatter}
        for name, chatter, outcomes in (("one", 1.0, (1, 1, 0, 1)), ("two", 3.0, (1, 0, 1)))
        for k, recovered in enumerate(outcomes)
    ]
    table(rows)
    said = capsys.readouterr().out
    assert "one: recovered 3, not fallen 4 of 4" in said and "two: recovered 2" in said
    assert "of 3 in both: recovered 2, 2, equal 1, lost 1, won 1, p = 1, chatter ratio 3.00" in said
