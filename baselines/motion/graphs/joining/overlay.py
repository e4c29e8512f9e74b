"""Overlay: other clips over parts of a base clip, by link groups, as Semakin's `|` [Semakin04]."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.link_groups import GROUPS, LinkGroup
from poise.baselines.motion.clips.rotations import IDENTITY, inverse, multiply, slerp
from poise.configs.errors import ConfigError
from poise.configs.problems import out_of_range
from poise.envs.compiled.maths.easing import ease

BLEND = 0.3  # [s] in which a layer comes and goes


@dataclass(frozen=True, eq=False)
class Layer:
    """A clip that plays over a base, in some of its joints.

    Attributes:
        clip: of the base's skeleton.
        groups: the joints, all that one of these selects; none for all but root and legs.
        weight: share of the layer, from 0 to 1; None for 1 where no other layer has the joint.
        start: when it begins, in the base's time [s].
        blend: in which it comes, and goes [s].
        additive: what the clip does relative to its first frame is added to the base.
    """

    clip: Clip
    groups: tuple[LinkGroup, ...] = ()
    weight: float | None = None
    start: float = 0.0
    blend: float = BLEND
    additive: bool = False

    def joints(self) -> np.ndarray:
        """The joints (k,) that the layer moves: the base keeps its root and its legs.

        Raises ConfigError for groups that select the root or a leg.
        """
        skeleton = self.clip.skeleton
        kept = {0, *GROUPS["legs"].joints(skeleton).tolist()}
        if not self.groups:
            return np.array([j for j in range(len(skeleton.names)) if j not in kept])
        chosen = sorted({int(j) for group in self.groups for j in group.joints(skeleton)})
        if taken := kept.intersection(chosen):
            raise ConfigError(f"the base keeps its root and legs: {skeleton.names[min(taken)]!r}",
                              source=self.clip.name, field="on", choices=GROUPS)  # fmt: skip
        return np.array(chosen)


def overlay(base: Clip, layers: Sequence[Layer]) -> Clip:
    """The base with the layers over it, the first one lowest; it lasts as long as the base.

    Joint i is slerp(base_i, over_i(t − t₀), w e(t)), or base_i (over_i(0)⁻¹ over_i)^(w e) for an
    additive layer. e rises from 0 to 1 as α(u) = 10u³ − 15u⁴ + 6u⁵ over `blend` and falls so, too,
    to the end of the layer, or to that of the base where this is earlier.

    Raises:
        ConfigError: another skeleton; a weight, start or blend out of range; a joint that two
            layers without weights claim at a time.
    """
    for layer in layers:
        _check(base, layer)
    _check_claims(base, layers)
    rotations = base.rotations.copy()
    for layer in layers:
        joints, share = layer.joints(), _share(base, layer)
        over = layer.clip.sample(base.times - layer.start)[1][:, joints]
        below = rotations[:, joints]
        if layer.additive:
            change = multiply(inverse(layer.clip.rotations[0, joints]), over)
            part = slerp(np.broadcast_to(IDENTITY, change.shape), change, share[:, None])
            rotations[:, joints] = multiply(below, part)
        else:
            rotations[:, joints] = slerp(below, over, share[:, None])
    names = (base.name, *(layer.clip.name for layer in layers))
    return replace(base, name=" | ".join(names), rotations=rotations)


def _share(base: Clip, layer: Layer) -> np.ndarray:
    """(F,) w e(t), with t the base's times."""
    end = _end(base, layer)
    blend = min(layer.blend, 0.5 * (end - layer.start))
    inside = np.minimum(base.times - layer.start, end - base.times) / blend
    weight = 1.0 if layer.weight is None else layer.weight
    return np.asarray(weight * ease(np.clip(inside, 0.0, 1.0)))


def _end(base: Clip, layer: Layer) -> float:
    return min(layer.start + layer.clip.duration, base.duration)


def _check(base: Clip, layer: Layer) -> None:
    if not base.skeleton.same_as(layer.clip.skeleton):
        raise ConfigError(f"{layer.clip.name!r} has another skeleton than {base.name!r}",
                          field="overlay")  # fmt: skip
    if layer.weight is not None and not 0.0 <= layer.weight <= 1.0:
        raise out_of_range(layer.weight, field="overlay.weight", least=0, most=1, form="g")
    if not 0.0 <= layer.start < base.duration:
        raise ConfigError(f"must be within the base's {base.duration:g} s, not {layer.start:g}",
                          field="overlay.start")  # fmt: skip
    if not 0.0 < layer.blend < np.inf:
        raise out_of_range(layer.blend, field="overlay.blend", above=0, form="g")


def _check_claims(base: Clip, layers: Sequence[Layer]) -> None:
    """Raise ConfigError for a joint that two layers move at a time, one of them without weight."""
    names = base.skeleton.names
    for joint in range(len(names)):
        claims = [layer for layer in layers if joint in layer.joints()]
        claims.sort(key=lambda layer: layer.start)
        for first, second in pairwise(claims):
            met = second.start < _end(base, first)
            if met and (first.weight is None or second.weight is None):
                raise ConfigError(
                    f"{first.clip.name!r} and {second.clip.name!r} both move {names[joint]!r}: "
                    "give both a weight, or other joints", field="overlay", choices=GROUPS,
                )  # fmt: skip
