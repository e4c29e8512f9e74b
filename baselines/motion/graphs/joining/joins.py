"""Five ways from one clip to the next are curves between postures; four of them need no robot.

`insert`, `cross_fade` and `capture` are those of Semakin's dissertation [Semakin04], made C²;
`inertial` is that of games. With headings aligned, a and b the states of clip A at its cut and of B
at its entry, D the duration, α(u) = 10u³ − 15u⁴ + 6u⁵.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from poise.baselines.motion.clips.clip import Clip, together
from poise.baselines.motion.clips.rotations import slerp
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease

from .states import State, minus, plus, quintic_rise, state_at, turned_rate, vector_rate

SHORTEST = 2  # frames of a transition


def insert(before: Clip, after: Clip, duration: float, order: int = 3) -> Clip:
    """A, then a Exp(H(s)) for `duration` [s], then B: lasts T_A + D + T_B.

    H is the Hermite curve from 0 to b ⊖ a whose end rates are those of a and b: cubic and C¹
    (`order` 3), or of the fifth order, with their accelerations, and C² (5).
    """
    after, count = _prepared(before, after, duration, "insert")
    a, b = state_at(before, len(before) - 1), state_at(after, 0)
    duration = count * before.dt
    advance = 0.5 * (a.rate[:2] + b.rate[:2]) * duration
    after = after.moved(np.append(a.root[:2] + advance - b.root[:2], 0.0))
    times = np.arange(1, count) * before.dt
    middle = hermite(a, state_at(after, 0), duration, times, order)
    return _joined(before, len(before), [middle], after, 0)


def hermite(
    a: State, b: State, duration: float, times: np.ndarray, order: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Postures (n, 3), (n, J, 4) of the Hermite curve between two states, at times [s].

    The curve is a Exp(H(s)), s = t/D, with H(1) = Δ = b ⊖ a and D⁻¹ H'(1) = J_r(Δ)⁻¹ v_b. With
    `order` 5 the second derivatives at the ends are those that the accelerations ask for.
    """
    curve = hermite_curve(a, b, duration, order)
    s = (np.asarray(times) / duration)[:, None]
    tangent = np.sum([c * s**k for k, c in enumerate(curve)], axis=0)
    return plus(a.root, a.rotations, tangent)


def hermite_curve(a: State, b: State, duration: float, order: int = 3) -> np.ndarray:
    """(order + 1, 3 + 3J) coefficients of H(s), lowest power first."""
    if order not in (3, 5):
        raise ConfigError(f"must be 3 or 5, not {order}", field="order", choices=(3, 5))
    gap = minus(b.root, b.rotations, a.root, a.rotations)
    start, end = duration * a.rate, duration * _vector_rates(gap, b.rate)
    if order == 3:
        zero = np.zeros_like(gap)
        return np.array([zero, start, 3.0 * gap - 2.0 * start - end, start + end - 2.0 * gap])
    # where H is no small angle the second derivative differs from the acceleration by the rate of
    # J_r, which is taken by a difference along the way
    ahead = 1e-4 * duration
    later = _vector_rates(gap + ahead * end / duration, b.rate + ahead * b.acceleration)
    bend_a = duration**2 * a.acceleration
    bend_b = duration * (duration * later - end) / ahead
    return quintic_rise(gap, start, end, bend_a, bend_b)


def cross_fade(before: Clip, after: Clip, duration: float, weight: str = "smooth") -> Clip:
    """The end of A fades into the begin of B over `duration` [s]: lasts T_A + T_B − D.

    q(t) = slerp(q_A(t), q_B(t − t_b), w(t)), with w = α(u), or w = u (`weight` linear), which is
    [Semakin04]'s and whose rate jumps by Δ/D.
    """
    after, count = _prepared(before, after, duration, "cross")
    if count >= min(len(before), len(after)):
        raise ConfigError(f"lasts {duration:g} s, longer than a clip", field="cross")
    if weight not in ("smooth", "linear"):
        raise ConfigError(f"no such weight: {weight}", field="cross", choices=("smooth", "linear"))
    after = _placed(after, before.root[-count - 1])
    u = np.arange(count + 1) / count
    w = u if weight == "linear" else ease(u)
    tail, head = slice(len(before) - count - 1, None), slice(0, count + 1)
    root = before.root[tail] + w[:, None] * (after.root[head] - before.root[tail])
    rotations = slerp(before.rotations[tail], after.rotations[head], w[:, None])
    return _joined(before, tail.start, [(root, rotations)], after, head.stop)


def capture(before: Clip, after: Clip, duration: float) -> Clip:
    """The end of A and the begin of B bend towards each other: lasts T_A + T_B.

    Both meet in slerp(a, b, ½) with the mean rate and acceleration. A is A(t) Exp(o(t)), o a curve
    of the fifth order that is 0, at rest, `duration`/2 before the seam; B is treated the same way.
    """
    after, count = _prepared(before, after, 0.5 * duration, "capture")
    if count >= min(len(before), len(after)):
        raise ConfigError(f"lasts {duration:g} s, longer than two clips", field="capture")
    after = _placed(after, before.root[-1])
    a, b = state_at(before, len(before) - 1), state_at(after, 0)
    gap = minus(b.root, b.rotations, a.root, a.rotations)
    rate, bend = 0.5 * (a.rate + b.rate), 0.5 * (a.acceleration + b.acceleration)
    u, span = np.arange(count + 1) / count, count * before.dt
    to_seam = _offset(0.5 * gap, rate, bend, a, span, u)
    tail = slice(len(before) - count - 1, None)
    bent_a = plus(before.root[tail], before.rotations[tail], to_seam)
    backwards = State(b.root, b.rotations, -b.rate, b.acceleration)
    from_seam = _offset(-0.5 * gap, -rate, bend, backwards, span, u)[::-1]
    head = slice(0, count + 1)
    bent_b = plus(after.root[head], after.rotations[head], from_seam)
    seam_once = bent_b[0][1:], bent_b[1][1:]
    return _joined(before, tail.start, [bent_a, seam_once], after, head.stop)


