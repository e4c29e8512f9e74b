"""`poise[motion]`: the core neither imports it nor needs it, and says so where it is missing."""

from __future__ import annotations

import ast
import json
import os
import pickle
import subprocess
import sys
import tomllib
import venv
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest

import poise
from poise.baselines.extras import MissingExtra, load_extra, missing_extra, registered
from poise.baselines.registry import available_controllers, controller_config
from tests.integration.test_rooms import ROOT, imports, sources

#: folders and files of the extra, which import each other and the core
MOTION = (
    *("baselines/motion/", "training/motion/", "training/cli/motion/"),
    *("training/pictures/motion_report/", "training/pictures/figures/motion_graph.py"),
    "training/pictures/figures/playback.py",
)
MODULES = tuple(
    f"poise.{name.removesuffix('/').removesuffix('.py').replace('/', '.')}" for name in MOTION
)
NEEDS = ("mink", "pybvh")  # what the extra installs
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def of_motion(module: str) -> bool:
    return f"{module}.".startswith(tuple(f"{each}." for each in (*MODULES, *NEEDS)))


def core() -> list[str]:
    return [path for path in sources() if not path.startswith(MOTION)]


def written(tree: ast.Module) -> Iterator[str]:
    """Text of a file but for docstrings, such as the name of a module to import later."""
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, nodes) and node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in texts:
            yield node.value


def test_the_core_imports_no_motion() -> None:
    """Neither at the top, nor in a function, nor for types, nor by a module's name as text."""
    imported = {
        f"{path} imports {module}.{name}"
        for path in core()
        for module, name in imports(path)
        if of_motion(module) or of_motion(f"{module}.{name}")
    }
    named = {
        f"{path}: {text!r}"
        for path in core()
        for text in written(sources()[path])
        if of_motion(text.partition(":")[0])
    }
    assert (imported, named) == (set(), set())
    assert {path for path in sources() if path.startswith(MOTION)}.isdisjoint(core())
    assert all(any(path.startswith(each) for path in sources()) for each in MOTION)


def test_a_dependency_of_the_core_is_not_one_of_motion() -> None:
    extra = [line.partition(">")[0] for line in PROJECT["optional-dependencies"]["motion"]]
    assert sorted(extra) == sorted(NEEDS)
    assert not [line for line in PROJECT["dependencies"] if line.startswith(NEEDS)]
    everything = next(
        line for line in PROJECT["optional-dependencies"]["dev"] if line.startswith("poise[")
    )
    assert "motion" in everything  # `make setup` installs .[dev]


def test_what_is_registered_is_what_is_installed() -> None:
    """As pyproject.toml has it (else `make setup` has not run since), and all of it loads."""
    for group, entries in PROJECT["entry-points"].items():
        installed = {each.name: each.value for each in entry_points(group=group)}
        assert installed == entries, group
        for name in entries:
            kind = group.removeprefix("poise.")
            assert missing_extra(kind, name) is None
            assert load_extra(kind, name) is not None


@pytest.mark.parametrize("name", ["solve_ik", "IkGoal", "retarget_clip", "PosePrior"])
def test_names_that_moved_are_read_for_one_release(name: str) -> None:
    from poise.baselines import motion

    with pytest.warns(DeprecationWarning, match=f"poise.baselines.motion.{name}") as caught:
        found = getattr(poise.baselines, name)
    assert found is getattr(motion, name) and caught[0].filename == __file__


def test_what_no_package_registers_names_the_extra() -> None:
    with pytest.raises(MissingExtra) as caught:
        load_extra("controllers", "moon-walk")
    error = caught.value
    assert (error.extra, error.source) == ("motion", "moon-walk")
    copy = pickle.loads(pickle.dumps(error))
    assert (copy.extra, copy.source, str(copy)) == ("motion", "moon-walk", str(error))
    assert registered("nothing-of-the-kind") == {}


#: forbids, in every process of an environment, to import the extra and what it needs
HOOK = f"""
import sys
class Forbidden:
    def find_spec(self, name, path=None, target=None):
        if f"{{name}}.".startswith({tuple(f"{each}." for each in (*MODULES, *NEEDS))}):
            raise ImportError(f"forbidden: {{name}}")
sys.meta_path.insert(0, Forbidden())
"""


