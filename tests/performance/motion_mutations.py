"""Damaged scripts and graphs: each is taken or refused in one line, within 5 s.

python -m tests.performance.motion_mutations [NUMBER]
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    StatePlace,
    read_graph,
    write_graph,
)
from poise.baselines.motion.graphs.paths import PathTask
from poise.baselines.motion.graphs.search import best_paths
from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.synthesis import Synthesis
from poise.configs.errors import PoiseError
from tests.support.graph_files import damaged_graph
from tests.support.scripts import damaged

LIMIT = 5.0  # [s] of the processor
SCRIPTS = (
    "<up> -> stand -> squat[0.2:1.8]@0.5 mirrored ->{cross, 0.4} punch * 2 -> <up>",
    "a = squat | punch on arms, head weight 0.5;\nb = a * 2 -> stand;\nb -> (a | stand) -> punch",
    "squat ->{insert, duration: 0.5} (punch -> stand) * 2  # a comment\n -> squat",
)


@cache
def clips() -> dict[str, Clip]:
    """Three clips of a second or two, so that much is played quickly."""
    cuts = {"stand": (0.0, 0.9), "squat": (0.5, 2.5), "punch": (0.5, 2.5)}
    return {
        name: read_bvh(find_bvh(f"humanoid_{name}")).clip.cut(*cut) for name, cut in cuts.items()
    }


@cache
def graph() -> MotionGraph:
    entries = [(GraphClip(name, f"{name}.bvh", clip.duration), clip)
               for name, clip in clips().items()]  # fmt: skip
    return make_graph(entries, states={"up": StatePlace("stand", 0.5)})


def play_script(seed: int) -> None:
    """Read a damaged script and make its motion."""
    rng = np.random.default_rng(seed)
    text = damaged(SCRIPTS[seed % len(SCRIPTS)], rng)
    Synthesis(graph(), clips()).make(parse(text))


def play_graph(seed: int) -> None:
    """Read a damaged graph, search it, and make a motion with its clips."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "graph.yaml"
        write_graph(graph(), path)
        text = damaged_graph(path.read_text(), np.random.default_rng(seed))
        path.write_text(text, errors="replace")
        made = read_graph(path)
        best_paths(made, PathTask(made.names[-2:]), 2)
        Synthesis(made, clips()).make(parse(f'"{made.names[0]}" -> "{made.names[-1]}"'))


def outcome(play: Callable[[int], None], seed: int) -> str:
    """Taken or refused; raises AssertionError for an error of several lines, and for a hang."""
    begin = time.process_time()
    try:
        play(seed)
        found = "taken"
    except PoiseError as error:
        assert "\n" not in str(error), (seed, error)
        found = "refused"
    assert time.process_time() - begin < LIMIT, seed
    return found


def main(number: int = 2000) -> None:
    for name, play in (("scripts", play_script), ("graphs", play_graph)):
        counts = Counter(outcome(play, seed) for seed in range(number))
        print(f"{number} damaged {name}: {counts['taken']} taken, {counts['refused']} refused in "
              "one line, none otherwise", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:2]))
