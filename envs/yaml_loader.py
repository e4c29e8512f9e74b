"""How Poise reads YAML: PyYAML's safe loader, within bounds, with two of its surprises removed."""

from __future__ import annotations

import re
from typing import Any

import yaml

DEPTH = 64  # of lists and mappings in each other
NODES = 50_000  # with aliases expanded; a second of reading
SCALAR = 100  # characters that count as one node
DIGITS = 308  # of a number: any such whole number is a finite float


class Loader(yaml.SafeLoader):
    """PyYAML's safe loader, with ``1e-3`` read as a number and repeated keys refused.

    An alias counts as what it stands for: a text of few lines may hold millions of nodes.
    """

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self._depth = 0
        self._sizes: dict[int, tuple[int, int]] = {}  # finished node → (nodes, height)

    def compose_node(self, parent: Any, index: Any) -> yaml.Node | None:
        """A node, its size and its depth within the bounds."""
        event = self.peek_event()
        self._depth += 1
        if self._depth > DEPTH:
            raise _error(f"more than {DEPTH} levels", event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if node is not None:
            self._measure(node, isinstance(event, yaml.AliasEvent), event.start_mark)
        return node

    def _measure(self, node: yaml.Node, alias: bool, mark: Any) -> None:
        if alias and id(node) not in self._sizes:
            raise _error("an alias of what it stands in", mark)
        if not alias:
            self._sizes[id(node)] = self._size(node)
        nodes, height = self._sizes[id(node)]
        if nodes > NODES or len(self._sizes) > NODES:
            raise _error(f"more than {NODES} values, aliases counted as what they repeat", mark)
        if height > DEPTH:
            raise _error(f"more than {DEPTH} levels", mark)

    def _size(self, node: yaml.Node) -> tuple[int, int]:
        """How many nodes, and how many levels, there are from this one on."""
        if isinstance(node, yaml.ScalarNode):
            return 1 + len(node.value) // SCALAR, 1
        pairs = isinstance(node, yaml.MappingNode)
        children = [each for pair in node.value for each in pair] if pairs else node.value
        sizes = [self._sizes[id(child)] for child in children]
        return 1 + sum(n for n, _ in sizes), 1 + max((height for _, height in sizes), default=0)

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise _error(f"key {key.value!r} occurs twice", key.start_mark)
                seen.add(key.value)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value of a node; whatever a scalar's text makes of its tag is an error with a place.

        PyYAML's constructors raise all kinds of exceptions for ``!!bool maybe`` or ``!!int ''``.
        """
        if not isinstance(node, yaml.ScalarNode):
            return super().construct_object(node, deep)
        kind = node.tag.rpartition(":")[2]
        if kind in ("int", "float") and len(node.value) > DIGITS + 100:
            raise _error(f"a number of more than {DIGITS} digits", node.start_mark)
        try:
            value = super().construct_object(node, deep)
        except yaml.YAMLError:
            raise
        except Exception as error:
            text = f"{node.value[:100]!r} is no {kind} ({error})"
            raise _error(text, node.start_mark) from None
        if isinstance(value, int) and abs(value) >= 10**DIGITS:
            raise _error(f"a number of more than {DIGITS} digits", node.start_mark)
        return value


def _error(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.composer.ComposerError(None, None, problem, mark)


# YAML 1.1, which PyYAML follows, wants a dot and a signed exponent: 1e-3 would be a string.
Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
