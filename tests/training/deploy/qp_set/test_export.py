"""training/deploy/qp_set/export.py and training/deploy/qp_set/recordings.py."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pytest
import qpsolvers

from poise.baselines.solvers import QP, make_solver
from poise.configs.errors import ConfigError, PoiseError
from poise.training.cli.entry import main
from poise.training.deploy.qp_set.export import problem_arrays, write_qp_set
from tests.support.weekly import daily

COUNT = 60  # three trials: the first recovers, the second falls
FORMS = ("reduced", "full")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small set of each form, made once."""

    @functools.cache
    def made(form: str) -> Path:
        out = tmp_path_factory.mktemp("sets") / form
        write_qp_set(out, count=COUNT, form=form)
        return out

    return made


def files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.npz"))


@pytest.mark.parametrize("form", daily(FORMS))
def test_qpsolvers_loads_and_saves_them(form: str, folder, tmp_path: Path) -> None:
    """A problem comes back from qpsolvers' own save as it was loaded."""
    for path in files(folder(form))[::10]:
        problem = qpsolvers.Problem.load(str(path))
        problem.save(str(tmp_path / "again.npz"))
        ours, theirs = (np.load(p, allow_pickle=True) for p in (path, tmp_path / "again.npz"))
        for key in theirs.files:
            np.testing.assert_array_equal(ours[key], theirs[key])
        problem.check_constraints()
        n = 21 if form == "reduced" else 39
        assert problem.P.shape == (n, n) and problem.q.shape == (n,)
        if form == "reduced":
            assert problem.A is None and problem.b is None
        else:
            assert problem.A.shape == (18, n) and problem.lb.shape == problem.ub.shape == (n,)


@pytest.mark.parametrize("form", FORMS)
def test_solutions_are_the_controllers_torques(form: str, folder) -> None:
    """Solved by another solver, every problem gives the torques that the controller commanded."""
    paths = files(folder(form))
    assert len(paths) == COUNT
    for path in paths:
        data = np.load(path, allow_pickle=True)
        solution = qpsolvers.solve_problem(qpsolvers.Problem.load(str(path)), solver="quadprog")
        assert solution.found
        torques = data["torque_matrix"] @ solution.x + data["torque_offset"]
        assert (np.abs(torques - data["torques"]) / data["torque_limit"]).max() < 1e-6


def test_the_manifest_tells_where_each_problem_comes_from(folder) -> None:
    """Robot, controller, versions, pushes; problems spread over recovered and falling trials."""
    out = folder("reduced")
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["robot"] == "humanoid" and manifest["form"] == "reduced"
    assert manifest["controller"]["kind"] == "momentum-qp" and "numpy" in manifest["versions"]
    assert len(manifest["joints"]) == 21 and "commit" in manifest
    assert [p["file"] for p in manifest["problems"]] == [path.name for path in files(out)]
    trials = manifest["trials"]
    assert [trial["end"] for trial in trials[:2]] == ["recovered", "fell"]
    assert len({round(trial["direction"] / 45.0) % 8 for trial in trials}) == 3
    times = [p["time"] for p in manifest["problems"] if p["trial"] == 0]
    assert min(times) == 0.0 and max(times) > 1.9 and len(times) == 25
    assert max(p["active"] for p in manifest["problems"]) >= 5
    assert "Problem.load" in (out / "README.md").read_text()


def test_the_same_seed_gives_the_same_files(folder, tmp_path: Path) -> None:
    """To the byte; another seed gives other problems."""
    write_qp_set(tmp_path / "again", count=COUNT)
    for ours, theirs in zip(files(folder("reduced")), files(tmp_path / "again"), strict=True):
        assert ours.read_bytes() == theirs.read_bytes()
    write_qp_set(tmp_path / "other", count=2, seed=1)
    ours, theirs = (files(f)[1].read_bytes() for f in (folder("reduced"), tmp_path / "other"))
    assert ours != theirs


def test_rows_become_equalities_bounds_and_one_sided_rows() -> None:
    """min ½|x − 3|², x₀ + x₁ = 1, −1 ≤ x₀ ≤ 2 and ∞ ≥ x₀ − x₁ ≥ 0, by another solver."""
    C = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 2.0]])
    l, u = np.array([1.0, -1.0, 0.0, -8.0]), np.array([1.0, 2.0, np.inf, 4.0])  # noqa: E741
    qp = QP(np.eye(3), np.full(3, -3.0), C, l, u)
    arrays = problem_arrays(qp)
    assert arrays["A"].shape == (1, 3) and arrays["G"].shape == (3, 3)
    np.testing.assert_array_equal(arrays["lb"], [-1.0, -np.inf, -np.inf])
    np.testing.assert_array_equal(arrays["ub"], [2.0, np.inf, np.inf])
    x = qpsolvers.solve_problem(qpsolvers.Problem(**arrays), solver="quadprog").x
    np.testing.assert_allclose(x, make_solver("active-set").solve(qp).x, atol=1e-9)
    np.testing.assert_allclose(x, [0.5, 0.5, 2.0], atol=1e-9)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--count", "0"], "count: must be at least 1"),
        (["--seed", "-1"], "seed: must be at least 0"),
        (["--out", "full"], "full: out: is not empty"),
        (["--out", "file"], "file: out: is not a folder"),
        (["--out", "file/set"], "file/set: cannot be written"),
        (["--robot", "robby"], "no such name: 'robby'"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    args: list[str], message: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    """The line names the field and what is wrong; what is there stays as it is."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "note").write_text("mine")
    (tmp_path / "file").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    if "--out" not in args:
        args = [*args, "--out", "set"]
    assert main(["qp-set", *args]) == 2
    error = capsys.readouterr().err
    assert message in error and error.startswith("poise: ") and error.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_a_stopped_export_leaves_nothing(tmp_path: Path, monkeypatch) -> None:
    """The folder appears complete or not at all."""

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(PoiseError, match="No space left"):
        write_qp_set(tmp_path / "set", count=1)
    assert not list(tmp_path.iterdir())


def test_an_empty_folder_may_be_given(tmp_path: Path, capsys) -> None:
    """The command says what it wrote, also into a folder that was made before."""
    assert main(["qp-set", "--out", str(tmp_path), "--count", "2", "--form", "full"]) == 0
    assert "2 problems of 1 trials (1 recovered)" in capsys.readouterr().out
    assert len(files(tmp_path)) == 2 and (tmp_path / "manifest.json").is_file()
    with pytest.raises(ConfigError, match="not empty"):
        write_qp_set(tmp_path, count=2)
