"""envs/compiled/sources.py: what a kernel is compiled from."""

from __future__ import annotations

import ast
import gc
import importlib
import importlib.util
import inspect
import os
import sys
from pathlib import Path
from types import CodeType

import pytest
from numba.core.dispatcher import Dispatcher

from poise.envs.compiled import sources

ROOT = Path(__file__).resolve().parents[3]
FILES = sorted(path for room in ("envs", "baselines") for path in (ROOT / room).rglob("*.py"))
if importlib.util.find_spec("pydrake") is None:
    need = ("drake_plant.py", "drake_limits.py")  # poise[drake]
    FILES = [path for path in FILES if path.name not in need]


def modules_of(statement: ast.stmt, file: Path) -> set[str]:
    """The modules that an import may name, as Python's grammar has it."""
    if isinstance(statement, ast.Import):
        return {alias.name for alias in statement.names}
    if not isinstance(statement, ast.ImportFrom):
        return set()
    above = ["poise", *file.relative_to(ROOT).parts[: -statement.level]] if statement.level else []
    start = ".".join([*above, *([statement.module] if statement.module else [])])
    return {start, *(f"{start}.{alias.name}" for alias in statement.names)}


def test_imports_are_found_as_python_reads_them() -> None:
    """Every import at the top of every file, and no other."""
    place = {
        ".".join(["poise", *path.relative_to(ROOT).with_suffix("").parts]): path for path in FILES
    }
    place |= {name.removesuffix(".__init__"): path for name, path in place.items()}
    for file in FILES:
        body = ast.parse(file.read_text()).body
        named = {name for statement in body for name in modules_of(statement, file)}
        expected = {str(place[name]) for name in named & set(place)}
        packages = {str(path) for path in FILES if path.name == "__init__.py"}
        assert set(sources._read(str(file))[1]) - packages == expected - packages, file


def globals_of(code: CodeType, names: dict) -> list[object]:
    """What a function, and what is defined in it, refers to by name."""
    inner = [value for const in code.co_consts if isinstance(const, CodeType)
             for value in globals_of(const, names)]  # fmt: skip
    return [names[name] for name in code.co_names if name in names] + inner


def test_a_kernel_is_compiled_from_files_that_its_own_imports() -> None:
    """Functions, classes and kernels that it refers to, by a global's name or out of a closure."""
    for path in FILES:
        importlib.import_module(".".join(["poise", *path.relative_to(ROOT).with_suffix("").parts]))
    kernels = [
        each for each in gc.get_objects()
        if issubclass(type(each), Dispatcher) and each.py_func.__module__.startswith("poise.")
    ]  # fmt: skip
    assert len(kernels) > 300
    for kernel in kernels:
        function = kernel.py_func
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        own = set(map(os.path.realpath, sources.imported(inspect.getfile(function))))
        for value in cells + globals_of(function.__code__, function.__globals__):
            value = getattr(value, "py_func", value)
            if str(getattr(value, "__module__", "")).startswith("poise."):
                file = os.path.realpath(str(sys.modules[value.__module__].__file__))
                compiled = file.startswith(str(ROOT / "envs/compiled"))
                assert compiled or file in own, (kernel, value)


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a room, whose files import nothing yet."""
    monkeypatch.setattr(sources, "_HOUSE", str(tmp_path))
    monkeypatch.setattr(sources, "_ROOM", str(tmp_path / "envs/compiled"))
    for name in ("envs/compiled/jit.py", "envs/room/a.py", "envs/room/b.py", "baselines/c.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f'"""{name}"""\n')
    return tmp_path


def digests(house: Path) -> list[str]:
    """Those of a, b and c, in a process that has read nothing yet."""
    for function in (sources.source_digest, sources._read, sources._existing):
        function.cache_clear()
    return [
        sources.source_digest(str(house / name))
        for name in ("envs/room/a.py", "envs/room/b.py", "baselines/c.py")
    ]


@pytest.mark.parametrize("line", [
    "from .b import f", "from . import b", "from . import (\n    x,\n    b,\n)",
    "from ..room.b import f", "from poise.envs.room.b import f", "from poise.envs.room import b",
    "import poise.envs.room.b",
    "import poise.envs.room.b as other",
])  # fmt: skip
def test_an_edit_drops_what_depends_on_it_alone(house: Path, line: str) -> None:
    """c imports a, which imports b, in every form; nobody imports c."""
    (house / "envs/room/a.py").write_text(f"import numpy\n{line}\n")
    (house / "baselines/c.py").write_text("from poise.envs.room.a import g\n")
    before = digests(house)
    assert digests(house) == before
    for edited, dropped in (
        ("envs/room/b.py", [True, True, True]),
        ("envs/room/a.py", [True, False, True]),
        ("baselines/c.py", [False, False, True]),
    ):
        text = (house / edited).read_text()
        (house / edited).write_text(text + "x = 1\n")
        assert [a != b for a, b in zip(digests(house), before, strict=True)] == dropped
        (house / edited).write_text(text)


def test_how_kernels_are_compiled_is_part_of_all(house: Path) -> None:
    """Whether or not a file imports the room."""
    before = digests(house)
    (house / "envs/compiled/jit.py").write_text("x = 1\n")
    assert all(a != b for a, b in zip(digests(house), before, strict=True))


def test_what_no_kernel_sees_drops_nothing(house: Path) -> None:
    """Imports for types, and within functions; other packages; files that import each other."""
    (house / "envs/room/a.py").write_text(
        "from typing import TYPE_CHECKING\nfrom poise.configs.b import x\nfrom os import path\n"
        "if TYPE_CHECKING:\n    from .b import B\n\ndef f():\n    from .b import B\n"
    )
    assert sources.imported(str(house / "envs/room/a.py")) == {str(house / "envs/room/a.py")}
    (house / "envs/room/b.py").write_text("from poise.baselines.c import x\n")
    (house / "baselines/c.py").write_text("from poise.envs.room.b import y\n")
    _, b, c = digests(house)
    assert b == c  # each is compiled from both
