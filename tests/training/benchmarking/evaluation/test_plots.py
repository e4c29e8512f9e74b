"""training/benchmarking/evaluation/plots.py: what of random pushes is drawn as a result."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from poise.training.benchmarking.evaluation import plots


def trial(direction: float, fraction: float, recovered: bool) -> Any:
    """A trial of the part `random`, and its outcome."""
    push = SimpleNamespace(direction=direction, impulse=20.0 * fraction, duration=0.1)
    pushed = SimpleNamespace(
        part="random", push=push, limit_fraction=fraction, judged_by_falls=False
    )
    return pushed, SimpleNamespace(recovered=recovered)


def test_sectors_of_few_trials_are_no_results_and_bounds_are_marked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ahead 4 trials, to the left 5 that were all recovered, backward 6 of either end."""
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(plots, "polar_envelope", lambda *args, **given: drawn.update(given, a=args))
    played = [trial(2.0 * k, 1.0 + 0.1 * k, k < 2) for k in range(4)]
    played += [trial(85.0 + k, 0.8 + 0.1 * k, True) for k in range(5)]
    played += [trial(180.0, 0.7 + 0.1 * k, k < 3) for k in range(6)]
    plan: Any = SimpleNamespace(limits=SimpleNamespace(scale="ankle limit"))
    plots.draw_plots(tmp_path, plan, {"a": played})
    (found,) = drawn["a"][1]
    assert found.name == "a" and found.x.tolist() == [0.0, 90.0, 180.0]
    for each in (found.y, found.low, found.high):
        assert np.isnan(each).tolist() == [True, False, False]
    assert found.y[1] == pytest.approx(1.2) and found.side.tolist() == [0.0, 1.0, 0.0]
    assert drawn["note"] == "Not drawn: directions with fewer than 5 trials."
    plots.draw_plots(tmp_path, plan, {"a": played[4:]})
    assert drawn["note"] == ""
    plots.draw_plots(tmp_path, plan, {"a": played[:4]})
    assert drawn["note"] == "Nothing is drawn: no direction has 5 trials."


@pytest.mark.parametrize(
    "names", [("r/kept/10", "r/kept/20", "kept/qp.yaml"), ("r/kept/10", "qp", "s/last")]
)
def test_what_a_run_has_kept_is_drawn_over_its_steps(
    names: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two policies of a run are a curve, one is none; J50 is that of the fits."""
    drawn: list[Any] = []
    monkeypatch.setattr(plots, "learning_curve", lambda *args, **given: drawn.append((args, given)))
    fits: Any = {
        name: SimpleNamespace(j50_mean=10.0 + k, j50_mean_ci=(9.0 + k, 12.0 + k), bounded=k == 1)
        for k, name in enumerate(names)
    }
    path = tmp_path / "learning_curve.png"
    found = plots._draw_curve(path, fits, {"r/kept/10": 10, "r/kept/20": 20, "s/last": 5})
    if "r/kept/20" not in names:
        assert found == [] and not drawn
        return
    assert found == [path]
    (given, note), *rest = drawn
    assert given == (
        path,
        {"r": [(10, 10.0, 9.0, 12.0), (20, 11.0, 10.0, 13.0)]},
        {"kept/qp.yaml": 12.0},
    )
    assert note == {"note": "In some directions J50 is only a bound."} and not rest
