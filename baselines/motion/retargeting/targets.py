"""Targets of a clip for any body: directions of its segments and the height of its pelvis."""

from typing import NamedTuple

import numpy as np
import scipy  # loads its parts when they are first asked for

from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import heading_angle
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease

from .limbs import Limbs

#: segment → from, to, and its weight
LINES = {
    "pelvis": ("hip_right", "hip_left", 1.0),
    "trunk": ("pelvis", "chest", 2.0),
    "shoulders": ("shoulder_right", "shoulder_left", 1.0),
    **{f"upper_arm_{s}": (f"shoulder_{s}", f"elbow_{s}", 1.0) for s in SIDES},
    **{f"forearm_{s}": (f"elbow_{s}", f"hand_{s}", 1.0) for s in SIDES},
}
ARMS = ("shoulders", *(f"{part}_{side}" for part in ("upper_arm", "forearm") for side in SIDES))
UPRIGHT = 0.9  # of the legs' length: least height of the hips of a person who stands
FEW = 8  # frames: a shorter clip cannot be smoothed


class BodyTargets(NamedTuple):
    """Targets of every frame; the soles stay where the robot stands.

    Attributes:
        directions: segment → (F, 3) unit vectors.
        height: (F,) of the middle of the hips above that of the ankles, over that of standing.
    """

    directions: dict[str, np.ndarray]
    height: np.ndarray

    def __len__(self) -> int:
        return len(self.height)


def clip_targets(
    clip: Clip, arms: bool, smooth: float, heading: float | None = None
) -> BodyTargets:
    """Targets of a clip at 30 frames a second, low-passed at `smooth` [Hz] both ways in time.

    The `heading` [rad], or the feet's mean direction at the start, becomes x. Heights are relative
    to the highest of the clip, or to 0.9 of the legs' length where it has no upright posture: so
    they are scaled by the lengths of the legs. Directions are of points, so T and A as rest poses
    make no difference.

    Raises:
        ConfigError: joints that are not known by name; fewer than 8 frames.
    """
    if clip.duration < (least := (FEW - 1) * RATE) - 1e-9:
        raise ConfigError(f"lasts {clip.duration:.2f} s, at least {least:.2f} s are needed",
                          source=clip.name)  # fmt: skip
    clip = clip.resampled(RATE)
    heading = _feet_heading(clip) if heading is None else heading
    points = _points(clip, clip.turned(-heading).places())
    height = (points["pelvis"] - points["feet"])[:, 2]
    upright = max(float(height.max()), UPRIGHT * clip.skeleton.leg_length)
    names = [name for name in LINES if arms or name not in ARMS]
    low_passed = {n: _unit(low_pass(_direction(n, points), smooth)) for n in names}
    return BodyTargets(low_passed, low_pass(height, smooth) / upright)


def standing_targets(limbs: Limbs) -> BodyTargets:
    """The targets, of one frame, that the robot meets in its standing posture."""
    names = [name for name in LINES if limbs.has_arms or name not in ARMS]
    return BodyTargets({n: _direction(n, limbs.standing)[None] for n in names}, np.ones(1))


def between_standing(clip: BodyTargets, standing: BodyTargets, lead: float) -> BodyTargets:
    """The clip's targets with ways from standing and back, each of `lead` [s].

    Ways follow α(u) = 10u³ − 15u⁴ + 6u⁵ on great circles.
    """
    u = np.arange(1, max(round(lead / RATE), 1)) * RATE / lead
    way = np.concatenate([[0.0], ease(u)])
    directions = {}
    for name, values in clip.directions.items():
        rest = standing.directions[name][0]
        begin = _circle(rest, values[0], way)
        directions[name] = np.concatenate([begin, values, _circle(rest, values[-1], way)[::-1]])
    begin, end = (1.0 + way * (height - 1.0) for height in clip.height[[0, -1]])
    return BodyTargets(directions, np.concatenate([begin, clip.height, end[::-1]]))


def _points(clip: Clip, places: np.ndarray) -> dict[str, np.ndarray]:
    """Role → (F, 3) of the clip, hands at the wrists."""
    roles = ("hip", "ankle", "shoulder", "elbow", "wrist")
    points = {
        f"{role if role != 'wrist' else 'hand'}_{side}": places[
            :, clip.skeleton.joint(f"{role}_{side}", clip.name)
        ]
        for role in roles
        for side in SIDES
    }
    for name, role in (("pelvis", "hip"), ("feet", "ankle"), ("chest", "shoulder")):
        points[name] = 0.5 * (points[f"{role}_left"] + points[f"{role}_right"])
    return points


def _feet_heading(clip: Clip) -> float:
    """Mean heading [rad] of both feet in the first frame; the hips' without toes."""
    roles, first = clip.skeleton.roles, clip.places()[0]
    if any(f"toe_{side}" not in roles for side in SIDES):
        return float(clip.facing()[0])
    feet = [_unit(first[roles[f"toe_{side}"]] - first[roles[f"ankle_{side}"]]) for side in SIDES]
    return float(heading_angle(feet[0] + feet[1]))


def low_pass(values: np.ndarray, cutoff: float) -> np.ndarray:
    """`values` (F, …) through a Butterworth filter of second order, forward and back."""
    if cutoff >= 0.5 / RATE:
        return values
    sections = scipy.signal.butter(2, cutoff, fs=1.0 / RATE, output="sos")
    return scipy.signal.sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, 15))


def _direction(segment: str, points: dict[str, np.ndarray]) -> np.ndarray:
    """Unit vectors (…, 3) along a segment between points (…, 3)."""
    first, second, _ = LINES[segment]
    return _unit(points[second] - points[first])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _circle(a: np.ndarray, b: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) from `a` towards `b` (3,) at fractions `u` (n,) of the angle.

    Between opposite ones, as of an arm that is raised over the head, the way leads through x, and
    between those along x through z.
    """
    across = b - (a @ b) * a
    if np.linalg.norm(across) < 1e-3:
        through = np.eye(3)[0 if abs(a[0]) < 0.9 else 2]
        across = through - (a @ through) * a
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b) * u[:, None]
    return np.cos(angle) * a + np.sin(angle) * _unit(across)
