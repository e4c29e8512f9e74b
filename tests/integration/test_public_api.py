"""What a user imports: `poise`, its packages `envs`, `baselines`, `training`, nothing deeper."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import poise

ROOT = Path(__file__).parents[2]
LAZY = {
    "poise": "src/poise",
    "poise.envs": "envs",
    "poise.baselines": "baselines",
    "poise.baselines.motion": "baselines/motion",
    "poise.baselines.whole_body": "baselines/whole_body",
    "poise.training": "training",
}
PUBLIC = (*LAZY, "poise.baselines.solvers")
PAGES = [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*.py")]


def seen_by_editors(package: str) -> set[str]:
    """Names that the `TYPE_CHECKING` block of a package imports."""
    tree = ast.parse((ROOT / LAZY[package] / "__init__.py").read_text())
    blocks = [node for node in tree.body if isinstance(node, ast.If)]
    imports = [
        node
        for block in blocks
        if ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
    ]
    return {alias.asname or alias.name for node in imports for alias in node.names}


@pytest.mark.parametrize("package", LAZY)
def test_public_names_are_there_and_are_the_ones_that_editors_see(package: str) -> None:
    """`__all__`, `__dir__`, the lazy lookup and the `TYPE_CHECKING` block agree."""
    module = importlib.import_module(package)
    public = set(module.__all__)
    assert module.__all__ == sorted(public) and public <= set(dir(module))
    assert public - {"__version__"} == seen_by_editors(package)
    for name in public - {"__version__"}:
        thing = getattr(module, name)
        assert getattr(module, name) is thing
        assert getattr(thing, "__name__", name).rpartition(".")[2] == name.removeprefix("run_")


@pytest.mark.parametrize("package", LAZY)
def test_other_names_are_an_error_that_helps(package: str) -> None:
    module = importlib.import_module(package)
    wrong = sorted(module.__all__)[0] + "x"
    with pytest.raises(AttributeError, match=f"{package!r} has no attribute {wrong!r}") as caught:
        getattr(module, wrong)
    assert caught.value.obj is module and caught.value.name == wrong  # Python suggests by these
    assert not hasattr(module, "__wrapped__")


def test_one_thing_has_one_identity() -> None:
    """Names of two packages are the same object, and the function is not hidden by its room."""
    assert poise.load_policy is poise.training.load_policy
    assert poise.load_robot is poise.envs.load_robot
    assert poise.load_controller is poise.baselines.load_controller
    assert poise.evaluate is poise.training.evaluate
    assert poise.benchmark is poise.training.benchmark and callable(poise.benchmark)


def test_a_star_import_brings_what_all_says() -> None:
    found: dict[str, object] = {}
    exec("from poise.envs import *", found)  # what a notebook does
    assert set(importlib.import_module("poise.envs").__all__) <= set(found)


def test_importing_the_packages_is_light() -> None:
    """Neither they nor a look at their names load torch, numba or MuJoCo."""
    code = (
        "import sys, poise\n"
        "for package in (poise, poise.envs, poise.baselines, poise.training): dir(package)\n"
        "print([m for m in ('torch', 'numba', 'mujoco', 'scipy', 'yaml') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout.strip() == "[]", result.stderr


FROM = r"from (poise[\w.]*) import (?:\(([^)]*)\)|([\w, ]+))"


def names_of(package: str) -> list[str]:
    return importlib.import_module(package).__all__ if package in PUBLIC else []


def deep_names(text: str) -> Iterator[str]:
    """Dotted names of Poise in a page that are no public name of a public package."""
    for found in re.finditer(r"(?<![\w./-])poise(?:\.\w+)+", text):
        package, rest = "poise", found.group(0).split(".")[1:]
        while rest and f"{package}.{rest[0]}" in PUBLIC:
            package = f"{package}.{rest.pop(0)}"
        if rest and rest != ["configs"] and rest[0] not in names_of(package):
            yield found.group(0)
    for package, listed, line in re.findall(FROM, text):
        names = [name.split()[0] for name in (listed or line).split(",") if name.strip()]
        yield from (f"{package} {name}" for name in names if name not in names_of(package))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_pages_and_examples_import_nothing_deeper(path: Path) -> None:
    """But for patches to Poise itself."""
    text = re.sub(r"```diff\n.*?```", "", path.read_text(), flags=re.DOTALL)
    assert list(deep_names(text)) == []


def test_a_deep_import_is_found() -> None:
    text = "from poise.envs.robots.robot import Robot\nfrom poise.envs import Robots, Robot\n"
    assert list(deep_names(text)) == [
        "poise.envs.robots.robot", "poise.envs.robots.robot Robot", "poise.envs Robots",
    ]  # fmt: skip
    assert list(
        deep_names("`poise.training.benchmarking.evaluation.evaluate` and poise.envs.Robot")
    ) == ["poise.training.benchmarking.evaluation.evaluate"]
