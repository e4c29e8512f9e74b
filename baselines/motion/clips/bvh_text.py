"""The text of a BVH file, read line by line, so that an error says in which line it is."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.configs.errors import ConfigError, one_line, shown
from poise.configs.reading import MIB, read_bytes

BVH_BYTES = 64 * MIB
MOST_JOINTS = 500
MOST_LEVELS = 100  # of joints on joints
MOST_VALUES = 20_000_000
HIERARCHY = ("HIERARCHY", "ROOT", "JOINT", "End Site", "{", "}", "OFFSET", "CHANNELS", "MOTION",
             "Frames:", "Frame Time:")  # fmt: skip
FRAMES = re.compile(r"\s*(frames|frame\s*time)\s*:(.*)", re.IGNORECASE)
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclass(frozen=True, eq=False)
class BvhText:
    """What a BVH file says, in its own axes and unit.

    Attributes:
        names: of the joints, parents first.
        parents: (J,) index of the parent; −1 of the root.
        offsets: (J, 3).
        end_parents: (E,) joints on which an end site hangs; `end_offsets` (E, 3).
        channels: of each joint, such as ``Xposition``, in the order of the values.
        values: (F, C) of all channels, rotations in degrees.
        dt: between frames [s].
    """

    names: tuple[str, ...]
    parents: np.ndarray
    offsets: np.ndarray
    end_parents: np.ndarray
    end_offsets: np.ndarray
    channels: tuple[tuple[str, ...], ...]
    values: np.ndarray
    dt: float


def read_bvh_text(path: Path) -> BvhText:
    """The joints and the values of a BVH file.

    Marks before and after it do not count, nor the case of keywords, the spaces about a colon, and
    whether ``{`` stands in a line of its own.

    Raises ConfigError, with the number of the line, for what is no BVH file within bounds: at most
    64 MiB, 500 joints, 100 levels, 20 million values; all numbers finite; one root; as many rows of
    as many values as are announced.
    """
    whole = _text(path).splitlines()
    lines, head = enumerate(whole, start=1), _Head(path)
    for number, line in lines:
        if any(head.take(number, words) for words in _statements(line)):
            break
    else:
        raise ConfigError(f"line {len(whole)}: the file ends before a line 'Frame Time:'",
                          source=path)  # fmt: skip
    values = _rows(lines, head)
    return BvhText(
        tuple(head.names), np.array(head.parents), np.array(head.offsets),
        np.array(head.end_parents, int), np.array(head.end_offsets).reshape(-1, 3),
        tuple(tuple(each) for each in head.joint_channels), values, head.dt,
    )  # fmt: skip


def _text(path: Path) -> str:
    """Names may be in any encoding; all else is ASCII."""
    data = read_bytes(path, BVH_BYTES)
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.rstrip("\x1a\0 \t\r\n")


def _statements(line: str) -> list[list[str]]:
    """The words of a line before the values, keywords as the format's authors write them."""
    if frames := FRAMES.fullmatch(line):
        first = ["Frames:"] if frames[1].lower() == "frames" else ["Frame", "Time:"]
        return [first + frames[2].split()]
    words = line.split()
    for word in (*HIERARCHY, "End"):
        if words and words[0].upper() == word.upper():
            words[0] = word
    if words[1:] and words[-1] == "{":
        return [words[:-1], ["{"]]
    return [words] if words else []


class _Head:
    """What the lines before the values have said so far."""

    def __init__(self, path: Path):
        self.path = path
        self.channels, self.frames, self.dt = 0, 0, 0.0
        self.names: dict[str, int] = {}
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.joint_channels: list[list[str]] = []
        self.end_parents: list[int] = []
        self.end_offsets: list[list[float]] = []
        self.expects = ""  # "{" after the name of a joint
        self.new = -1  # the joint whose "{" is expected; an end site has −1
        self.open: list[int] = []  # joints whose "}" is to come; −1 of an end site

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
            self._offset(number, words)
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
            self.new = -1
            return
        name = " ".join(words[1:])
        if not name or "{" in name:
            self.fail(number, f"{words[0]} must be followed by a name")
        if name in self.names:
            self.fail(number, f"a second joint is called {shown(name)}: rename one of them")
        if words[0] == "ROOT" and self.names:
            self.fail(number, "a second ROOT: one skeleton with one root can be read")
        if words[0] == "JOINT" and (not self.open or self.open[-1] < 0):
            self.fail(number, "a JOINT that is in no other joint")
        self.new = self.names[name] = len(self.names)
        self.parents.append(self.open[-1] if self.open else -1)
        self.offsets.append([0.0, 0.0, 0.0])
        self.joint_channels.append([])
        if len(self.names) > MOST_JOINTS:
            self.fail(number, f"more than {MOST_JOINTS} joints")

    def _brace(self, number: int, words: list[str]) -> None:
        if len(words) != 1:
            self.fail(number, f"{words[0]!r} must stand in a line by itself")
        if words[0] == "{":
            self.open.append(self.new)
            self.new = -1
        elif self.open:
            self.open.pop()
        else:
            self.fail(number, "'}' without a '{'")
        if len(self.open) > MOST_LEVELS:
            self.fail(number, f"more than {MOST_LEVELS} joints on each other")

    def _offset(self, number: int, words: list[str]) -> None:
        values = self._numbers(number, words[1:], 3)
        if not self.open:
            self.fail(number, "an OFFSET in no joint")
        if self.open[-1] >= 0:
            self.offsets[self.open[-1]] = values
        elif len(self.open) > 1 and self.open[-2] >= 0:
            self.end_parents.append(self.open[-2])
            self.end_offsets.append(values)

    def _channels(self, number: int, words: list[str]) -> None:
        known = {name.lower() for name in CHANNELS}
        for word in words[2:]:
            if word.lower() not in known:
                self.fail(number, f"no such channel: {shown(word)}", CHANNELS)
        if words[1:2] != [str(len(words) - 2)]:
            self.fail(number, f"CHANNELS {shown(' '.join(words[1:2]))} and {len(words) - 2} names")
        named = [word.capitalize() for word in words[2:]]
        if len(set(named)) != len(named):
            self.fail(number, "a channel is named twice")
        if not self.open or self.open[-1] < 0 or self.joint_channels[self.open[-1]]:
            self.fail(number, "CHANNELS in no joint, or twice in one")
        if self.open[-1] != len(self.names) - 1:
            self.fail(number, "CHANNELS of a joint after those of joints in it")
        self.joint_channels[self.open[-1]] = named
        self.channels += len(named)

    def _frames(self, number: int, words: list[str]) -> None:
        if len(words) != 2 or not words[1].isascii() or not words[1].isdigit():
            self.fail(number, "'Frames:' must be followed by their number")
        self.frames = int(words[1]) if len(words[1]) <= 12 else 10**12  # more than can be read
        if not 1 < self.frames <= MOST_VALUES // max(self.channels, 1):
            frames = f"{one_line(words[1], 40)} frames of {self.channels} values"
            self.fail(number, f"{frames}: at least 2 frames and at most {MOST_VALUES} values can "
                      "be read")  # fmt: skip

    def _time(self, number: int, words: list[str]) -> bool:
        (dt,) = self._numbers(number, words[2:], 1)
        if not 1e-4 <= dt <= 10.0:
            self.fail(number, f"a frame time must be within 0.0001 and 10 s, not {dt:g}")
        if self.open or not self.names:
            self.fail(number, f"{len(self.open)} '{{' are not closed" if self.open else "no ROOT")
        if not self.frames:
            self.fail(number, "'Frame Time:' before 'Frames:'")
        self.dt = dt
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


def _rows(lines: Iterator[tuple[int, str]], head: _Head) -> np.ndarray:
    """(F, C) the values of all frames."""
    rows: list[np.ndarray] = []
    number = 0
    for number, line in lines:
        words = line.split()
        if not words:
            continue
        if len(words) != head.channels:
            head.fail(number, f"{len(words)} values instead of {head.channels}, as the joints have")
        rows.append(np.array(_floats(head, number, words)))
        if len(rows) > head.frames:
            break
    if len(rows) != head.frames:
        head.fail(number, f"the file ends after {len(rows)} rows, 'Frames:' says {head.frames}")
    return np.array(rows)
