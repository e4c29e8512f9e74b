"""Clips as points in the space of their features, and the exact search for the nearest."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.configs.errors import ConfigError
from poise.configs.problems import out_of_range

from .features import AHEAD, FUTURE, clip_features, feature_groups, steady_heading
from .search import NearestPoint

RATE = 1.0 / 30.0  # [s] between frames


class Match(NamedTuple):
    """A frame of a clip, and its distance from the query."""

    clip: int
    frame: int
    distance: float


class MatchingDatabase:
    """Frames of clips of one skeleton, each by its weighted, normalised features.

    A column is (value − mean) w/(σ √k), σ the mean standard deviation of the k columns of its
    group, so that groups of equal weight count alike. Frames less than the longest time ahead from
    the end of their clip are used, but are never matched.

    Args:
        clips: resampled to `RATE`.
        weights: group → w ≥ 0 instead of the default, see `features.groups`.

    Raises:
        ConfigError: no clips, clips of several skeletons or too short to be gone to, unknown
            groups, weights below 0.
    """

    def __init__(self, clips: Sequence[Clip], *, weights: Mapping[str, float] | None = None):
        self.clips, self.ahead = tuple(clip.resampled(RATE) for clip in clips), AHEAD
        _check_skeletons(self.clips)
        tables = [clip_features(clip) for clip in self.clips]
        self.headings = [steady_heading(clip) for clip in self.clips]  # (F,) of each [rad]
        raw = np.concatenate(tables)
        self.mean, self.scale = raw.mean(axis=0), _scales(raw, weights or {})
        self.starts = np.cumsum([0, *(len(table) for table in tables)])
        self.values = self.normalised(raw)
        last = round(max(AHEAD) / RATE)
        frames = [np.arange(a, b - last) for a, b in pairwise(self.starts)]
        self.entries = np.concatenate(frames)
        if not len(self.entries):
            raise ConfigError(f"no clip is longer than {max(AHEAD):g} s", field="clips")
        self.search = NearestPoint(self.values[self.entries])
        # where the frames that are gone to are after the longest time: x, y [m] and (cos, sin)
        self.reached = raw[self.entries, -sum(group.size for group in FUTURE) :]

    def normalised(self, features: np.ndarray) -> np.ndarray:
        """Features (…, n) as columns of the database."""
        return (features - self.mean) * self.scale

    def nearest(self, query: np.ndarray) -> Match:
        """The frame whose columns are nearest to `query` (n,), of all there are."""
        found, distance = self.search.find(query)
        return self.match_at(int(self.entries[found]), distance)

    def match_at(self, row: int, distance: float) -> Match:
        """The frame of a row of `values`."""
        clip = int(np.searchsorted(self.starts, row, side="right")) - 1
        return Match(clip, row - int(self.starts[clip]), distance)

    def nearest_way(self, future: np.ndarray) -> tuple[float, float, float]:
        """How far ahead and to the left [m] and by how much turned [rad] the frame goes whose place
        after the longest time is nearest to that of a `future` as `query` takes it."""
        goal = future[-self.reached.shape[1] :]
        gaps = np.linalg.norm(self.reached - goal, axis=1)  # 1 rad of turn counts as 1 m
        x, y, cos, sin = self.reached[int(np.argmin(gaps))]
        return float(x), float(y), float(np.arctan2(sin, cos))

    def query(self, clip: int, frame: int, future: np.ndarray) -> np.ndarray:
        """(n,) the posture of a frame with another future: for every time ahead x, y [m] and
        (cos, sin) of the turn, in its facing frame."""
        columns = self.values[self.starts[clip] + frame].copy()
        count = len(AHEAD) * sum(group.size for group in FUTURE)
        columns[-count:] = (future - self.mean[-count:]) * self.scale[-count:]
        return columns


def _scales(raw: np.ndarray, weights: Mapping[str, float]) -> np.ndarray:
    """(n,) w/σ of every column; a group that never changes counts nothing."""
    known = {group.name for group in feature_groups()}
    for name, weight in weights.items():
        if name not in known:
            raise ConfigError(f"no such features: {name!r}", field="weights", choices=sorted(known))
        if not 0.0 <= weight < np.inf:
            raise out_of_range(weight, field=f"weights.{name}", least=0, form="g")
    scales, begin = np.empty(raw.shape[1]), 0
    for group in feature_groups():
        columns = slice(begin, begin + group.size)
        deviation = float(raw[:, columns].std(axis=0).mean())
        weight = weights.get(group.name, group.weight)
        share = weight / np.sqrt(group.size)
        scales[columns] = share / deviation if deviation > 1e-9 else 0.0
        begin += group.size
    return scales


def _check_skeletons(clips: Sequence[Clip]) -> None:
    if not clips:
        raise ConfigError("at least one is needed", field="clips")
    for clip in clips[1:]:
        if not clips[0].skeleton.same_as(clip.skeleton):
            raise ConfigError(f"{clip.name!r} has another skeleton than {clips[0].name!r}",
                              field="clips")  # fmt: skip
