"""training/benchmarking/metrics/seed_groups.py."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from poise.configs.errors import ConfigError
from poise.training.benchmarking.metrics import seed_groups as module
from poise.training.benchmarking.metrics.seed_groups import seed_groups, seed_lines
from poise.training.benchmarking.statistics.rates import seed_figures
from poise.training.learning.seeds.records import expand_seeds


def write_seeds(out: Path, **runs: bool) -> Path:
    """A folder as of `poise train --seeds`, without policies; name of a run → whether finished."""
    out.mkdir(parents=True)
    entries = []
    for seed, (name, finished) in enumerate(runs.items()):
        (out / name).mkdir()
        entries.append({"seed": seed, "folder": name, "finished": finished})
    (out / "seeds.json").write_text(json.dumps({"runs": entries}))
    return out


@pytest.fixture
def configurations(monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder's name is its configuration's letter and its seed."""
    monkeypatch.setattr(module, "_configuration", lambda f: (Path(f).name[0], int(Path(f).name[1])))


def test_seeds_of_one_configuration_are_taken_together(
    tmp_path: Path, configurations: None
) -> None:
    """Two folders that differ in the seed alone; the IQM of four scores drops the outer two."""
    names = []
    for name in ("a0", "a1", "b0"):
        (tmp_path / name).mkdir()
        names.append(str(tmp_path / name))
    scores = dict(zip(names, ([0.1, 0.6], [0.8, 1.9], [9.0, 9.0]), strict=True))
    entries: dict[str, Any] = {
        name: {
            "directions": [{"eta": eta} for eta in etas],
            "j50_mean": 20.0 * etas[0],
            "recovered_rate": etas[0],
        }
        for name, etas in scores.items()
    }
    entries["pd"] = {}
    (group,) = seed_groups(["pd", *names], entries)
    assert group["members"] == names[:2] and group["seeds"] == [0, 1]
    assert group["name"] == ", ".join(names[:2])
    assert group["eta"]["iqm"] == pytest.approx(0.7) and group["eta"]["tasks"] == 2
    assert group["eta"]["values"] == pytest.approx([0.35, 1.35])
    assert (group["eta"]["worst"], group["eta"]["worst_seed"]) == (pytest.approx(0.35), 0)
    assert group["recovered"]["iqm"] == pytest.approx(0.45)
    assert group["j50_mean"]["iqm"] == pytest.approx(9.0)
    low, high = group["eta"]["iqm_ci95"]
    assert low < 0.7 < high


ENTRY: Any = {"recovered_rate": 0.5}


def test_checkpoints_of_one_run_are_no_seeds(tmp_path: Path, configurations: None) -> None:
    """The best and the last policy of seed 0 are not taken together."""
    names = [str(tmp_path / run / "a0") for run in ("best", "last")]
    for name in names:
        Path(name).mkdir(parents=True)
    assert seed_groups(names, {name: ENTRY for name in names}) == []


def test_a_folder_of_seeds_stands_for_its_runs(tmp_path: Path, configurations: None) -> None:
    """In their order, among other names; the group bears the folder's name."""
    out = write_seeds(tmp_path / "five", a0=True, a1=True)
    names = expand_seeds(["pd", str(out), "zero"])
    assert names == ("pd", str(out / "a0"), str(out / "a1"), "zero")
    entries: dict[str, Any] = {
        name: {"recovered_rate": 0.5 + 0.1 * k} for k, name in enumerate(names)
    }
    (group,) = seed_groups(names, entries)
    assert group["name"] == str(out) and group["recovered"]["values"] == [0.6, 0.7]
    (line,) = seed_lines([group])
    assert f"2 training seeds, {out}: recovered 65.0%" in line
    assert line.endswith("worst 60.0% (seed 0)")


def test_unfinished_and_damaged_seeds_are_refused(tmp_path: Path) -> None:
    """The text names the file, and the seed and the way out."""
    out = write_seeds(tmp_path / "two", a0=True, a1=False)
    on = "seeds.json: the run of seed 1 is not finished: poise train --resume --out .*two goes on"
    with pytest.raises(ConfigError, match=on):
        expand_seeds([str(out)])
    for text in ("{", "[]", '{"runs": [{"seed": "one", "folder": "a"}]}', '{"runs": [{}]}'):
        (out / "seeds.json").write_text(text)
        with pytest.raises(ConfigError, match="seeds.json: (is not valid|must be|runs: )"):
            expand_seeds([str(out)])


def test_figures_are_those_of_scipy() -> None:
    """IQM by scipy's trimmed mean; the interval of seeds by scipy's bootstrap of one task."""
    rng = np.random.default_rng(5)
    scores = rng.normal(0.6, 0.1, size=(10, 3))
    found = seed_figures(scores, range(10))
    assert found["iqm"] == pytest.approx(stats.trim_mean(scores, 0.25, axis=None))
    assert found["worst_seed"] == int(np.argmin(scores.mean(axis=1)))
    one = seed_figures(scores[:, :1], range(10))
    expected = stats.bootstrap(
        (scores[:, 0],), lambda x, axis: stats.trim_mean(x, 0.25, axis=axis), method="percentile",
        n_resamples=20_000, rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    np.testing.assert_allclose(one["iqm_ci95"], expected, atol=0.01)
