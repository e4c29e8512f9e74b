"""Motion matching on 10,000 frames: `python -m tests.performance.matching`.

The packaged clips of one skeleton at 18 speeds. Printed: how many of 2,000 queries give another
frame than a search of all of them, and the processor's time of a query.
"""

from __future__ import annotations

import time

import numpy as np

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.player import PlayerCommand

QUERIES = 2_000


def database() -> MatchingDatabase:
    """All packaged clips at speeds of 0.5 to 1.5."""
    names = packaged_clips()
    clips = [read_bvh(find_bvh(name)).clip for name in names]
    return MatchingDatabase([clip.at_speed(s) for clip in clips for s in np.linspace(0.4, 1.5, 18)])


def main() -> None:
    frames, rng = database(), np.random.default_rng(0)
    points, times, wrong = frames.values[frames.entries], [], 0
    frames.nearest(points[0])
    for _ in range(QUERIES):
        at = frames.match_at(int(rng.integers(len(frames.values))), 0.0)
        command = PlayerCommand(
            rng.uniform(-0.5, 1.5), rng.uniform(-0.3, 0.3), rng.uniform(-1.0, 1.0)
        )
        query = frames.query(at.clip, at.frame, command.future(frames.ahead))
        begin = time.thread_time()
        found = frames.nearest(query)
        times.append(time.thread_time() - begin)
        wrong += found.distance > np.linalg.norm(points - query, axis=1).min() + 1e-9
    median, late = 1e6 * np.percentile(times, [50, 95])
    print(f"{len(points)} frames, {points.shape[1]} features: {wrong} of {QUERIES} queries not the "
          f"nearest; {median:.0f} µs a query, 95 % below {late:.0f} µs")  # fmt: skip


if __name__ == "__main__":
    main()
