"""SVG pictures of pages, read back by tests."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from poise.training.pictures.figures.style import Inline


def drawing(svg: str) -> ElementTree.Element:
    """The svg element."""
    return ElementTree.fromstring(svg)


def points(path: ElementTree.Element) -> np.ndarray:
    """Coordinates of a path (n, 2), of its lines' ends and its curves' points."""
    numbers = re.findall(r"-?\d+\.?\d*", path.get("d", ""))
    return np.array(numbers, dtype=float).reshape(-1, 2)


def middle(path: ElementTree.Element) -> np.ndarray:
    """The middle of a mark (2,)."""
    found = points(path)
    return 0.5 * (found.min(axis=0) + found.max(axis=0))


def groups(out: Inline, word: str = "series") -> Iterator[ElementTree.Element]:
    """The groups of this class; of an empty one, all."""
    root = drawing(out.svg)
    return (g for g in root.iter("g") if not word or word in g.get("class", "").split())


def marks(out: Inline, word: str = "series") -> dict[str, ElementTree.Element]:
    """What a page tells of a mark → its path."""
    return {
        group[0].text or "": group[-1] for group in groups(out, word) if group[0].tag == "title"
    }
