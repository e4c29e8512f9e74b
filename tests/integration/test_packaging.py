"""The package: what is in the wheel, what imports what, and what a light import loads."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import gymnasium
import pytest
import yaml

import poise
from poise.baselines.motion.clips.library import captured_clips, packaged_clips, walking_clips

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "src/poise": "poise",
    "envs": "poise.envs",
    "baselines": "poise.baselines",
    "training": "poise.training",
    "configs": "poise.configs",
}


def tracked_files() -> list[Path]:
    """Files of the mapped folders that git tracks, relative to the root; no links."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    command = ["git", "ls-files", "-z", "--", *FOLDERS]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [Path(name) for name in listing.split("\0") if name and (ROOT / name).is_file()]


def installed_name(path: Path) -> str:
    """Where a file of a mapped folder goes in the wheel."""
    for folder, package in FOLDERS.items():
        if path.is_relative_to(folder):
            return f"{package.replace('.', '/')}/{path.relative_to(folder).as_posix()}"
    raise AssertionError(f"{path} is in no mapped folder")


def test_the_wheel_holds_exactly_the_tracked_files(tmp_path: Path) -> None:
    """A package or data file that pyproject.toml forgets is found here."""
    tracked = tracked_files()
    others = [Path(name) for name in ("pyproject.toml", "LICENSE", "README.md")]
    source = tmp_path / "source"
    for path in tracked + [path for path in others if (ROOT / path).exists()]:
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, source / path)
    for link in (ROOT / "src/poise").iterdir():
        if link.is_symlink():
            (source / "src/poise" / link.name).symlink_to(link.readlink())
    options = ["--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", str(tmp_path)]
    command = [sys.executable, "-m", "pip", "wheel", *options, str(source)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    content = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert content == {installed_name(path) for path in tracked}


def test_no_captured_clip_is_in_the_repository() -> None:
    """Every BVH file is one that `poise.training.motion` records, and no file of the
    folder beside the repository, where captured ones are, is also in it."""
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True,
                             check=False).stdout  # fmt: skip
    tracked = [Path(name) for name in listing.split("\0") if (ROOT / name).is_file()]
    if not tracked:
        pytest.skip("not a git checkout")
    clips = sorted(path for path in tracked if path.suffix.lower() in (".bvh", ".amc", ".asf"))
    assert clips == [
        *(Path(f"configs/clips/{name}.bvh") for name in packaged_clips()),
        *(Path(f"configs/clips/walks/{name}.bvh") for name in walking_clips()),
    ]
    assert all(path.stem.startswith("humanoid_") for path in clips)
    others = {path.read_bytes() for path in captured_clips().values()}
    assert [path for path in clips if (ROOT / path).read_bytes() in others] == []


def python_files(folder: str) -> Iterator[Path]:
    return (path for path in (ROOT / folder).rglob("*.py"))