def inertial(before: Clip, after: Clip, half_life: float, *, faced: bool = True) -> Clip:
    """B from its begin, with what A differs from it dying away: lasts T_A + T_B.

    B is turned to face as A does at its end, or with `faced` False keeps its heading.

    B(t) Exp(o(t)) with o(0) = a ⊖ b at the rate of their difference, and o a critically damped
    spring: y = 2 ln 2/h, j = ȯ₀ + y o₀, o = e^(−yt)(o₀ + j t). C¹.
    """
    given = after
    after, _ = _prepared(before, after, half_life, "inertial")
    after = after if faced else given.resampled(before.dt)
    after = _placed(after, before.root[-1])
    a, b = state_at(before, len(before) - 1), state_at(after, 0)
    gap = minus(a.root, a.rotations, b.root, b.rotations)
    rate = _offset_rate(gap, a.rate, b.rate)
    y, times = 2.0 * np.log(2.0) / half_life, after.times[:, None]
    offset = np.exp(-y * times) * (gap + (rate + y * gap) * times)
    bent = plus(after.root, after.rotations, offset)
    return _joined(before, len(before) - 1, [bent], after, len(after))


#: kind → join of two clips and a duration [s]
JOINS: dict[str, Callable[[Clip, Clip, float], Clip]] = {
    "insert": insert,
    "cross": cross_fade,
    "capture": capture,
    "inertial": inertial,
}


def faced_like(clip: Clip, other: Clip) -> Clip:
    """The clip turned so that it begins with the heading in which another one ends."""
    return clip.turned(float(other.facing()[-1] - clip.facing()[0]))


def laid_on(before: Clip, after: Clip) -> Clip:
    """A and then B, turned and moved so that its first frame is A's last one: that frame once.

    What is left of a difference between the two postures is a step between two frames.
    """
    after = _placed(faced_like(after, before), before.root[-1])
    return together([before, after.part(slice(1, None))])


def ends(before: Clip, after: Clip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Δ, v_a and v_b (3 + 3J,) of A's end and B's begin, headings and places over the ground alike.

    Raises ConfigError for two skeletons.
    """
    after, _ = _prepared(before, after, SHORTEST * before.dt, "join")
    a, b = state_at(before, len(before) - 1), state_at(_placed(after, before.root[-1]), 0)
    return minus(b.root, b.rotations, a.root, a.rotations), a.rate, b.rate


def _prepared(before: Clip, after: Clip, duration: float, kind: str) -> tuple[Clip, int]:
    """B at A's rate, facing as A does at its end, and the frames of a duration.

    Raises ConfigError for two skeletons, and for a duration of fewer than 2 frames.
    """
    if not before.skeleton.same_as(after.skeleton):
        raise ConfigError(f"{after.name!r} has another skeleton than {before.name!r}", field=kind)
    count = round(duration / before.dt)
    if count < SHORTEST:
        raise ConfigError(f"must last {SHORTEST} frames, {SHORTEST * before.dt:.3g} s, or longer, "
                          f"not {duration:g} s", field=kind)  # fmt: skip
    after = after if after.dt == before.dt else after.resampled(before.dt)
    return faced_like(after, before), count


def _placed(clip: Clip, place: np.ndarray) -> Clip:
    """The clip moved so that its root begins over a place."""
    return clip.moved((place - clip.root[0]) * np.array([1.0, 1.0, 0.0]))


def _joined(
    before: Clip, kept: int, between: list[tuple[np.ndarray, np.ndarray]], after: Clip, first: int
) -> Clip:
    """The first frames of A, postures (n, 3), (n, J, 4) between, and B from a frame on."""
    parts = [(before.root[:kept], before.rotations[:kept]), *between,
             (after.root[first:], after.rotations[first:])]  # fmt: skip
    root, rotations = (np.concatenate([part[i] for part in parts]) for i in range(2))
    return replace(before, root=root, rotations=rotations, support=None)


def _vector_rates(gap: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Tangents' rates for which the posture at the end of `gap` has a rate (3 + 3J,)."""
    turns = vector_rate(gap[3:].reshape(-1, 3), rate[3:].reshape(-1, 3))
    return np.concatenate([rate[:3], turns.ravel()])


def _offset_rate(offset: np.ndarray, wanted: np.ndarray, own: np.ndarray) -> np.ndarray:
    """ȯ for which q Exp(o) has a wanted rate, q having its own: J_r(o)⁻¹ (ω* − Exp(−o) ω)."""
    turns = offset[3:].reshape(-1, 3)
    between = wanted[3:].reshape(-1, 3) - turned_rate(turns, own[3:].reshape(-1, 3))
    return np.concatenate([wanted[:3] - own[:3], vector_rate(turns, between).ravel()])


def _offset(
    end: np.ndarray, rate: np.ndarray, bend: np.ndarray, own: State, span: float, u: np.ndarray
) -> np.ndarray:
    """(n, 3 + 3J) offsets from 0, at rest, to `end` with the seam's rate and acceleration."""
    speed, rest = span * _offset_rate(end, rate, own.rate), np.zeros_like(end)
    bent = span**2 * (bend - own.acceleration)
    c3, c4, c5 = quintic_rise(end, rest, speed, rest, bent)[3:]
    s = u[:, None]
    return s**3 * (c3 + s * (c4 + s * c5))
