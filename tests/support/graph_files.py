"""Ways to damage the file of a motion graph."""

from __future__ import annotations

import numpy as np

WORDS = ("nan", ".inf", "-5", "[", "{", "null", "true", "1e999", "é", "\x00", "&a", "*a", "!!int x",
         "9" * 400, "stand", "- ", ": ")  # fmt: skip


def damaged_graph(text: str, rng: np.random.Generator) -> str:
    """The text with one to three random damages: lines, words, numbers and characters."""
    for _ in range(int(rng.integers(1, 4))):
        lines = text.split("\n")
        i, j = (int(k) for k in rng.integers(0, len(lines), 2))
        kind = int(rng.integers(6))
        if kind == 0:
            del lines[i]
        elif kind == 1:
            lines.insert(i, lines[j])
        elif kind == 2:
            lines = lines[: max(i, 1)]
        elif kind == 3:
            words = lines[i].split(" ")
            words[int(rng.integers(len(words)))] = str(rng.choice(WORDS))
            lines[i] = " ".join(words)
        elif kind == 4:
            lines[i] = lines[i].replace(str(rng.integers(10)), str(rng.choice(WORDS)), 1)
        else:
            lines[i] = "  " * int(rng.integers(3)) + lines[i].strip()
        text = "\n".join(lines)
    return text
