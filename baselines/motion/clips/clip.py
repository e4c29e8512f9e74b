"""A clip: a skeleton's motion as frames at one rate, and what changes it as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.problems import out_of_range
from poise.envs.compiled.maths.easing import ease

from .rotations import IDENTITY, about_z, heading_angle, inverse, multiply, rotate, slerp
from .skeleton import SIDES, Skeleton
from .support import Support

MIRROR = np.array([1.0, -1.0, 1.0])  # of places, in the plane of x and z
MIRROR_TURN = np.array([1.0, -1.0, 1.0, -1.0])  # of quaternions
SHORTEST = 2  # frames
MOST_FRAMES = 1_000_000


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames of a motion; z is up, in metres. Every operation returns another clip.

    Attributes:
        name: for tables and errors.
        skeleton: whose motion it is.
        dt: time between frames [s].
        root: (F, 3) places of the root [m].
        rotations: (F, J, 4) of the joints relative to their parents, scalar first.
        licence: under which the file may be used; empty if nothing is known.
        support: the contacts of a robot's motion with steps; None: not known, or no steps.
    """

    name: str
    skeleton: Skeleton
    dt: float
    root: np.ndarray
    rotations: np.ndarray
    licence: str = ""
    support: Support | None = None

    def __post_init__(self) -> None:
        if self.support is not None and len(self.support.home) != len(self.root):
            raise ValueError(f"{len(self.support.home)} rows of contacts, {len(self.root)} frames")
        for array in (self.root, self.rotations):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.root)

    @property
    def duration(self) -> float:
        """Time of the last frame [s]."""
        return (len(self) - 1) * self.dt

    @property
    def times(self) -> np.ndarray:
        """(F,) times of the frames [s]."""
        return np.arange(len(self)) * self.dt

    def supported(self) -> Support:
        """The contacts; without any known both soles, where the robot stands."""
        return Support.both(len(self)) if self.support is None else self.support

    def part(self, chosen: slice | np.ndarray) -> Clip:
        """Some of the frames."""
        support = None if self.support is None else self.support.at(chosen)
        return replace(self, root=self.root[chosen], rotations=self.rotations[chosen],
                       support=support)  # fmt: skip

    def places(self) -> np.ndarray:
        """(F, J, 3) places of all joints [m]."""
        return self.skeleton.global_pose(self.root, self.rotations)[0]

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Root (n, 3) and rotations (n, J, 4) at times (n,) [s], the ends held.

        Places are interpolated linearly, rotations by slerp.
        """
        frame = np.clip(np.asarray(times) / self.dt, 0.0, len(self) - 1)
        before = np.minimum(frame.astype(int), max(len(self) - 2, 0))
        after, u = np.minimum(before + 1, len(self) - 1), frame - before
        root = self.root[before] + u[:, None] * (self.root[after] - self.root[before])
        return root, slerp(self.rotations[before], self.rotations[after], u[:, None])

    def resampled(self, dt: float) -> Clip:
        """The clip with another time between frames [s], its end cut by less than one.

        Raises ConfigError where that is fewer than two frames, or more than a million.
        """
        count = self.duration / dt + 1e-9 + 1.0
        times = np.arange(_frames(count, self.name, "rate")) * dt
        root, rotations = self.sample(times)
        nearest = np.minimum(np.round(times / self.dt).astype(int), len(self) - 1)
        support = None if self.support is None else self.support.at(nearest)
        return replace(self, dt=dt, root=root, rotations=rotations, support=support)

    def cut(self, start: float, end: float) -> Clip:
        """What lies between two times [s], to the nearest frames.

        Raises:
            ConfigError: the times do not lie in the clip, or hold fewer than two frames.
        """
        within = -self.dt < start < end < self.duration + self.dt  # so they are finite
        first, last = (round(start / self.dt), round(end / self.dt)) if within else (0, 0)
        if not 0 <= first or not last < len(self) or last - first + 1 < SHORTEST:
            raise ConfigError(
                f"must be two times within 0 and {self.duration:.3f} s, in order, not "
                f"{start:g} and {end:g}", source=self.name, field="cut",
            )  # fmt: skip
        return self.part(slice(first, last + 1))

    def at_speed(self, factor: float) -> Clip:
        """The clip `factor` > 0 times as fast, at the same rate of frames.

        Raises ConfigError where that is fewer than two frames, or more than a million.
        """
        _frames(self.duration / _positive(factor, self.name, "speed") / self.dt + 1.0, self.name,
                "speed")  # fmt: skip
        return replace(self, dt=self.dt / factor).resampled(self.dt)

    def reversed(self) -> Clip:
        """The frames in the opposite order."""
        return self.part(slice(None, None, -1))

    def mirrored(self) -> Clip:
        """Left and right exchanged: the mirror image in the plane of x and z.

        The skeleton is mirrored as well, so that the image is exact for unequal sides too.

        Raises:
            ConfigError: the sides do not hang on the skeleton in the same way.
        """
        old, other = self.skeleton, self.skeleton.partners
        parents = [-1 if p < 0 else other[p] for p in old.parents]
        if any(old.parents[other[i]] != parent for i, parent in enumerate(parents)):
            raise ConfigError("left and right are not the same tree", source=self.name,
                              field="mirror", choices=old.names)  # fmt: skip
        ends = other[old.end_parents]
        skeleton = replace(old, offsets=old.offsets[other] * MIRROR, end_parents=ends,
                           end_offsets=old.end_offsets * MIRROR)  # fmt: skip
        rotations = self.rotations[:, other] * MIRROR_TURN
        support = None if self.support is None else self.support.mirrored()
        return replace(self, skeleton=skeleton, root=self.root * MIRROR, rotations=rotations,
                       support=support)  # fmt: skip

    def turned(self, angle: float) -> Clip:
        """The clip turned about the world's z axis by a finite `angle` [rad], else ConfigError."""
        if not np.isfinite(angle):
            raise ConfigError(f"must be finite, not {angle:g}", source=self.name, field="turn")
        turn, rotations = about_z(angle), self.rotations.copy()
        rotations[:, 0] = multiply(turn, rotations[:, 0])
        return replace(self, root=rotate(turn, self.root), rotations=rotations)

    def moved(self, by: np.ndarray) -> Clip:
        """The clip moved by a vector (3,) [m]."""
        return replace(self, root=self.root + np.asarray(by))

    def facing(self) -> np.ndarray:
        """(F,) heading [rad]: of the horizontal direction that is square to the line of the hips.

        Raises ConfigError if the skeleton's hips are not known by name.
        """
        places = self.places()
        left, right = (self.skeleton.joint(f"hip_{side}", self.name) for side in SIDES)
        across = places[:, left] - places[:, right]
        return heading_angle(np.cross(across, [0.0, 0.0, 1.0]))

    def faced(self) -> Clip:
        """The clip whose first frame faces x, with its root above the origin."""
        turned = self.turned(-float(self.facing()[0]))
        return turned.moved(-turned.root[0] * np.array([1.0, 1.0, 0.0]))

    def closed(self, blend: float) -> Clip:
        """The clip whose last frame is its first: what is missing is added over `blend` [s].

        The addition grows as α(u) = 10u³ − 15u⁴ + 6u⁵, so the rest of the clip stays as it is and
        the velocity has no jump where the addition begins.
        """
        begin = self.duration - min(_positive(blend, self.name, "blend"), self.duration)
        u = np.clip((self.times - begin) / (self.duration - begin), 0.0, 1.0)
        grown = ease(u)[:, None]
        root = self.root + grown * (self.root[0] - self.root[-1])
        gap = multiply(inverse(self.rotations[-1]), self.rotations[0])
        whole = np.broadcast_to(gap, self.rotations.shape)
        identity = np.broadcast_to(IDENTITY, whole.shape)
        rotations = multiply(self.rotations, slerp(identity, whole, grown))
        return replace(self, root=root, rotations=rotations)

    def repeated(self, count: int) -> Clip:
        """The clip `count` ≥ 1 times, each where and with the heading in which the last ended.

        The last frame of one is the first of the next, so a clip that is to have no jump is
        `closed` before, or ends as it begins.
        """
        if count < 1:
            raise out_of_range(count, source=self.name, field="loop", least=1)
        _frames(count * (len(self) - 1.0) + 1.0, self.name, "loop")
        parts, turned = [self], self.facing() if count > 1 else np.zeros(1)
        for _ in range(count - 1):
            following = self.turned(float(turned[-1] - turned[0]) * len(parts))
            step = (parts[-1].root[-1] - following.root[0]) * np.array([1.0, 1.0, 0.0])
            parts.append(following.moved(step))
        return together([parts[0], *(part.part(slice(1, None)) for part in parts[1:])])


def together(clips: Sequence[Clip]) -> Clip:
    """The frames of clips of one skeleton and rate, in order; all else is the first one's."""
    root, rotations = (np.concatenate([getattr(clip, name) for clip in clips])
                       for name in ("root", "rotations"))  # fmt: skip
    known = any(clip.support is not None for clip in clips)
    support = Support.together([clip.supported() for clip in clips]) if known else None
    return replace(clips[0], root=root, rotations=rotations, support=support)


def _frames(count: float, source: str, field: str) -> int:
    """The number of whole frames; raises ConfigError for too few, or more than can be kept."""
    if not SHORTEST <= count < MOST_FRAMES + 1:
        raise ConfigError(f"must give {SHORTEST} to {MOST_FRAMES} frames, not {count:.0f}",
                          source=source, field=field)  # fmt: skip
    return int(count)


def _positive(value: float, source: str, field: str) -> float:
    if not 0.0 < value < np.inf:
        raise out_of_range(value, source=source, field=field, above=0, form="g")
    return value
