"""Small BVH files for tests, and ways to damage one; the packaged clips."""

from __future__ import annotations

import numpy as np

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh, packaged_clips

LEGS = ("UpLeg", "Leg", "Foot")
FRAMES = 12
WORDS = (
    "nan",
    "1e400",
    "-5",
    "{",
    "}",
    "JOINT",
    "CHANNELS",
    "x",
    "é",
    "\0",
    "ROOT",
    "End",
    "0",
    "9" * 12,
)


def small_bvh(frames: int = FRAMES) -> str:
    """A skeleton of hips and two legs, y up, z forward, in metres, that sinks a little."""
    lines = ["HIERARCHY", "ROOT Hips", "{", "OFFSET 0 0 0",
             "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"]  # fmt: skip
    for side, x in (("Left", 0.1), ("Right", -0.1)):
        for depth, bone in enumerate(LEGS):
            offset = f"OFFSET {x if depth == 0 else 0} {-0.1 if depth == 0 else -0.4} 0"
            lines += [f"JOINT {side}{bone}", "{", offset,
                      "CHANNELS 3 Zrotation Yrotation Xrotation"]  # fmt: skip
        lines += ["End Site", "{", "OFFSET 0 -0.05 0.15", "}", *("}" for _ in LEGS)]
    lines += ["}", "MOTION", f"Frames: {frames}", "Frame Time: 0.033333"]
    for i in range(frames):
        bend = 30.0 * np.sin(np.pi * i / (frames - 1))
        leg = [0, 0, -bend / 2, 0, 0, bend, 0, 0, -bend / 2]
        row = [0, 0.95 - 0.001 * i, 0, 0, 0, 0, *leg, *leg]
        lines.append(" ".join(f"{value:.6f}" for value in row))
    return "\n".join(lines) + "\n"


def mutated(text: str, rng: np.random.Generator) -> str:
    """The text with one to four random damages: characters, words, lines, cuts, numbers."""
    for _ in range(int(rng.integers(1, 5))):
        lines = text.split("\n")
        i = int(rng.integers(len(lines)))
        kind = int(rng.integers(8))
        if kind == 0:
            del lines[i]
        elif kind == 1:
            lines.insert(i, lines[int(rng.integers(len(lines)))])
        elif kind == 2:
            lines = lines[: max(i, 1)]
        elif kind == 3:
            words = lines[i].split() or [""]
            words[int(rng.integers(len(words)))] = str(rng.choice(WORDS))
            lines[i] = " ".join(words)
        elif kind == 4:
            lines[i] = lines[i][: len(lines[i]) // 2]
        elif kind == 5:
            lines[i] = lines[i].lower()
        elif kind == 6:
            j = int(rng.integers(len(lines)))
            lines[i], lines[j] = lines[j], lines[i]
        else:
            at = int(rng.integers(len(text) + 1))
            lines = (text[:at] + chr(int(rng.integers(1, 300))) + text[at + 1 :]).split("\n")
        text = "\n".join(lines)
    return text


def matching_clips() -> list[Clip]:
    """The packaged clips in the order of their names; the walk, number 7, goes at 0.4 m/s."""
    clips = [read_bvh(find_bvh(name)).clip for name in packaged_clips()]
    return [clip.at_speed(4.0) if clip.name == "humanoid_walk" else clip for clip in clips]
