"""Transitions between all pairs of frames of two clips, by the coefficient of a cubic join."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.ndimage import minimum_filter

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import inverse, log, multiply
from poise.baselines.motion.graphs.joining.coefficient import best_duration
from poise.baselines.motion.graphs.joining.states import minus
from poise.configs.errors import ConfigError

from .frames import Frames, frames_of
from .motion_graph import (
    GraphClip,
    MotionGraph,
    StatePlace,
    Thresholds,
    Transition,
    Weight,
    earliest_part,
    latest_part,
    transition_order,
)

DURATIONS = 8  # that are tried where all pairs of frames are
WHOLE = 2  # frames at either end of a clip in which it is neither left nor entered
MOST_REFUSED = 40  # pairs that are tried before two clips are given up
SAME = 1.0  # [s] by which a clip must jump in itself


def transitions_between(
    before: Frames, after: Frames, thresholds: Thresholds
) -> tuple[list[Transition], str]:
    """The transitions from one clip to another, and why there is none if there is none.

    K and its best duration are looked at for all pairs of frames at once, rotations as vectors
    about a common posture. The pair of end and begin, the best ones that play both clips nearly
    whole, and the local minima of K + λD over `apart` [s] are then computed exactly, and kept if
    the thresholds allow.
    """
    prices = _prices(before, after, thresholds)
    prices[~_possible(before, after, thresholds)] = np.inf
    minima = _minima(prices, before.times, after.times, thresholds.apart)
    whole = _whole_minima(prices, before, after, thresholds.apart)[: thresholds.each // 2]
    ranked = [(len(before.times) - 1, 0), *whole, *sorted(minima, key=lambda pair: prices[pair])]
    pairs = dict.fromkeys(pair for pair in ranked if np.isfinite(prices[pair]))
    found: list[Transition] = []
    reasons: list[tuple[float, str]] = []
    for pair in pairs:
        if len(found) == thresholds.each or len(reasons) == MOST_REFUSED:
            break
        transition, reason = _exact(before, after, pair, thresholds)
        if reason:
            reasons.append((transition.coefficient, reason))
        else:
            found.append(transition)
    return found, "" if found else min(reasons, default=(0.0, "other feet are planted"))[1]


def _whole_minima(
    prices: np.ndarray, before: Frames, after: Frames, apart: float
) -> list[tuple[int, int]]:
    """The minima among pairs that leave the one clip late and enter the other one early."""
    late = int(np.searchsorted(before.times, latest_part(before.duration)))
    early = int(np.searchsorted(after.times, earliest_part(after.duration), side="right"))
    corner = prices[late:, :early]
    found = _minima(corner, before.times[late:], after.times[:early], apart)
    return [(late + i, j) for i, j in sorted(found, key=lambda pair: corner[pair])]


def end_to_begin(before: Frames, after: Frames, thresholds: Thresholds) -> Transition:
    """The transition from the last frame to the first one, whatever the thresholds say."""
    return _exact(before, after, (len(before.times) - 1, 0), thresholds)[0]


def make_graph(
    clips: Sequence[tuple[GraphClip, Clip]],
    thresholds: Thresholds | None = None,
    weights: Sequence[Weight] = (),
    states: dict[str, StatePlace] | None = None,
    robot: str = "",
) -> MotionGraph:
    """The graph of clips of one skeleton, with what an expert says of pairs.

    With a `robot` both feet count as planted in every frame.

    Raises ConfigError for clips of several skeletons, and for weights of unknown clips.
    """
    limits = thresholds or Thresholds()
    first = clips[0][1].skeleton
    for entry, clip in clips:
        if not first.same_as(clip.skeleton):
            raise ConfigError(f"has another skeleton than {clips[0][0].name!r}",
                              source=entry.name, field="clips")  # fmt: skip
    frames = {entry.name: frames_of(clip, planted=True if robot else None)._replace(name=entry.name)
              for entry, clip in clips}  # fmt: skip
    said = {(weight.before, weight.after): weight.weight for weight in weights}
    transitions, refused = _compared(product(frames, frames), frames, limits, said)
    try:
        return MotionGraph(robot, limits, tuple(entry for entry, _ in clips), states or {},
                           tuple(weights), tuple(transitions), tuple(refused))  # fmt: skip
    except ValueError as error:
        raise ConfigError(str(error), source="graph") from None


def with_clip(graph: MotionGraph, entry: GraphClip, frames: dict[str, Frames]) -> MotionGraph:
    """The graph with one more clip, of which `frames` has the frames as of all others."""
    own = entry.name
    pairs = [pair for name in graph.names for pair in ((name, own), (own, name))]
    transitions, refused = _compared([*pairs, (own, own)], frames, graph.thresholds, {})
    transitions = sorted([*graph.transitions, *transitions], key=transition_order)
    return replace(graph, clips=(*graph.clips, entry), transitions=tuple(transitions),
                   refused=(*graph.refused, *refused))  # fmt: skip


def _compared(
    pairs: Iterable[tuple[str, str]], frames: Mapping[str, Frames], thresholds: Thresholds,
    said: Mapping[tuple[str, str], float | None],
) -> tuple[list[Transition], list[tuple[str, str, str]]]:  # fmt: skip
    """The transitions of pairs of clips, and why others have none; `said` is of an expert."""
    transitions: list[Transition] = []
    refused: list[tuple[str, str, str]] = []
    for a, b in pairs:
        if (a, b) in said and said[a, b] is None:
            refused.append((a, b, "never, by the expert's weights"))
            continue
        found, reason = transitions_between(frames[a], frames[b], thresholds)
        if not found and (a, b) in said:
            found = [end_to_begin(frames[a], frames[b], thresholds)]
        transitions += found
        refused += [] if found else [(a, b, reason)]
    return transitions, refused


def _prices(before: Frames, after: Frames, thresholds: Thresholds) -> np.ndarray:
    """(n, m) least K + λD over a few durations, rotations as vectors about a common posture."""
    middle = after.rotations[0]
    masses = np.sqrt(before.masses)
    xa, xb = (_chart(frames, middle) * masses for frames in (before, after))
    va, vb = before.rates * masses, after.rates * masses
    change = _square(va)[:, None] + _square(vb) - 2.0 * va @ vb.T
    va, vb = va.copy(), vb.copy()
    va[:, :2] = vb[:, :2] = 0.0  # over the ground B is put where A would be
    gap = _square(xa)[:, None] + _square(xb) - 2.0 * xa @ xb.T
    along = 0.5 * (va @ xb.T + (xb * vb).sum(1) - (xa * va).sum(1)[:, None] - xa @ vb.T)
    mean = 0.25 * (_square(va)[:, None] + _square(vb) + 2.0 * va @ vb.T)
    # K in powers of 1/D: 12 g/D³ − 24 a/D² + (12 m + c)/D, with no array made twice
    gap *= 12.0
    along *= -24.0
    mean *= 12.0
    mean += change
    best, price = np.full(gap.shape, np.inf), np.empty(gap.shape)
    for d in np.geomspace(thresholds.least, thresholds.most, DURATIONS):
        np.multiply(gap, 1.0 / d, out=price)
        for part in (along, mean):
            price += part
            price *= 1.0 / d
        price += thresholds.time_price * d
        np.minimum(best, price, out=best)
    return best


def _square(rows: np.ndarray) -> np.ndarray:
    return np.asarray((rows**2).sum(axis=1))


def _chart(frames: Frames, middle: np.ndarray) -> np.ndarray:
    """(n, 3 + 3J) tangents from a posture to each frame's."""
    turns = log(multiply(inverse(middle), frames.rotations))
    return np.concatenate([frames.heights, turns.reshape(len(turns), -1)], axis=1)


