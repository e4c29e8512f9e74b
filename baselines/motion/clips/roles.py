"""Roles of joints, such as the left knee: by the names that programs give them, and where names
say nothing, by the shape of the skeleton alone."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

SIDES = ("left", "right")
#: role of a joint on either side → names that files have for it, the most certain one first
SIDED = {
    "hip": ("upleg", "upperleg", "upperleg01", "thigh", "thighbend", "thighstretch", "legupper",
            "femur", "hip", "hipjoint", "足"),
    "knee": ("leg", "lowerleg", "lowerleg01", "lowleg", "loleg", "leglower", "shin", "calf",
             "legstretch", "tibia", "knee", "ひざ"),
    "ankle": ("ankle", "foot", "talus", "足首"),  # where a file has both, its foot is the ball
    "toe": ("toebase", "toes", "toes01", "toe", "toe0", "toe11", "bigtoe", "ball", "ballfoot",
            "foot", "つま先"),
    "shoulder": ("arm", "upperarm", "upperarm01", "uparm", "uarm", "armupper", "armstretch",
                 "humerus", "shldr", "shldrbend", "shoulder", "腕"),
    "elbow": ("forearm", "lowerarm", "lowerarm01", "lowarm", "loarm", "farm", "armlower",
              "forearmbend", "forearmstretch", "radius", "ulna", "elbow", "ひじ"),
    "wrist": ("wrist", "hand", "手首"),
}  # fmt: skip
MIDDLE = {
    "head": ("head", "1head", "skull", "頭"),  # 1head: of jC1Head
    "neck": ("neck", "neck1", "neck01", "lowerneck", "necklower", "necktwist01", "首"),
}
ROLES = (*(f"{role}_{side}" for role in SIDED for side in SIDES), *MIDDLE)
LETTERS = {"left": "left", "right": "right", "l": "left", "r": "right", "左": "left", "右": "right"}
CENTRE = ("c", "m", "x")  # of joints that are on no side
COMMON = 0.6  # of the names that share a first or a last word, which then says nothing
ALIKE = 0.03  # of a length: between bones that mirror each other
LEG, ARM = ("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist")
CERTAIN = 0.8  # of the frames in which the feet must point to the same side
_BRACKETS = re.compile(r"\[.*?\]|\(.*?\)")
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|左|右|[^\W\d_a-zA-Z左右]+")
_WHOLE = frozenset(word for words in SIDED.values() for word in words)


def find_roles(names: Sequence[str]) -> dict[str, int]:
    """Role → index among `names`; of several names for a role the most certain one wins.

    What a prefix or a suffix of all names says does not count (``mixamorig:LeftUpLeg``,
    ``DEF-thigh.L``, ``Bip01 L Thigh``, ``left_leg_joint``); a side is a word of its own, before or
    after the rest, or a first letter (``rfemur``).
    """
    exact: dict[tuple[str, str], int] = {}
    bare: dict[tuple[str, str], int] = {}  # without a number behind it: head1, leftarm09
    found_sides = sided(names)
    for i in sorted(range(len(names)), key=lambda i: (not names[i].startswith("_"), -i)):
        base, side = found_sides[i]  # __UpLeg_L is a helper of UpLeg_L: it counts least
        exact[base, side] = bare[base.rstrip("0123456789"), side] = i
    found: dict[str, int] = {}
    for role, words in SIDED.items():
        for side in SIDES:
            taken = found.get(f"ankle_{side}")
            hits = [known[word, side] for known in (exact, bare) for word in words
                    if (word, side) in known]  # fmt: skip
            if free := [hit for hit in hits if hit != taken]:
                found[f"{role}_{side}"] = free[0]
    for role, words in MIDDLE.items():
        hits = [known[word, ""] for known in (exact, bare) for word in words
                if (word, "") in known]  # fmt: skip
        if hits:
            found[role] = hits[0]
    return found


def sided(names: Sequence[str]) -> list[tuple[str, str]]:
    """(base, side) of each name: ``mixamorig:LeftArm`` is (arm, left), ``Neck`` (neck, "")."""
    words = [_words(name) for name in names]
    words = _without_common(words, 0)
    words = _without_common(words, -1)
    found = [_base(each) for each in words]
    plain = {base for base, side in found if not side}
    for i, (base, side) in enumerate(found):
        opposite = {"l": "r", "r": "l"}.get(base[:1], "") + base[1:]
        if not side and base[1:] and opposite != base[1:] and opposite in plain:
            found[i] = base[1:], LETTERS[base[0]]  # lfingers, where there are rfingers
    return found


def _words(name: str) -> list[str]:
    """The words of a name, in small letters: at capitals, digits and signs."""
    own = _BRACKETS.sub("", name).rpartition(":")[2].rpartition("|")[2]
    return [word.lower() for word in _WORDS.findall(own)] or [own.lower()]


def _without_common(words: list[list[str]], place: int) -> list[list[str]]:
    """The words of all names without the first (0) or last (−1) ones that most share."""
    while len(words) > 3:
        counts = Counter(each[place] for each in words if len(each) > 1)
        word, count = counts.most_common(1)[0] if counts else ("", 0)
        if count < COMMON * len(words) or word in LETTERS:
            return words
        rest = slice(1, None) if place == 0 else slice(None, -1)
        words = [each[rest] if each[place] == word and len(each) > 1 else each for each in words]
    return words


def _base(words: list[str]) -> tuple[str, str]:
    """Return a name without its side: what follows it, or else what precedes it."""
    places = [i for i, word in enumerate(words) if word in LETTERS]
    if places and len(words) > 1:
        i = places[0]
        after, before = words[i + 1 :], words[:i]
        base = "".join(after or before)
        if not after or "".join([*before, *after]) in _WHOLE or base.isdigit():
            base = "".join([*before, *after])
        return base, LETTERS[words[i]]
    base = "".join(word for word in words if word not in CENTRE) or "".join(words)
    if base[:1] in ("l", "r") and base[1:] in _WHOLE and base not in _WHOLE:
        return base[1:], LETTERS[base[0]]  # lfemur
    return base, ""


def structural_roles(
    parents: np.ndarray,
    offsets: np.ndarray,
    end_parents: np.ndarray,
    places: np.ndarray,
    ends: np.ndarray,
) -> dict[str, int]:
    """Role → joint, of what is sure; else none.

    Limbs are pairs of chains of equal bones on one joint. The legs are the pair nearest to the
    root, the arms the next one; thigh and shank, upper arm and forearm are a chain's two longest
    neighbours. The feet point forward, which tells left from right.

    Args:
        parents: (J,) of the joints.
        offsets: (J, 3) from the parents.
        end_parents: (E,) joints of the end sites.
        places: (F, J, 3) of the joints in some frames.
        ends: (F, E, 3) of the end sites.
    """
    depth = np.zeros(len(parents), int)
    for joint in range(1, len(parents)):  # parents come first
        depth[joint] = depth[parents[joint]] + 1
    limbs = sorted(_limbs(parents, offsets), key=lambda pair: depth[pair[0][0]])
    if not limbs:
        return {}
    found = [_bones(chain, offsets, len(LEG)) for chain in limbs[0]]
    ahead = [_ahead(bones, places, end_parents, ends) for bones in found]
    hips, ankles = places[:, [b[0] for b in found]], places[:, [b[2] for b in found]]
    up = (hips - ankles).mean(axis=1)
    left = np.cross(up, ahead[0] + ahead[1])
    signs = np.einsum("fi,fi->f", left, hips[:, 0] - hips[:, 1])
    share = float(np.mean(signs > 0.0))
    if max(share, 1.0 - share) < CERTAIN or np.abs(signs).max() < 1e-12:
        return {}
    sides = SIDES if share > 0.5 else SIDES[::-1]
    roles = {f"{role}_{side}": joint for side, bones in zip(sides, found, strict=True)
             for role, joint in zip(LEG, bones, strict=False)}  # fmt: skip
    return {**roles, **_arms(limbs[1:], offsets, places, hips, sides)}


def _arms(
    limbs: list[tuple[list[int], list[int]]], offsets: np.ndarray, places: np.ndarray,
    hips: np.ndarray, sides: tuple[str, ...],
) -> dict[str, int]:  # fmt: skip
    """The arms are on the sides on which the hips are."""
    if not limbs:
        return {}
    found = [_bones(chain, offsets, len(ARM)) for chain in limbs[0]]
    across = places[:, found[0][0]] - places[:, found[1][0]]
    same = np.einsum("fi,fi->f", across, hips[:, 0] - hips[:, 1]).sum() > 0.0
    return {f"{role}_{side}": joint
            for side, bones in zip(sides if same else sides[::-1], found, strict=True)
            for role, joint in zip(ARM, bones, strict=False)}  # fmt: skip


def _limbs(parents: np.ndarray, offsets: np.ndarray) -> Iterator[tuple[list[int], list[int]]]:
    """Pairs of chains of three or more joints, on one joint, whose bones are as long."""
    chains: dict[int, list[list[int]]] = {}
    for joint, parent in enumerate(parents):
        if parent >= 0:
            chains.setdefault(int(parent), []).append(_chain(joint, parents, offsets))
    for on_one in chains.values():
        long = [chain for chain in on_one if len(chain) >= len(ARM)]
        for i, first in enumerate(long):
            for second in long[i + 1 :]:
                if _mirrored(first, second, offsets):
                    yield first, second


def _chain(joint: int, parents: np.ndarray, offsets: np.ndarray) -> list[int]:
    """A joint and its way to the joint that is furthest from it along the bones."""
    children = [int(child) for child in np.flatnonzero(parents == joint)]
    ways = [_chain(child, parents, offsets) for child in children]
    lengths = [np.linalg.norm(offsets[way], axis=1).sum() for way in ways]
    return [joint, *(ways[int(np.argmax(lengths))] if ways else [])]


def _mirrored(first: list[int], second: list[int], offsets: np.ndarray) -> bool:
    if len(first) != len(second):
        return False
    one, other = (np.linalg.norm(offsets[chain], axis=1) for chain in (first, second))
    return bool(np.abs(one - other).max() <= ALIKE * one.max())


def _bones(chain: list[int], offsets: np.ndarray, count: int) -> list[int]:
    """Up to `count` joints, the first of which has the longest two bones of the chain after it."""
    lengths = np.linalg.norm(offsets[chain[1:]], axis=1)
    first = int(np.argmax(lengths[:-1] + lengths[1:]))
    return chain[first : first + count]


def _ahead(
    bones: list[int], places: np.ndarray, end_parents: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """(F, 3) from an ankle to its toe, or to the end of its foot."""
    if len(bones) > 3:
        return places[:, bones[3]] - places[:, bones[2]]
    tips = np.flatnonzero(end_parents == bones[2])
    if len(tips) == 0:
        return np.zeros_like(places[:, 0])
    return ends[:, tips].mean(axis=1) - places[:, bones[2]]
