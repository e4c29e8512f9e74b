"""`python -m tests.wording`: tests that assert on the wording of a message, by file.

A text counts as wording if it has three words or more and is compared with what was printed, with
an error's text, by the `match` of `pytest.raises` and `pytest.warns`, or as a value of `invalid`.
Such a test breaks when a sentence is improved. What a message holds (its file, field, choices, exit
code) is data.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parent
WORDS = re.compile(r"[A-Za-z]{2,}[,:]? [A-Za-z]{2,}[,:]? [A-Za-z]{2,}")
PRINTED = {"readouterr", "capsys", "capfd", "stdout", "stderr", "err", "out", "output", "error",
           "said", "message", "caught", "value", "printed", "lines"}  # fmt: skip


def texts(node: ast.AST) -> Iterator[str]:
    """The literals in an expression, also in f-strings and joined ones."""
    for each in ast.walk(node):
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            yield each.value


def names(node: ast.AST) -> set[str]:
    found = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    return found | {each.attr for each in ast.walk(node) if isinstance(each, ast.Attribute)}


def is_wording(node: ast.AST) -> bool:
    return any(WORDS.search(text) for text in texts(node))


def on_wording(function: ast.FunctionDef) -> bool:
    """Whether a test compares words with a message."""
    given = [each for decorator in function.decorator_list for each in [decorator]
             if is_wording(each) and "parametrize" in names(each)]  # fmt: skip
    for node in ast.walk(function):
        if isinstance(node, ast.keyword) and node.arg == "match":
            if is_wording(node.value) or (given and names(node.value)):
                return True
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("invalid", "refused"):
            if is_wording(node) or (given and any(isinstance(a, ast.Starred) for a in node.args)):
                return True
        if isinstance(node, ast.Assert) and names(node) & PRINTED:
            if is_wording(node.test) or (given and isinstance(node.test, ast.Compare)):
                return True
    return False


def count() -> tuple[Counter[str], int]:
    """File → number of tests on wording; the number of all tests."""
    found: Counter[str] = Counter()
    total = 0
    for path in sorted(TESTS.rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                total += 1
                found[str(path.relative_to(TESTS))] += on_wording(node)
    return found, total


if __name__ == "__main__":
    found, total = count()
    for name, number in found.most_common(40):
        if number:
            print(f"{number:4} {name}")
    print(f"{sum(found.values())} of {total} tests")
