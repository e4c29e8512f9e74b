"""The reader of YAML: PyYAML's safe loader, within bounds, with two of its surprises removed."""

import re
from collections.abc import Iterator
from typing import Any

import yaml

from .errors import shown

DEPTH = 64  # of lists and mappings in each other
NODES = 50_000  # with aliases expanded
ENTRIES = 1000  # of a mapping: keys may be chosen so that each is compared with all others
SCALAR = 100  # characters that count as one node
DIGITS = 308  # of a number: any such whole number is a finite float

MERGE, VALUE, TEXT = (f"tag:yaml.org,2002:{name}" for name in ("merge", "value", "str"))
MANY_ENTRIES = f"a mapping of more than {ENTRIES} entries"

# libyaml's parser takes a tenth of the time of Python's; not every PyYAML has it
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class Loader(_Safe):
    """PyYAML's safe loader, with ``1e-3`` read as a number and repeated keys refused.

    Nothing is built before the whole text is found to be within the bounds. An alias counts as
    what it stands for: a text of few lines may hold millions of nodes.
    """

    def __init__(self, stream: str | bytes) -> None:
        Bounds().check(stream)
        super().__init__(stream)

    def get_single_node(self) -> yaml.Node | None:
        """Return the root of the only document, in which no mapping repeats a key."""
        root = super().get_single_node()
        for node in _mappings(root):
            seen = set()
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode):
                    if key.value in seen:
                        raise _error(f"key {shown(key.value)} occurs twice", key.start_mark)
                    seen.add(key.value)
        return root

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Put what ``<<`` merges into a mapping, which stays within the bounds.

        The mapping's own entries come last, so that they count; of a list its first mapping does.
        PyYAML 6.0.4 goes by the identity of strings instead.
        """
        own, merged = [], []
        for key, value in node.value:
            if key.tag == MERGE:
                for each in self._to_merge(node, value):
                    self.flatten_mapping(each)
                    merged += each.value
            else:
                if key.tag == VALUE:
                    key.tag = TEXT
                own.append((key, value))
        node.value = merged + own
        if len(node.value) > ENTRIES:
            raise _error(MANY_ENTRIES, node.start_mark)

    @staticmethod
    def _to_merge(node: yaml.MappingNode, value: yaml.Node) -> list[yaml.MappingNode]:
        """Return the mappings that a ``<<`` names, the one that counts most last."""
        found: list[Any] = value.value[::-1] if isinstance(value, yaml.SequenceNode) else [value]
        for each in found:
            if not isinstance(each, yaml.MappingNode):
                raise _error("what << merges must be a mapping or a list of them", node.start_mark)
        return found

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
            raise _error(f"{shown(node.value)} is no {kind} ({error})", node.start_mark) from None
        if isinstance(value, int) and abs(value) >= 10**DIGITS:
            raise _error(f"a number of more than {DIGITS} digits", node.start_mark)
        return value


class Bounds:
    """Counts the nodes of a text while it is parsed, event by event; keeps sizes of children."""

    def __init__(self) -> None:
        self._open: list[tuple[yaml.NodeEvent, list[tuple[int, int]]]] = []
        self._sizes: dict[str, tuple[int, int] | None] = {}  # by anchor; None: not yet ended
        self._events = 0

    def check(self, stream: str | bytes) -> None:
        """Raise a MarkedYAMLError at the first place that is beyond the bounds."""
        for event in _events(stream):
            if isinstance(event, yaml.DocumentStartEvent):
                self._sizes.clear()
            elif isinstance(event, yaml.CollectionStartEvent):
                self._begin(event)
            elif isinstance(event, yaml.CollectionEndEvent):
                self._end()
            elif isinstance(event, yaml.NodeEvent):
                self._leaf(event)

    def _begin(self, event: yaml.CollectionStartEvent) -> None:
        if len(self._open) == DEPTH:
            raise _error(f"more than {DEPTH} levels", event.start_mark)
        if event.anchor:
            self._sizes[event.anchor] = None
        self._open.append((event, [(1, 0)]))

    def _end(self) -> None:
        event, sizes = self._open.pop()
        size = sum(nodes for nodes, _ in sizes), 1 + max(height for _, height in sizes)
        self._add(event, size)

    def _leaf(self, event: yaml.NodeEvent) -> None:
        if isinstance(event, yaml.ScalarEvent):
            return self._add(event, (1 + len(event.value) // SCALAR, 1))
        # an unknown alias is the composer's to refuse
        size = self._sizes.get(str(event.anchor), (1, 1))
        if size is None:
            raise _error("an alias of what it stands in", event.start_mark)
        return self._add(event, size)

    def _add(self, event: yaml.NodeEvent, size: tuple[int, int]) -> None:
        """Take a node that has ended as a child of the one that it stands in."""
        self._events += 1
        if max(size[0], self._events) > NODES:
            raise _error(f"more than {NODES} values, aliases counted as what they repeat",
                         event.start_mark)  # fmt: skip
        if size[1] > DEPTH:
            raise _error(f"more than {DEPTH} levels", event.start_mark)
        if event.anchor:
            self._sizes[event.anchor] = size
        if self._open:
            parent, sizes = self._open[-1]
            sizes.append(size)
            if isinstance(parent, yaml.MappingStartEvent) and len(sizes) > 2 * ENTRIES + 1:
                raise _error(MANY_ENTRIES, parent.start_mark)


def _events(stream: str | bytes) -> Iterator[yaml.Event]:
    """What PyYAML's parser finds; its own bound on depth, which not every version has, is ours."""
    try:
        yield from yaml.parse(stream, Loader=_Safe)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" not in str(error.problem):
            raise
        raise _error(f"more than {DEPTH} levels", error.problem_mark) from None


def _mappings(root: yaml.Node | None) -> Iterator[yaml.MappingNode]:
    """Yield all mappings from a node on, each once."""
    waiting: list[Any] = [root]
    seen = set()
    while waiting:
        node = waiting.pop()
        if not isinstance(node, yaml.CollectionNode) or id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.MappingNode):
            yield node
            waiting += [each for pair in node.value for each in pair]
        else:
            waiting += node.value


def _error(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.composer.ComposerError(None, None, problem, mark)


def _all(loader: Loader, node: yaml.Node) -> None:
    """A slice of everything, as Isaac Lab dumps it: null, which stands for all. None is built."""
    parts = loader.construct_sequence(node) if isinstance(node, yaml.SequenceNode) else [node.value]
    if any(part is not None for part in parts):
        raise _error("a slice is read only where it is of everything", node.start_mark)


Loader.add_constructor("tag:yaml.org,2002:python/object/apply:builtins.slice", _all)

# YAML 1.1, which PyYAML follows, wants a dot and a signed exponent: 1e-3 would be a string.
Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
