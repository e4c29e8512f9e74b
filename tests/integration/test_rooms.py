"""The rooms of the package: what may import what, and what belongs in one room alone."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("configs", "envs", "baselines", "training")
MOST = 15  # files in a room
DOORS = 7  # folders in a folder

# A room imports rooms of lower floors only; those of one floor do not know each other. A file that
# is not in a room is one by itself.
FLOORS = """
 1 baselines/balance, configs, training/benchmarking
 1 training/benchmarking/statistics, training/deploy, training/pictures
 2 baselines/allowance, baselines/extras, baselines/motion/synthesis/scripts, envs/compiled
 2 envs/robots/models
 3 baselines/policy_files/onnx, baselines/solvers, baselines/warmup, envs/compiled/maths
 3 envs/terrain, training/running
 4 baselines/motion/clips, envs/robots, training/running/options
 5 baselines/motion/graphs/joining, envs/physics/engines, envs/physics/pushes
 6 baselines/motion/graphs, baselines/motion/graphs/matching
 6 baselines/motion/retargeting/inverse_kinematics, envs/physics
 7 baselines/controller, baselines/whole_body/parts, envs/sensing, envs/viewing
 8 baselines/whole_body/contacts, baselines/whole_body/limits, baselines/whole_body/tasks
 8 envs/balance/mdp
 9 baselines/balance/references, baselines/plugins, baselines/walking/models, baselines/whole_body
 9 envs/balance
10 baselines/balance/in_place, baselines/balance/stepping/planning, baselines/motion/feasibility
10 baselines/motion/retargeting, baselines/policy_files/motion, envs/balance/vector
11 baselines/balance/stepping, baselines/motion/space_time/constraints, baselines/motion/synthesis
11 baselines/policy_files, envs
12 baselines/motion/performing, baselines/motion/space_time, baselines/walking/planner
13 baselines/walking
14 baselines/registry
15 baselines/environments
16 baselines, baselines/environments/guard, baselines/motion, training/benchmarking/diagnosis
16 training/deploy/policy_check, training/learning, training/motion/tracking
17 training/benchmarking/trials, training/learning/seeds, training/motion
18 training/benchmarking/suites, training/deploy/robot_check/standing, training/deploy/standalone
18 training/learning/tuning, training/motion/following, training/pictures/figures
19 training/benchmarking/metrics, training/deploy/lowcmd, training/deploy/qp_set
19 training/deploy/robot_check
20 training/benchmarking/evaluation
21 training/benchmarking/results, training/motion/gaits
22 training/deploy/export, training/pictures/report, training/pictures/sessions
23 training, training/pictures/gallery, training/pictures/motion_report, training/pictures/view
24 training/cli/motion
25 training/cli
"""
FLOOR = {
    room: int(line.split()[0])
    for line in FLOORS.split("\n")
    for room in line.replace(",", "").split()[1:]
}

#: libraries that one room alone may import; LATE ones elsewhere inside of functions
ALONE = {
    "llvmlite": "envs/compiled",
    "numba.core": "envs/compiled",
    "numba.extending": "envs/compiled",
    "pydrake": "envs/physics/engines",
    "pybvh": "baselines/motion/clips",
    "mink": "baselines/motion/retargeting",
    "torch": "training/learning",
    "stable_baselines3": "training/learning",
}
LATE = ("torch", "stable_baselines3")
SELVES = ("self", "cls")


def room_of(path: str) -> str:
    """The room of a file; `configs` is one, and of other top folders every file is."""
    folder, _, name = path.rpartition("/")
    return path[:-3] if folder in FOLDERS[1:] and name != "__init__.py" else folder


@cache
def sources() -> dict[str, ast.Module]:
    """Every source file, relative to the root, as its syntax tree."""
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text()) for path in paths}


@cache
def modules() -> dict[str, str]:
    """Name of every module → its file."""
    names = {path[:-3].replace("/", ".").removesuffix(".__init__"): path for path in sources()}
    return {f"poise.{name}": path for name, path in names.items()}


@cache
def imports(path: str, *, late: bool = True) -> tuple[tuple[str, str], ...]:
    """(module, name) of everything that a file imports; with `late` also inside of functions."""
    package = ".".join(["poise", *path.split("/")[:-1]])
    tree = sources()[path]
    inside = {
        id(node)
        for function in ast.walk(tree)
        if not late and isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef))
        for node in ast.walk(function)
    }
    found: list[tuple[str, str]] = []
    for node in ast.walk(tree):
        if id(node) in inside:
            continue
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            relative = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(relative, package) if node.level else relative
            found += [(base, alias.name) for alias in node.names]
    return tuple(found)


def imported_files(path: str) -> Iterator[tuple[str, str]]:
    """(file, name) of everything of Poise that a file imports; the name is empty for a module."""
    for module, name in imports(path):
        if (whole := modules().get(f"{module}.{name}")) is not None:
            yield whole, ""
        elif (file := modules().get(module)) is not None:
            yield file, name


def test_every_file_is_in_a_room_that_has_a_floor() -> None:
    found = {room_of(path) for path in sources()}
    assert found == set(FLOOR), found ^ set(FLOOR)


def test_rooms_import_lower_floors_only() -> None:
    wrong = {
        f"{path} ({FLOOR[room_of(path)]}) imports {other} ({FLOOR[room_of(other)]})"
        for path in sources()
        for other, _ in imported_files(path)
        if room_of(other) != room_of(path) and FLOOR[room_of(other)] >= FLOOR[room_of(path)]
    }
    assert wrong == set()


@pytest.mark.parametrize("library", list(ALONE))
def test_some_libraries_are_one_room_s_alone(library: str) -> None:
    """Numba's and LLVM's internals, torch and SB3: where they are used, and nowhere else."""
    wrong, used = set(), False
    for path in sources():
        late = library not in LATE
        for module, name in imports(path, late=late):
            if not f"{module}.{name}.".startswith(f"{library}."):
                continue
            used |= room_of(path) == ALONE[library]
            wrong |= {path} - ({path} if room_of(path) == ALONE[library] else set())
    assert used and wrong == set()


def test_private_names_stay_in_their_file() -> None:
    wrong = {
        f"{path} imports {other}: {name}"
        for path in sources()
        for other, name in imported_files(path)
        if re.match(r"_[^_]", name)
    }
    assert wrong == set()


def untyped(path: str) -> list[str]:
    """Functions of a file with an argument that has no type, but for `self` and `cls`."""
    functions = (
        node
        for node in ast.walk(sources()[path])
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    )
    return [
        function.name
        for function in functions
        if any(
            isinstance(node, ast.arg) and node.annotation is None and node.arg not in SELVES
            for node in ast.iter_child_nodes(function.args)
        )
    ]


def test_every_argument_of_a_function_has_a_type() -> None:
    """Numba ignores the types, editors and readers of the kernels do not."""
    found = {path: untyped(path) for path in sources()}
    assert {path: names for path, names in found.items() if names} == {}


def test_rooms_are_small_and_say_what_is_in_them() -> None:
    """At most 15 files each; the first line of a room's `__init__` is one sentence."""
    files = Counter(path.rpartition("/")[0] for path in sources() if "__init__" not in path)
    assert {room: n for room, n in files.items() if n > MOST} == {}
    said = {room: ast.get_docstring(sources()[f"{room}/__init__.py"]) for room in files}
    assert [
        room for room, text in said.items() if not (text or "").split("\n\n")[0].endswith(".")
    ] == []


