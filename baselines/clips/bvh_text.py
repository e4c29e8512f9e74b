"""The text of a BVH file, looked at line by line, so that an error says in which line it is.

pybvh, which reads the file, allocates what the file announces and tells rows, not lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import MIB, read_text

BVH_BYTES = 64 * MIB
MOST_JOINTS = 500
MOST_LEVELS = 100  # of joints on joints
MOST_VALUES = 20_000_000
HIERARCHY = ("HIERARCHY", "ROOT", "JOINT", "End Site", "{", "}", "OFFSET", "CHANNELS", "MOTION",
             "Frames:", "Frame Time:")  # fmt: skip
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


def check_bvh(path: Path) -> None:
    """Raise ConfigError, with the number of the line, for what is no BVH file within bounds.

    At most 64 MiB, 500 joints, 100 levels, 20 million values; all numbers finite; one root with
    three places and three rotations, three rotations for every other joint; as many rows of as many
    values as are announced.
    """
    lines = enumerate(read_text(path, BVH_BYTES).splitlines(), start=1)
    head = _Head(path)
    for number, line in lines:
        words = line.split()
        if words and head.take(number, words):
            break
    else:
        raise ConfigError("ends before a line 'Frame Time:'", source=path)
    _check_rows(lines, head)


class _Head:
    """What the lines before the values have said so far."""

    def __init__(self, path: Path):
        self.path = path
        self.level, self.joints, self.channels, self.frames = 0, 0, 0, 0
        self.names: set[str] = set()
        self.expects = ""  # "{" after the name of a joint

    def fail(self, number: int, text: str, choices: tuple[str, ...] | None = None) -> None:
        raise ConfigError(f"line {number}: {text}", source=self.path, choices=choices)

    def take(self, number: int, words: list[str]) -> bool:
        """Look at one line; True for the last one before the values."""
        word = words[0]
        if self.expects and word != self.expects:
            self.fail(number, f"{shown(word)} where {self.expects!r} must stand")
        self.expects = ""
        if word in ("ROOT", "JOINT", "End"):
            self._joint(number, words)
        elif word in ("{", "}"):
            self._brace(number, words)
        elif word == "OFFSET":
            self._numbers(number, words[1:], 3)
        elif word == "CHANNELS":
            self._channels(number, words)
        elif word == "Frames:":
            self._frames(number, words)
        elif words[:2] == ["Frame", "Time:"]:
            return self._time(number, words)
        elif word not in HIERARCHY:
            self.fail(number, f"{shown(word)} begins no line of a BVH file", HIERARCHY)
        return False

    def _joint(self, number: int, words: list[str]) -> None:
        self.expects = "{"
        if words[0] == "End":
            return
        if len(words) != 2:
            self.fail(number, f"{words[0]} must be followed by one name")
        if words[1] in self.names:
            self.fail(number, f"a second joint is called {shown(words[1])}")
        if words[0] == "ROOT" and self.names:
            self.fail(number, "a second ROOT: one skeleton with one root can be read")
        self.names.add(words[1])
        if len(self.names) > MOST_JOINTS:
            self.fail(number, f"more than {MOST_JOINTS} joints")

    def _brace(self, number: int, words: list[str]) -> None:
        if len(words) != 1:
            self.fail(number, f"{words[0]!r} must stand in a line by itself")
        self.level += 1 if words[0] == "{" else -1
        if self.level < 0:
            self.fail(number, "'}' without a '{'")
        if self.level > MOST_LEVELS:
            self.fail(number, f"more than {MOST_LEVELS} joints on each other")

    def _channels(self, number: int, words: list[str]) -> None:
        known = {name.lower() for name in CHANNELS}
        for word in words[2:]:
            if word.lower() not in known:
                self.fail(number, f"no such channel: {shown(word)}", CHANNELS)
        if words[1:2] != [str(len(words) - 2)]:
            self.fail(number, f"CHANNELS {shown(' '.join(words[1:2]))} and {len(words) - 2} names")
        if len({word.lower() for word in words[2:]}) != len(words) - 2:
            self.fail(number, "a channel is named twice")
        self.channels += len(words) - 2

    def _frames(self, number: int, words: list[str]) -> None:
        if len(words) != 2 or not words[1].isascii() or not words[1].isdigit():
            self.fail(number, "'Frames:' must be followed by their number")
        self.frames = int(words[1][:12])
        if not 1 < self.frames <= MOST_VALUES // max(self.channels, 1):
            self.fail(number, f"{self.frames} frames of {self.channels} values: at least 2 frames "
                      f"and at most {MOST_VALUES} values can be read")  # fmt: skip

    def _time(self, number: int, words: list[str]) -> bool:
        (dt,) = self._numbers(number, words[2:], 1)
        if not 1e-4 <= dt <= 10.0:
            self.fail(number, f"a frame time must be within 0.0001 and 10 s, not {dt:g}")
        if self.level or not self.names:
            self.fail(number, f"{self.level} '{{' are not closed" if self.level else "no ROOT")
        if not self.frames:
            self.fail(number, "'Frame Time:' before 'Frames:'")
        return True

    def _numbers(self, number: int, words: list[str], count: int) -> list[float]:
        if len(words) != count:
            self.fail(number, f"{len(words)} numbers instead of {count}")
        return _floats(self, number, words)


def _floats(head: _Head, number: int, words: list[str]) -> list[float]:
    """The numbers in a line; a fault is looked for only if there is one."""
    try:
        values = list(map(float, words))
        if math.isfinite(sum(values)) and max(map(abs, values)) < 1e9:
            return values
    except ValueError:
        values = []
    for word in words:
        try:
            fine = math.isfinite(float(word)) and abs(float(word)) < 1e9
        except ValueError:
            fine = False
        if not fine:
            head.fail(number, f"{shown(word)} is no number that can be read")
    return values


def _check_rows(lines: Iterator[tuple[int, str]], head: _Head) -> None:
    rows = number = 0
    for number, line in lines:
        words = line.split()
        if not words:
            continue
        rows += 1
        if len(words) != head.channels:
            head.fail(number, f"{len(words)} values instead of {head.channels}, as the joints have")
        _floats(head, number, words)
    if rows != head.frames:
        head.fail(number, f"the file ends after {rows} rows, 'Frames:' says {head.frames}")