def imported_modules(path: Path, package: str) -> set[str]:
    """Absolute names of everything that a file imports, also inside functions."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            relative = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(relative, package) if node.level else node.module
            names |= {f"{base}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize(
    ("folder", "forbidden"),
    [
        ("envs", ("poise.baselines", "poise.training")),
        ("baselines", ("poise.training",)),
    ],
)
def test_imports_run_one_way(folder: str, forbidden: tuple[str, ...]) -> None:
    """training imports baselines imports envs, never the other way."""
    wrong = []
    for path in python_files(folder):
        parts = path.relative_to(ROOT / folder).parent.parts
        for name in imported_modules(path, ".".join((FOLDERS[folder], *parts))):
            if f"{name}.".startswith(tuple(f"{package}." for package in forbidden)):
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert wrong == []


@pytest.mark.parametrize("folder", list(FOLDERS)[1:])
def test_every_mapped_folder_is_imported_as_poise(folder: str) -> None:
    """Importing `envs` bare, as one may from the root, says to import poise.envs."""
    command = [sys.executable, "-c", f"import {folder}"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert f"write `import poise.{folder}`" in result.stderr


def test_types_are_seen_where_poise_is_installed() -> None:
    """Type checkers follow `import poise` of a user's file from this environment's site-packages
    to annotated sources: they do not run import hooks, and without py.typed take nothing."""
    modulefinder = pytest.importorskip("mypy.modulefinder")
    options = importlib.import_module("mypy.options").Options()
    options.python_executable = sys.executable
    packages = modulefinder.compute_search_paths([], options, str(ROOT)).package_path
    paths = modulefinder.SearchPaths((), (), packages, ())
    cache = modulefinder.FindModuleCache(paths, None, options)
    for name in ("poise", "poise.envs.robots.robot", "poise.training.learning.policy"):
        found = cache.find_module(name)
        assert isinstance(found, str) and found.endswith(".py"), (name, found)


def test_import_poise_is_light() -> None:
    """`import poise` loads neither torch nor numba nor MuJoCo, and registers the environments."""
    code = (
        "import sys, poise, gymnasium\n"
        "assert {'poise/TorqueBalance-v0', 'poise/ResidualBalance-v0'} <= set(gymnasium.registry)\n"
        "print([m for m in ('torch', 'numba', 'mujoco', 'scipy', 'yaml') if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "name",
    [
        "poise/TorqueBalance-v0",
        "poise/PositionBalance-v0",
        "poise/ResidualBalance-v0",
        "poise/ResidualStep-v0",
        "poise/ResidualWalk-v0",
        "poise/ResidualWhole-v0",
        "poise/Velocity-v0",
    ],
)
def test_registered_environments_exist(name: str) -> None:
    """The string entry point names a class, and Gymnasium adds no time limit of its own."""
    spec = gymnasium.spec(name)
    module, _, attribute = str(spec.entry_point).partition(":")
    assert issubclass(getattr(importlib.import_module(module), attribute), gymnasium.Env)
    assert spec.max_episode_steps is None


def test_load_policy_is_reached_lazily() -> None:
    """`poise.load_policy` is that of poise.training.learning.policy; other names do not exist."""
    assert (
        poise.load_policy is importlib.import_module("poise.training.learning.policy").load_policy
    )
    with pytest.raises(AttributeError, match="no attribute 'load_polciy'"):
        _ = poise.load_polciy


def test_zenodo_is_told_what_the_citation_says() -> None:
    """One title, version, licence and list of words, and the archive that `make release` makes."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    told = json.loads((ROOT / ".zenodo.json").read_text())
    assert {key: told[key] for key in ("title", "version", "license", "keywords")} == {
        key: cited[key] for key in ("title", "version", "license", "keywords")
    }
    assert [author["name"] for author in told["creators"]] == [a["name"] for a in cited["authors"]]
    assert told["version"] == poise.__version__
    assert "poise-leaderboard.zip" in told["description"]
    assert "dist/poise-leaderboard.zip docs/results" in (ROOT / "Makefile").read_text()


def test_the_command_and_the_version() -> None:
    """The console script `poise` can be loaded, and the metadata carries the package's version."""
    (script,) = importlib.metadata.entry_points(group="console_scripts", name="poise")
    assert callable(script.load())
    assert importlib.metadata.version("poise") == poise.__version__


CONDA = {"mujoco": "mujoco-python", "torch": "pytorch-cpu", "matplotlib": "matplotlib-base"}


def test_the_recipe_for_conda_asks_for_what_the_package_does() -> None:
    """The same version, command and dependencies, by conda-forge's names."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = yaml.safe_load((ROOT / "conda/meta.yaml").read_text())
    assert recipe["package"]["version"] == poise.__version__
    assert recipe["build"]["entry_points"] == [
        f"{name} = {place}" for name, place in project["scripts"].items()
    ]
    wanted = {f"python{project['requires-python']}"}
    for dependency in project["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", dependency).groups()
        wanted.add(CONDA.get(name, name) + bounds)
    assert {line.replace(" ", "") for line in recipe["requirements"]["run"]} == wanted


def test_the_image_installs_extras_that_exist() -> None:
    """And copies in no environment of the machine that builds it."""
    text = (ROOT / "Dockerfile").read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = re.search(r'-e "\.\[([\w,]+)\]"', text)[1].split(",")
    assert set(extras) <= set(project["optional-dependencies"])
    assert {".git", ".venv", "build"} <= set((ROOT / ".dockerignore").read_text().split())