def test_a_floor_has_few_doors() -> None:
    doors = Counter(str(Path(room).parent) for room in FLOOR if (ROOT / room).is_dir())
    assert {folder: n for folder, n in doors.items() if n > DOORS and folder != "."} == {}


def test_tests_stand_in_the_rooms_of_what_they_test() -> None:
    """tests/ has the folders of the package, and five of its own. A test that has a file's name
    stands in that file's room, not in one that holds it."""
    tests = ROOT / "tests"
    if not tests.is_dir():
        pytest.skip("not a checkout")
    own = {"integration", "support", "performance", "fuzz", "endurance"}
    mirrored = [path.relative_to(tests) for path in tests.rglob("test_*.py")]
    mirrored = [path for path in mirrored if path.parts[0] not in own]
    assert {path.parent for path in mirrored if not (ROOT / path.parent).is_dir()} == set()
    assert [path for path in mirrored if len(path.parts) == 1] == []
    deeper: list[tuple[Path, Path]] = []
    for path in mirrored:
        room, name = ROOT / path.parent, path.stem.removeprefix("test_")
        here = (room / f"{name}.py").is_file() or (room / name).is_dir()
        deeper += [] if here else [(path, file) for file in room.rglob(f"{name}.py")]
    assert deeper == []


def test_a_room_is_imported_without_those_above_it() -> None:
    """The world loads no controller, and a controller no learning."""
    code = "import sys, poise.{};print(*(name for name in sys.modules if name.startswith({})))"
    for room, above in (
        ("envs.balance.vector.vector_env", ("poise.baselines", "poise.training", "torch")),
        ("baselines.environments.stepping", ("poise.training", "torch")),
        (
            "training.benchmarking.statistics.rates",
            ("poise.envs", "poise.baselines", "torch", "mujoco"),
        ),
    ):
        command = [sys.executable, "-c", code.format(room, above)]
        result = subprocess.run(command, capture_output=True, text=True, check=True)
        assert result.stdout.split() == [], room


def test_the_table_of_the_architecture_has_every_room_on_its_floor() -> None:
    """As in `FLOORS`, but for single files and packages that only hold rooms."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (\d+) \| ([\w/.]+) \|", page, re.M)
    told = {room.removesuffix(".py"): int(floor) for floor, room in rows}
    assert {room: FLOOR.get(room) for room in told} == told
    rooms = {path.rpartition("/")[0] for path in sources() if not path.endswith("__init__.py")}
    assert rooms - set(told) <= set(FOLDERS)


def test_the_walks_of_the_architecture_name_what_there_is() -> None:
    """Each stop's file has the function, the class or the method that is named after it."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    stops = re.findall(r"^\d+\. `([\w/]+\.py)`: `([\w.]+)`", page, re.M)
    assert len(stops) > 30
    for path, name in stops:
        inside = sources()[path].body
        for part in name.split("."):
            found = [node for node in inside if getattr(node, "name", None) == part]
            assert found, (path, name)
            inside = getattr(found[0], "body", [])


def test_the_places_of_the_architecture_hold_what_they_are_told_to() -> None:
    """Each name of *Where things are* is defined in one of the files beside it."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    table = page.partition("## Where things are\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| [^|]+ \| ([^|]+) \| ([^|]+) \|$", table, re.M)
    assert len(rows) > 15
    for places, names in rows[2:]:
        files = re.findall(r"`([\w/]+/[\w/]+\.py)`", places)
        defined = {getattr(node, "name", None) for path in files for node in sources()[path].body}
        assert set(re.findall(r"`(\w+)`", names)) <= defined, places
