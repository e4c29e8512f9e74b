"""Search in motion graphs: 1,000 random ones against brute force, and how long things take.

A plan of 20 actions on 50 clips, and the adjacency of 10 clips of 30 s at 30 Hz.

python -m tests.performance.motion_search [GRAPHS]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import GraphClip
from poise.baselines.motion.graphs.paths import PathTask
from poise.baselines.motion.graphs.search import best_paths
from poise.configs.errors import ConfigError
from tests.support.motion_graphs import check_search, random_graph

CLIPS, ACTIONS, REPEATS = 50, 20, 5
LONG_CLIPS, LONG = 10, 30.0  # [s]


def plan_times(share: float, k: int, seed: int = 0) -> tuple[int, list[float]]:
    """Transitions of a graph of 50 clips, and processor times [s] of plans of 20 actions."""
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, CLIPS, 2, share)
    task, times = PathTask(tuple(str(name) for name in rng.choice(graph.names, ACTIONS))), []
    for _ in range(REPEATS):
        begin = time.process_time()
        best_paths(graph, task, k)
        times.append(time.process_time() - begin)
    return len(graph.transitions), times


def adjacency_time() -> tuple[int, float]:
    """Transitions of 10 clips of 30 s, and the processor's time of finding them [s]."""
    names = packaged_clips()
    clips = []
    for i in range(LONG_CLIPS):
        own = read_bvh(find_bvh(names[i % len(names)])).clip.at_speed(0.8 + 0.05 * i)
        looped = own.closed(0.3).repeated(int(LONG // own.duration) + 1)
        clips.append(looped.resampled(1.0 / 30.0).cut(0.0, LONG))
    entries = [(GraphClip(f"c{i}", "", clip.duration), clip) for i, clip in enumerate(clips)]
    begin = time.process_time()
    graph = make_graph(entries)
    return len(graph.transitions), time.process_time() - begin


def main(graphs: int = 1000) -> None:
    counts = [check_search(seed) for seed in range(graphs)]
    without = counts.count(0)
    print(f"{graphs} graphs equal to brute force, of which {without} have no path")
    for share in (0.3, 0.6, 0.9):
        for k in (1, 3):
            try:
                transitions, times = plan_times(share, k)
            except ConfigError as error:
                print(f"  {share:g} of the pairs: {error}")
                continue
            print(f"  {CLIPS} clips, {transitions} transitions, {ACTIONS} actions, k = {k}: "
                  f"{1e3 * np.median(times):.0f} ms")  # fmt: skip
    found, seconds = adjacency_time()
    print(f"  adjacency of {LONG_CLIPS} clips of {LONG:g} s: {found} transitions, {seconds:.1f} s")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:2]))
