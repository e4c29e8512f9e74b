"""Compiled code names what it reads: no one-entry array for a number, no constant for an index."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = [path for room in ("envs", "baselines", "training") for path in (ROOT / room).rglob("*.py")]

#: the state of a random generator, which `uniform` and its like take by reference
BY_REFERENCE = {"envs/physics/arms.py: seed", "envs/sensing/measurement.py: seed"}


def has_one_entry(annotation: ast.expr | None) -> bool:
    """Whether it is `Annotated[np.ndarray, 1]` or the same of another type of numbers."""
    if not isinstance(annotation, ast.Subscript) or not isinstance(annotation.slice, ast.Tuple):
        return False
    shape = [part for part in annotation.slice.elts[1:] if isinstance(part, ast.Constant)]
    return ast.unparse(annotation.value) == "Annotated" and [part.value for part in shape] == [1]


def fields_of_one_entry(tree: ast.Module) -> list[str]:
    """The names that are annotated so, and those of aliases of such an annotation."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign) and has_one_entry(node.annotation):
            found.append(ast.unparse(node.target))
        if isinstance(node, ast.Assign) and has_one_entry(node.value):
            found.append(ast.unparse(node.targets[0]))
    return found


def index_names(tree: ast.Module) -> set[str]:
    """Constants of a module that count up: `A, B = range(2)`, `A, B = 0, 1`; classes of IntEnum."""
    found: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and any("IntEnum" in ast.unparse(b) for b in node.bases):
            found.add(node.name)
        if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Tuple):
            continue
        names = {ast.unparse(each) for each in node.targets[0].elts}
        value = ast.unparse(node.value)
        if value.startswith("range(") or (
            isinstance(node.value, ast.Tuple)
            and all(isinstance(each, ast.Constant | ast.Tuple) for each in node.value.elts)
            and all(type(ast.literal_eval(each)) in (int, tuple) for each in node.value.elts)
        ):
            found |= names
    return found


def in_indices(tree: ast.Module) -> set[str]:
    """All names, of attributes too, that stand in the index of anything."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            found |= {each.id for each in ast.walk(node.slice) if isinstance(each, ast.Name)}
            found |= {each.attr for each in ast.walk(node.slice) if isinstance(each, ast.Attribute)}
    return found


def imports(tree: ast.Module) -> dict[tuple[str, str], str]:
    """(last part of the module, name) of what is imported → its local name."""
    return {
        ((node.module or "").split(".")[-1], each.name): each.asname or each.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for each in node.names
    }


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text()) for path in FILES}


def test_a_number_is_no_array_of_one_entry(trees: dict[str, ast.Module]) -> None:
    """It is a `Mutable[float]`, of which `x.name[0]` is a typing error already."""
    found = {
        f"{path}: {name}" for path, tree in trees.items() for name in fields_of_one_entry(tree)
    }
    assert found == BY_REFERENCE


def test_no_constant_stands_for_the_name_of_an_entry(trees: dict[str, ast.Module]) -> None:
    used = {path: (in_indices(tree), imports(tree)) for path, tree in trees.items()}
    found = []
    for source, tree in trees.items():
        for name in index_names(tree):
            for path, (indices, imported) in used.items():
                local = name if path == source else imported.get((Path(source).stem, name))
                if local in indices:
                    found.append(f"{path}: [{local}]")
    assert found == []


def test_what_they_look_for_is_found() -> None:
    """The ways in which such code was written."""
    old = ast.parse(
        "Number = Annotated[np.ndarray, 1]\n"
        "class A(Block):\n"
        "    clock: Annotated[np.ndarray, 1, np.int64]\n"
        "    pair: Annotated[np.ndarray, 2]\n"
        "X, Y = range(2)\n"
        "UP, DOWN = 0, 1\n"
        "BLUE, GREY = '#00f', '#777'\n"
        "class Row(IntEnum):\n"
        "    P = 0\n"
    )
    assert fields_of_one_entry(old) == ["Number", "clock"]
    assert index_names(old) == {"X", "Y", "UP", "DOWN", "Row"}
    assert in_indices(ast.parse("a[2 * X + 1] = b[i, m.DOWN] + Y")) == {"X", "i", "m", "DOWN"}
