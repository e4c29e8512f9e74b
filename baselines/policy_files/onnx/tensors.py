"""Where the numbers of an ONNX file lie, if not in it: its protocol buffers, read for that alone.

Every place is looked at where ONNX allows a tensor: graphs, graphs within nodes, functions,
training. The package onnx would do, but playing a network does not need it.
"""

from collections.abc import Iterator
from itertools import islice

#: kind of message → its fields that lead to tensors: number → kind of message (onnx.proto)
_SPARSE = {1: "tensor", 2: "tensor"}
_FIELDS = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": _SPARSE,
    "tensor": {13: "entry"},
}
DEPTH = 100  # of messages within messages; protobuf reads no more
PARTS = 200_000  # fields that are looked at; a network of 64 MiB has some thousands
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


def external_files(content: bytes) -> set[str]:
    """Names of the files, relative to that of the network, in which its tensors lie.

    Raises ValueError for what is no ONNX file.
    """
    found: set[str] = set()
    messages, seen = [("model", memoryview(content), 0)], 0
    while messages:
        kind, message, depth = messages.pop()
        parts = list(islice(_parts(message), PARTS + 1 - seen))
        seen += len(parts)
        if seen > PARTS or depth > DEPTH:
            raise ValueError(f"more than {PARTS} parts, or {DEPTH} levels")
        if kind == "entry":
            found |= _location(parts)
        else:
            inner = _FIELDS[kind]
            messages += [(inner[n], part, depth + 1) for n, part in parts if n in inner]
    return found


def _location(entry: list[tuple[int, memoryview]]) -> set[str]:
    """The name in an entry of a tensor's `external_data`, a key (1) and a value (2).

    Where a field is repeated, every value counts.
    """
    if b"location" not in (bytes(part) for number, part in entry if number == 1):
        return set()
    values = (bytes(part) for number, part in entry if number == 2)
    return {value.decode(errors="surrogateescape") for value in values} or {""}


def _parts(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """The fields of a message: number, and content, which is empty where it is a number."""
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        number, wire = tag >> 3, tag & 7
        if wire == _VARINT:
            _, at = _varint(message, at)
            yield number, message[:0]
        elif wire in (_FIXED64, _FIXED32):
            at += 8 if wire == _FIXED64 else 4
            yield number, message[:0]
        elif wire == _BYTES:
            size, at = _varint(message, at)
            if at + size > len(message):
                raise ValueError("ends within a field")
            yield number, message[at : at + size]
            at += size
        else:
            raise ValueError(f"a field of the unknown kind {wire}")


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number of seven bits in each byte, the least first; and where it ends."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            break
        byte = message[at]
        value, at = value | (byte & 0x7F) << shift, at + 1
        if byte < 0x80:
            return value, at
    raise ValueError("a number without an end")
