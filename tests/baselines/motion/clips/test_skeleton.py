"""Skeletons: roles by name in the families of names that files have; groups as rules."""

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.link_groups import GROUPS, LinkGroup
from poise.baselines.motion.clips.roles import ROLES, find_roles
from poise.baselines.motion.clips.skeleton import Skeleton
from tests.support.refused import invalid

FAMILIES = {
    "mixamo": ("mixamorig:{}UpLeg", "mixamorig:{}Leg", "mixamorig:{}Foot", "mixamorig:{}Arm"),
    "plain": ("{}Hip", "{}Knee", "{}Ankle", "{}Shoulder"),
    "smpl": ("{}_Hip", "{}_Knee", "{}_Ankle", "{}_Shoulder"),
    "blender": ("thigh.{}", "shin.{}", "foot.{}", "upper_arm.{}"),
}


@pytest.fixture(scope="module", params=["humanoid_stand", "humanoid_wave"])
def skeleton(request: pytest.FixtureRequest) -> Skeleton:
    return read_bvh(find_bvh(request.param)).clip.skeleton


def test_all_roles_of_the_packaged_skeletons_are_found(skeleton: Skeleton) -> None:
    assert set(ROLES) - {"neck"} <= set(skeleton.roles)  # the default humanoid has none
    assert len(set(skeleton.roles.values())) == len(skeleton.roles)
    rest = skeleton.rest
    for side, sign in (("left", 1.0), ("right", -1.0)):
        heights = [rest[skeleton.roles[f"{role}_{side}"], 2] for role in ("hip", "knee", "ankle")]
        assert heights == sorted(heights, reverse=True)
        assert sign * rest[skeleton.roles[f"elbow_{side}"], 1] > 0.15


@pytest.mark.parametrize("sides", [("Left", "Right"), ("L", "R")])
@pytest.mark.parametrize("family", FAMILIES)
def test_families_of_names(family: str, sides: tuple[str, str]) -> None:
    """Whatever else there is: a collar bone that is called a shoulder, a ball called a foot."""
    further = {"blender": "shoulder.{}", "smpl": "{}_Foot"}
    names = tuple(name.format(side) for side in sides for name in FAMILIES[family])
    if family in further:
        names += tuple(further[family].format(side) for side in sides)
    roles = find_roles(names)
    wanted = [f"{role}_{side}" for side in ("left", "right")
              for role in ("hip", "knee", "ankle", "shoulder")]  # fmt: skip
    assert [roles[role] for role in wanted] == list(range(8))


def test_names_after_a_point_and_a_bare_l() -> None:
    roles = find_roles(("root", "lowerback", "thigh.L", "shin.L", "foot.L", "rfemur", "LoLeg_R"))
    assert roles == {"hip_left": 2, "knee_left": 3, "ankle_left": 4, "hip_right": 5,
                     "knee_right": 6}  # fmt: skip


def test_kinematics_of_a_turned_joint() -> None:
    """A shank of 1 m, its knee turned by 90° about y, points forward and then up."""
    skeleton = Skeleton(("a", "b", "c"), np.array([-1, 0, 1]),
                        np.array([[9.0, 9, 9], [0, 0, -1], [0, 0, -1]]), np.array([2]),
                        np.array([[0.0, 0, -1]]), ("ZYX",) * 3)  # fmt: skip
    half = np.sqrt(0.5)
    turns = np.array([[[1.0, 0, 0, 0], [half, 0, -half, 0], [half, 0, -half, 0]]])
    places, axes = skeleton.global_pose(np.array([[0.0, 0, 2]]), turns)
    assert places[0] == pytest.approx(np.array([[0, 0, 2], [0, 0, 1], [1, 0, 1]]), abs=1e-12)
    assert skeleton.ends(places, axes)[0, 0] == pytest.approx([1, 0, 2], abs=1e-12)


def test_groups_are_rules_for_any_skeleton(skeleton: Skeleton) -> None:
    arm = GROUPS["left_arm"].joints(skeleton)
    assert skeleton.roles["wrist_left"] in arm and skeleton.roles["shoulder_right"] not in arm
    legs = GROUPS["legs"].joints(skeleton)
    assert {skeleton.roles["toe_left"], skeleton.roles["toe_right"]} <= set(legs)
    assert set(arm) & set(legs) == set()
    way = LinkGroup(between=("ankle_left", "ankle_right")).joints(skeleton)
    assert {skeleton.roles[f"{r}_{s}"] for r in ("hip", "knee", "ankle")
            for s in ("left", "right")} <= set(way)  # fmt: skip
    assert skeleton.roles["toe_left"] not in way
    both = LinkGroup(below=("shoulder_left",), exclude=("*hand*", "*thumb*", "*finger*"))
    assert set(both.joints(skeleton)) < set(arm)
    with invalid("group"):
        LinkGroup(include=("tail*",)).joints(skeleton)
    with invalid("group", "'wing'"):
        LinkGroup(below=("wing",)).joints(skeleton)
