"""Mutations of files: of their tree, of their words, of their bytes."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from functools import partial
from typing import Any

import yaml
from hypothesis import strategies as st

from .values import Json, decode, values

Draw = Callable[[st.SearchStrategy[Any]], Any]
BOMB = "\n".join(
    ["a: &a0 [x, x, x, x, x, x, x, x, x]"]
    + [f"k{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9)]
)
WORDS = [
    *("!!timestamp abc", "!!bool abc", "!!int ''", "!!float ''", "!!int [1]", "!!null x", "!!str"),
    *("!!binary ä", "!!set {a, b}", "!!omap [a: 1]", "!!pairs [a: 1]", "!!merge a", "!nosuch a"),
    *("!!python/object/apply:os.getcwd []", "!!python/name:os.system", "2026-11-23", "2026-13-45"),
    *("1:0:0.0", "1" + ":0" * 400 + ".0", "0x" + "f" * 5000, "0b" + "1" * 20_000, "9" * 5000),
    *("1e400", "-1e400", "1e-400", ".inf", "-.inf", ".nan", "~", "yes", "0o17", "1__0", "+", "-"),
    *("&a [*a]", "&a {b: *a}", "*nowhere", "<<: {a: 1}", "? a", "{", "}", "[", "]", ":", "'", '"'),
    *("[" * 400, "{a: " * 300, "- " * 900, "[" * 5000, '"\\U00110000"', '"\\ud800"', '"\\x00"'),
    *(
        "|",
        ">",
        "%YAML 9.9",
        "---",
        "...",
        "\t",
        "\u2028",
        "\ufeff",
        "# ",
        "'" + "x" * 70_000 + "'",
    ),
    *("x" * 300, "true", "null", "{}", "[]", "''", "[1, 2]", "{a: 1}", "1e9", "1e300", "-1", "0"),
]
DOCUMENTS = ["", "null", "[]", "1", "- a", "{a: 1, a: 2}", BOMB, "base: &a\n  b: *a",
             "--- a\n--- b", "\x00", "a: b: c", "? [a]\n: 1", "1: 2", "null: 1", "[a]: 1", "{}",
             "base: base.yaml",
             "kind: outside\nname: nosuch:Class", "a: &x {b: &y [*x, *x]}\nc: *y"]  # fmt: skip


def paths(tree: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to every node of a tree."""
    items: list[Any] = []
    if isinstance(tree, dict):
        items = list(tree.items())
    elif isinstance(tree, list):
        items = list(enumerate(tree))
    below = [path for key, value in items for path in paths(value, (*above, key))]
    return [above, *below] if above else below


def edit_tree(draw: Draw, tree: Any) -> Any:
    """One to three changes of nodes."""
    tree = {"": copy.deepcopy(tree)}
    for _ in range(draw(st.integers(1, 3))):
        ways = paths(tree)
        if ways:
            _edit_node(draw, tree, draw(st.sampled_from(ways)))
    return tree.get("")


def _edit_node(draw: Draw, tree: Any, path: tuple[Any, ...]) -> None:
    parent = tree
    for key in path[:-1]:
        parent = parent[key]
    key = path[-1]
    change = draw(st.sampled_from(["replace", "replace", "delete", "rename", "wrap", "copy"]))
    if change == "replace":
        parent[key] = decode(draw(values([str(key)], plain=True)))
    elif change == "delete":
        del parent[key]
    elif change == "wrap":
        parent[key] = draw(st.sampled_from([[parent[key]], {"a": parent[key]}]))
    elif isinstance(parent, list):
        parent.insert(key, parent[key])
    elif change == "rename":
        parent[draw(st.sampled_from(["a", "", 1, None, True, f"{key}s"]))] = parent.pop(key)
    else:
        parent[draw(st.sampled_from([str(key), "a"]))] = copy.deepcopy(parent[key])


def edit_words(draw: Draw, text: str) -> str:
    """One to three words replaced, or something put before them."""
    for _ in range(draw(st.integers(1, 3))):
        found = list(re.finditer(r"[^\s:,\[\]{}#]+", text))
        if found:
            word = draw(st.sampled_from(found))
            end = draw(st.sampled_from([word.end(), word.end(), word.start()]))
            text = text[: word.start()] + draw(st.sampled_from(WORDS)) + text[end:]
    return text


def byte_edits(draw: Draw, size: int) -> list[Json]:
    """One to four changes of a file: [place, bytes that go, bytes that come]."""
    edits = []
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(size - 1, 0)))
        gone = draw(st.sampled_from([0, 1, 1, 2, 8, 64, 10**9]))
        come = draw(st.one_of(st.just(b""), st.binary(min_size=1, max_size=8)))
        edits.append([place, gone, come.hex()])
    return edits


def edit_bytes(content: bytes, edits: list[Json]) -> bytes:
    """The file with these changes."""
    for place, gone, come in edits:
        content = content[:place] + bytes.fromhex(come) + content[place + gone :]
    return content


def yaml_text(tree: Any) -> bytes:
    """A YAML file of any tree."""
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True).encode(errors="replace")


def json_text(tree: Any) -> bytes:
    """A JSON file of any tree; NaN and infinities as Python writes them."""
    return json.dumps(tree, default=str, skipkeys=True).encode()


def changed(draw: Draw, content: bytes, form: str = "yaml") -> bytes:
    """A file like this one, but for a few changes; `form` is yaml, json or another."""
    how = draw(st.sampled_from(["tree", "tree", "words", "words", "bytes", "document"]))
    if how == "document":
        return str(draw(st.sampled_from(DOCUMENTS))).encode(errors="replace")
    if how == "words":
        return edit_words(draw, content.decode(errors="replace")).encode(errors="replace")
    if how == "tree" and form in ("yaml", "json"):
        tree = yaml.safe_load(content) if form == "yaml" else json.loads(content)
        return (yaml_text if form == "yaml" else json_text)(edit_tree(draw, tree))
    return edit_bytes(content, byte_edits(draw, len(content)))


@st.composite
def changed_files(draw: Draw, content: bytes, form: str = "yaml") -> bytes:
    """Strategy of `changed`."""
    return changed(draw, content, form)


yaml_files = partial(changed_files, form="yaml")