@pytest.fixture(scope="module")
def without_motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment that has all packages of this one but those of the extra."""
    folder = tmp_path_factory.mktemp("without") / "venv"
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for place in map(Path, sys.path):
        if place.name not in ("site-packages", "dist-packages") or not place.is_dir():
            continue
        for path in place.iterdir():
            left_out = path.suffix == ".pth" or path.name.lower().startswith(NEEDS)
            if not left_out and not (site / path.name).exists():
                (site / path.name).symlink_to(path)
    (site / "forbid_motion.py").write_text(HOOK)
    (site / "checkout.pth").write_text(f"{ROOT / 'src'}\nimport forbid_motion\n")
    return folder / "bin" / "python"


def run(python: Path, code: str, folder: Path) -> str:
    """What a program prints in that environment."""
    known = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    result = subprocess.run(
        [python, "-P", "-c", code], cwd=folder, env=known, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


CORE = """
import poise, gymnasium, numpy as np
from poise.baselines import MomentumQP
for name in ("TorqueBalance", "ResidualBalance", "ResidualStep", "ResidualWalk"):
    env = gymnasium.make(f"poise/{name}-v0")
    env.reset(seed=0)
    env.step(env.action_space.sample())
env = gymnasium.make("poise/ResidualBalance-v0").unwrapped
env.reset(seed=0)
qp = MomentumQP(env.robot)
assert np.isfinite(qp.torques(env.simulation.state, env.targets)).all()
print("works")
"""


@pytest.mark.weekly  # the commands below are of the core, too
def test_the_core_works_without_motion(without_motion: Path, tmp_path: Path) -> None:
    """Environments and the QP, with every import of the extra forbidden."""
    assert run(without_motion, CORE, tmp_path) == "works\n"


ASKED = {
    "motion": ["motion", "info", "humanoid_punch"],
    "controller": ["evaluate", "motion-step", "--trials", "1", "--out", "c"],
    "suite": ["evaluate", "momentum-qp", "--suite", "follow", "--trials", "1", "--out", "s"],
    "clips": ["evaluate", "zero", "--suite", "follow", "--motions", "humanoid_punch",
              "--out", "m"],
    "view": ["view", "pd", "--motion", "bow", "--seconds", "1"],
    "evaluate": ["evaluate", "momentum-qp", "--trials", "1", "--workers", "1", "--out", "e"],
    "list": ["list"],
    "json": ["list", "--json"],
    "help": ["--help"],
}  # fmt: skip
COMMANDS = f"""
import contextlib, io, json
from poise.training.cli import main
found = {{}}
for name, words in {ASKED}.items():
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    found[name] = code, out.getvalue(), err.getvalue()
print(json.dumps(found))
"""


def test_commands_name_the_extra_or_do_without_it(without_motion: Path, tmp_path: Path) -> None:
    """Exit code 2 and one line where motion is asked for; the rest works, and leaves nothing."""
    found: dict[str, Any] = json.loads(run(without_motion, COMMANDS, tmp_path).splitlines()[-1])
    for name in ("motion", "controller", "suite", "clips", "view"):
        code, out, err = found[name]
        assert (code, out) == (2, ""), (name, found[name])
        assert err.count("\n") == 1 and "needs poise[motion]: pip install 'poise[motion]'" in err
    assert {path.name for path in tmp_path.iterdir()} == {"e"}
    for name in ("evaluate", "list", "json", "help"):
        assert found[name][0] == 0, found[name]
    assert {"clips", "scripts"}.isdisjoint(json.loads(found["json"][1]))
    assert "clips: none without poise[motion]" in found["list"][1]


def test_controllers_of_an_extra_are_left_out_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert "motion-step" in available_controllers()
    monkeypatch.setattr("poise.baselines.extras.registered", lambda group: {})
    assert "motion-step" not in available_controllers() and "walk" in available_controllers()
    with pytest.raises(MissingExtra, match="motion-step: needs poise"):
        controller_config("motion-step")