def _possible(before: Frames, after: Frames, thresholds: Thresholds) -> np.ndarray:
    """(n, m) whether the same feet are planted, not at the very ends, and not in one place."""
    possible = np.ones((len(before.times), len(after.times)), bool)
    possible[:WHOLE] = False
    possible[:, -WHOLE:] = False
    if thresholds.contacts and before.planted is not None and after.planted is not None:
        possible &= (before.planted[:, None] == after.planted).all(axis=2)
    for home, across in ((before.home, np.s_[:, None]), (after.home, np.s_[None])):
        if home is not None:
            possible &= home[across]
    if before.name == after.name:
        apart = np.abs(before.times[:, None] - after.times) >= SAME
        apart[-1, 0] = True
        possible &= apart
    return possible


def _minima(
    prices: np.ndarray, leave: np.ndarray, enter: np.ndarray, apart: float
) -> list[tuple[int, int]]:
    """Pairs of frames whose price is the least within `apart` [s] on both sides, in both clips."""
    reach = [2 * int(apart / float(times[1] - times[0])) + 1 if len(times) > 1 else 1
             for times in (leave, enter)]  # fmt: skip
    least = minimum_filter(prices, size=tuple(reach), mode="constant", cval=np.inf)
    rows, columns = np.nonzero((prices == least) & np.isfinite(prices))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True)]


def _exact(
    before: Frames, after: Frames, pair: tuple[int, int], thresholds: Thresholds
) -> tuple[Transition, str]:
    """The transition of a pair of frames, and why it is refused, if it is."""
    i, j = pair
    gap = minus(after.heights[j], after.rotations[j], before.heights[i], before.rotations[i])
    ra, rb = before.rates[i].copy(), after.rates[j].copy()
    half = 0.5 * (rb[:2] - ra[:2])
    ra[:2], rb[:2] = -half, half  # only their difference over the ground is to be bent
    price = best_duration(gap, ra, rb, before.masses, thresholds.least, thresholds.most,
                          thresholds.time_price)  # fmt: skip
    made = Transition(before.name, after.name, float(before.times[i]), float(after.times[j]),
                      float(price.duration), max(float(price.coefficient), 0.0))  # fmt: skip
    angles = np.degrees(np.linalg.norm(gap[3:].reshape(-1, 3), axis=1))
    worst = int(np.argmax(angles))
    if price.coefficient > thresholds.coefficient:
        return made, f"K = {price.coefficient:.3g} > {thresholds.coefficient:g}"
    if angles[worst] > thresholds.angle:
        return made, f"{before.joints[worst]} turns by {angles[worst]:.0f}° > {thresholds.angle:g}°"
    return made, ""
