"""Random scripts for tests, as trees, and ways to damage a text."""

from __future__ import annotations

import numpy as np

from poise.baselines.motion.synthesis.scripts.tree import (
    KINDS,
    Arrow,
    ClipName,
    Define,
    Modifier,
    Overlay,
    Script,
    ScriptTerm,
    Sequence,
    StateName,
)

#: the example of Semakin's dissertation, (18)
SEED = '"бег" -> ("красться" | "достать оружие") -> "лечь" -> ("идти" | "убрать оружие")'
NAMES = ("squat", "reach_up", "присесть", "on", "mirrored", "weight", "x1", "_a")
MARKS = '->|()<>*@[]:,{}=;#"\n\t aβя0.9e\x00\u2028'


def random_script(rng: np.random.Generator, depth: int = 3) -> Script:
    names = rng.choice(["u", "v", "w"], size=int(rng.integers(0, 3)), replace=False)
    defines = tuple(
        Define(str(name), random_sequence(rng, 1), bool(rng.random() < 0.3)) for name in names
    )
    return Script(defines, random_sequence(rng, depth))


def random_sequence(rng: np.random.Generator, depth: int) -> Sequence:
    overlays = [random_overlay(rng, depth) for _ in range(int(rng.integers(1, 4)))]
    return Sequence(tuple(overlays), tuple(random_arrow(rng) for _ in overlays[1:]))


def random_overlay(rng: np.random.Generator, depth: int) -> Overlay:
    return Overlay(tuple(random_term(rng, depth) for _ in range(int(rng.integers(1, 3)))))


def random_arrow(rng: np.random.Generator) -> Arrow:
    if rng.random() < 0.6:
        return Arrow()
    options = (("duration", round(float(rng.uniform(0.1, 3.0)), 3)),) if rng.random() < 0.5 else ()
    return Arrow(str(rng.choice(KINDS)), options)


def random_term(rng: np.random.Generator, depth: int) -> ScriptTerm:
    kind = rng.random()
    body: ClipName | StateName | Sequence
    if kind < 0.3 and depth:
        body = random_sequence(rng, depth - 1)
    elif kind < 0.4:
        time = round(float(rng.uniform(0.0, 5.0)), 3) if rng.random() < 0.5 else None
        body = StateName(str(rng.choice([*NAMES, "a b"])), time)
    elif kind < 0.7:
        body = ClipName(str(rng.choice([*NAMES, "достать оружие", "a|b -> #"])), quoted=True)
    else:
        body = ClipName(str(rng.choice(NAMES)))
    return ScriptTerm(body, tuple(random_modifier(rng) for _ in range(int(rng.integers(0, 3)))))


def random_modifier(rng: np.random.Generator) -> Modifier:
    start, number = float(rng.uniform(0.0, 5.0)), round(float(rng.uniform(0.1, 1.0)), 4)
    chosen = (
        Modifier("*", (float(rng.integers(1, 9)),)),
        Modifier("@", (number,)),
        Modifier("weight", (number,)),
        Modifier("[", (start, start + number)),
        Modifier("on", names=("arms", "head")[: int(rng.integers(1, 3))]),
        Modifier("mirrored"),
    )
    return chosen[int(rng.integers(len(chosen)))]


def damaged(text: str, rng: np.random.Generator) -> str:
    """The text with one to four random damages: marks put in, parts left out, doubled, swapped."""
    for _ in range(int(rng.integers(1, 5))):
        a, b = sorted(int(i) for i in rng.integers(0, len(text) + 1, 2))
        kind = int(rng.integers(5))
        if kind == 0:
            text = text[:a] + str(rng.choice(list(MARKS))) + text[a:]
        elif kind == 1:
            text = text[:a] + text[min(b, a + 4) :]
        elif kind == 2:
            text = text[:b] + text[a:]
        elif kind == 3:
            text = text[:a] + text[a:b][::-1] + text[b:]
        else:
            text = (
                text[:a]
                + str(rng.choice(["->", "(", ")", "* 1e999", "[3:1]", "9" * 400]))
                + text[a:]
            )
    return text
