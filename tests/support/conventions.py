"""Names that programs give to the joints of a body, and BVH files of bodies with them.

A convention is a pattern of a sided joint and twelve names: hip, knee, ankle, toe; shoulder, elbow,
wrist; and of the middle: root, spine, neck, head. ``{}`` is where the side stands.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Convention(NamedTuple):
    """The names of one program."""

    sides: tuple[str, str]
    legs: tuple[str, ...]
    arms: tuple[str, ...]
    middle: tuple[str, ...]


def _of(sides: str, legs: str, arms: str, middle: str, joiner: str = "{}") -> Convention:
    """Names without a pattern of their own have the side where `joiner` puts it."""
    left, right = sides.split()
    patterns = [tuple(n if "{}" in n else joiner.replace("#", n) for n in group.split())
                for group in (legs, arms)]  # fmt: skip
    return Convention((left, right), patterns[0], patterns[1],
                      tuple(name.replace("~", " ") for name in middle.split()))  # fmt: skip


LR, LRS = "Left Right", "left right"
HIK = ("UpLeg Leg Foot ToeBase", "Arm ForeArm Hand")
MIDDLE = "Hips Spine Neck Head"
CONVENTIONS = {
    "humanik": _of(LR, *HIK, MIDDLE, "{}#"),
    "motionbuilder-namespace": _of(LR, *HIK, "BVH:Hips BVH:Spine BVH:Neck BVH:Head", "BVH:{}#"),
    "mixamo": _of(LR, *HIK, "mixamorig:Hips mixamorig:Spine mixamorig:Neck mixamorig:Head",
                  "mixamorig:{}#"),
    "mixamo-underscore": _of(LR, *HIK, "mixamorig_Hips mixamorig_Spine mixamorig_Neck "
                             "mixamorig_Head", "mixamorig_{}#"),
    "mixamo-numbered": _of(LR, *HIK, "mixamorig9:Hips mixamorig9:Spine mixamorig9:Neck "
                           "mixamorig9:Head", "mixamorig9:{}#"),
    "character1": _of(LR, *HIK, "Character1_Hips Character1_Spine Character1_Neck Character1_Head",
                      "Character1_{}#"),
    "lafan1": _of(LR, "UpLeg Leg Foot Toe", "Arm ForeArm Hand", MIDDLE, "{}#"),
    "cmu-cgspeed": _of(LR, *HIK, "Hips LowerBack Neck Head", "{}#"),
    "cmu-acclaim": _of("l r", "femur tibia foot toes", "humerus radius wrist",
                       "root lowerback lowerneck head", "{}#"),
    "rokoko": _of(LR, "Thigh Shin Foot Toe", "Arm ForeArm Hand", MIDDLE, "{}#"),
    "xsens": _of(LR, "UpperLeg LowerLeg Foot Toe", "UpperArm ForeArm Hand",
                 "Hips Chest Neck Head", "{}#"),
    "xsens-mvnx": _of(LR, "j{}Hip j{}Knee j{}Ankle j{}BallFoot", "j{}Shoulder j{}Elbow j{}Wrist",
                      "jPelvis jL5S1 jT1C7 jC1Head"),
    "perception-neuron": _of(LR, "UpLeg Leg Foot ToeBase", "Arm ForeArm Hand",
                             "Robot_Hips Robot_Spine Robot_Neck Robot_Head", "Robot_{}#"),
    "optitrack": _of("L R", "Thigh Shin Foot Toe", "UArm FArm Hand", "Hip Ab Neck Head", "{}#"),
    "optitrack-motive": _of(LR, *HIK, "Skeleton_001:Hips Skeleton_001:Spine Skeleton_001:Neck "
                            "Skeleton_001:Head", "Skeleton_001:{}#"),
    "biovision": _of(LR, "Hip Knee Ankle Toe", "Shoulder Elbow Wrist", MIDDLE, "{}#"),
    "biovision-limbs": _of(LR, "UpLeg LowLeg Foot Toe", "UpArm LowArm Hand",
                           "Hips Chest Neck Head", "{}#"),
    "max-biped": _of("L R", "Bip01~{}~Thigh Bip01~{}~Calf Bip01~{}~Foot Bip01~{}~Toe0",
                     "Bip01~{}~UpperArm Bip01~{}~Forearm Bip01~{}~Hand",
                     "Bip01~Pelvis Bip01~Spine Bip01~Neck Bip01~Head"),
    "max-biped-underscore": _of("L R", "Thigh Calf Foot Toe0", "UpperArm Forearm Hand",
                                "Bip001_Pelvis Bip001_Spine Bip001_Neck Bip001_Head",
                                "Bip001_{}_#"),
    "valve": _of("L R", "Thigh Calf Foot Toe0", "UpperArm Forearm Hand",
                 "ValveBiped.Bip01_Pelvis ValveBiped.Bip01_Spine ValveBiped.Bip01_Neck1 "
                 "ValveBiped.Bip01_Head1", "ValveBiped.Bip01_{}_#"),
    "skyrim": _of("L R", "NPC~{}~Thigh~[{}Thg] NPC~{}~Calf~[{}Clf] NPC~{}~Foot~[{}ft~] "
                  "NPC~{}~Toe0~[{}Toe]", "NPC~{}~UpperArm~[{}Uar] NPC~{}~Forearm~[{}Lar] "
                  "NPC~{}~Hand~[{}Hnd]", "NPC~Pelvis~[Pelv] NPC~Spine~[Spn0] NPC~Neck~[Neck] "
                  "NPC~Head~[Head]"),
    "makehuman": _of("L R", "upperleg01.{} lowerleg01.{} foot.{} toe1-1.{}",
                     "upperarm01.{} lowerarm01.{} wrist.{}", "root spine05 neck01 head"),
    "rigify": _of("L R", "thigh.{} shin.{} foot.{} toe.{}", "upper_arm.{} forearm.{} hand.{}",
                  "spine spine.001 neck head"),
    "rigify-deform": _of("L R", "DEF-thigh.{} DEF-shin.{} DEF-foot.{} DEF-toe.{}",
                         "DEF-upper_arm.{} DEF-forearm.{} DEF-hand.{}",
                         "DEF-spine DEF-spine.001 DEF-neck DEF-head"),
    "auto-rig-pro": _of("l r", "thigh_stretch.{} leg_stretch.{} foot.{} toes_01.{}",
                        "arm_stretch.{} forearm_stretch.{} hand.{}",
                        "root.x spine_01.x neck.x head.x"),
    "advanced-skeleton": _of("L R", "Hip_{} Knee_{} Ankle_{} Toes_{}",
                             "Shoulder_{} Elbow_{} Wrist_{}", "Root_M Spine1_M Neck_M Head_M"),
    "daz-genesis": _of("l r", "ThighBend Shin Foot Toe", "ShldrBend ForearmBend Hand",
                       "hip abdomenLower neckLower head", "{}#"),
    "daz-genesis9": _of("l r", "thigh shin foot toes", "upperarm forearm hand",
                        "hip spine1 neck1 head", "{}_#"),
    "poser": _of("l r", "Thigh Shin Foot Toe", "Shldr ForeArm Hand", "hip abdomen neck head",
                 "{}#"),
    "second-life": _of(LR, "mHip{} mKnee{} mAnkle{} mToe{}", "mShoulder{} mElbow{} mWrist{}",
                       "mPelvis mTorso mNeck mHead"),
    "unreal": _of("l r", "thigh_{} calf_{} foot_{} ball_{}",
                  "upperarm_{} lowerarm_{} hand_{}", "pelvis spine_01 neck_01 head"),
    "metahuman": _of("l r", "thigh_{} calf_{} foot_{} ball_{}",
                     "upperarm_{} lowerarm_{} hand_{}", "pelvis spine_01 neck_02 head"),
    "unity": _of(LR, "UpperLeg LowerLeg Foot Toes", "UpperArm LowerArm Hand", MIDDLE, "{}#"),
    "vrm": _of("L R", "UpperLeg LowerLeg Foot ToeBase", "UpperArm LowerArm Hand",
               "J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Neck J_Bip_C_Head", "J_Bip_{}_#"),
    "character-creator": _of("L R", "Thigh Calf Foot ToeBase", "Upperarm Forearm Hand",
                             "CC_Base_Hip CC_Base_Spine01 CC_Base_NeckTwist01 CC_Base_Head",
                             "CC_Base_{}_#"),
    "iclone-g3": _of("L R", "RL_{}_Thigh RL_{}_Calf RL_{}_Foot RL_{}_ToeBase",
                     "RL_{}_Upperarm RL_{}_Forearm RL_{}_Hand",
                     "RL_Hip RL_Spine01 RL_NeckTwist01 RL_Head"),
    "smpl": _of("L R", "{}_Hip {}_Knee {}_Ankle {}_Foot", "{}_Shoulder {}_Elbow {}_Wrist",
                "Pelvis Spine1 Neck Head"),
    "amass": _of(LRS, "hip knee ankle foot", "shoulder elbow wrist", "pelvis spine1 neck head",
                 "{}_#"),
    "smpl-addon": _of("L R", "m_avg_{}_Hip m_avg_{}_Knee m_avg_{}_Ankle m_avg_{}_Foot",
                      "m_avg_{}_Shoulder m_avg_{}_Elbow m_avg_{}_Wrist",
                      "m_avg_Pelvis m_avg_Spine1 m_avg_Neck m_avg_Head"),
    "kit-mmm": _of("L R", "{}Hip_joint {}Knee_joint {}Ankle_joint {}Foot_joint",
                   "{}Shoulder_joint {}Elbow_joint {}Wrist_joint",
                   "Root_joint Pelvis_joint Neck_joint Head_joint"),
    "kinect": _of(LR, "Hip{} Knee{} Ankle{} Foot{}", "Shoulder{} Elbow{} Wrist{}",
                  "SpineBase SpineMid Neck Head"),
    "openpose": _of("L R", "{}Hip {}Knee {}Ankle {}BigToe", "{}Shoulder {}Elbow {}Wrist",
                    "MidHip Spine Neck Head"),
    "openpose-h36m": _of(LR, "{}Hip {}Knee {}Foot {}Toe", "{}Shoulder {}Elbow {}Wrist",
                         "Hip Spine Neck Head"),
    "opensim": _of("l r", "femur_{} tibia_{} talus_{} toes_{}", "humerus_{} ulna_{} hand_{}",
                   "pelvis torso neck head"),
    "arkit": _of(LRS, "upLeg leg foot toes", "arm forearm hand",
                 "hips_joint spine_1_joint neck_1_joint head_joint", "{}_#_joint"),
    "roblox": _of(LR, "UpperLeg LowerLeg Foot Toe", "UpperArm LowerArm Hand",
                  "LowerTorso UpperTorso Neck Head", "{}#"),
    "ipi": _of("L R", "Thigh Shin Foot Toe", "Shoulder Forearm Hand",
               "Hip LowerSpine Neck Head", "{}#"),
    "cascadeur": _of("l r", "thigh_{} calf_{} foot_{} toe_{}", "arm_{} forearm_{} hand_{}",
                     "pelvis stomach neck head"),
    "sketchfab": _of(LR, "{}UpLeg_055 {}Leg_056 {}Foot_057 {}ToeBase_058",
                     "{}Arm_09 {}ForeArm_010 {}Hand_011", "Hips_01 Spine_02 Neck_04 Head_05"),
    "mmd": _of("左 右", "{}足 {}ひざ {}足首 {}つま先", "{}腕 {}ひじ {}手首",
               "下半身 上半身 首 頭"),
    "100style": _of(LR, "Hip Knee Ankle Toe", "Shoulder Elbow Wrist", "Hips Chest Neck Head",
                    "{}#"),
    "numbers": _of("1 2", "b{}10 b{}11 b{}12 b{}13", "b{}20 b{}21 b{}22", "b0 b1 b2 b3"),
    "french": _of("G D", "Cuisse{} Mollet{} Pied{} Orteil{}", "Bras{} AvantBras{} Main{}",
                  "Bassin Dos Cou Tete"),
}  # fmt: skip

#: (shift of the hips, thigh, shank, spine, upper arm) [m] of three bodies
BODIES = (
    (0.09, 0.42, 0.41, 0.25, 0.28),
    (0.10, 0.36, 0.38, 0.22, 0.25),
    (0.08, 0.45, 0.46, 0.3, 0.3),
)
FRAMES = 10


def names_of(convention: Convention) -> list[str]:
    """The joints as `write_body` has them: middle, then left and right leg and arm."""
    names = list(convention.middle)
    for group in (convention.legs, convention.arms):
        for side in convention.sides:
            names += [pattern.replace("{}", side).replace("~", " ") for pattern in group]
    return names


def _offset(offset: np.ndarray) -> str:
    return "OFFSET " + " ".join(f"{x:.6f}" for x in offset)


def body_bvh(convention: Convention, body: int = 0, unit: float = 0.01) -> str:
    """A body that bends its knees and nods, y up, z forward."""
    hips, thigh, shank, spine, arm = (x / unit for x in BODIES[body])
    names = names_of(convention)
    middle, rest = names[:4], names[4:]
    legs, arms = (rest[:4], rest[4:8]), (rest[8:11], rest[11:14])
    up = np.array([0.0, 1.0, 0.0])
    lines = ["HIERARCHY"]

    def joint(name: str, offset: np.ndarray, inside: list[str], root: bool = False) -> list[str]:
        places = "Xposition Yposition Zposition " if root else ""
        channels = f"CHANNELS {6 if root else 3} {places}Zrotation Xrotation Yrotation"
        return [f"{'ROOT' if root else 'JOINT'} {name}", "{",
                _offset(offset), channels, *inside, "}"]  # fmt: skip

    def end(offset: np.ndarray) -> list[str]:
        return ["End Site", "{", _offset(offset), "}"]

    def chain(chained: list[str], offsets: list[np.ndarray], tip: np.ndarray) -> list[str]:
        inside = end(tip)
        for name, offset in reversed(list(zip(chained, offsets, strict=True))):
            inside = joint(name, offset, inside)
        return inside

    def limb(side: float, leg: list[str], own_arm: list[str]) -> tuple[list[str], list[str]]:
        x = np.array([side, 0.0, 0.0])
        foot = np.array([0.0, -0.06 / unit, 0.12 / unit])
        below = chain(leg, [hips * x - 0.05 / unit * up, -thigh * up, -shank * up, foot],
                      np.array([0.0, 0.0, 0.05 / unit]))  # fmt: skip
        reach = [0.17 / unit * x + 0.9 * spine * up, arm * x, 0.9 * arm * x]
        return below, chain(own_arm, reach, 0.1 / unit * x)

    (left_leg, left_arm), (right_leg, right_arm) = (
        limb(side, leg, own_arm) for side, leg, own_arm in zip((1.0, -1.0), legs, arms, strict=True)
    )
    head = chain(middle[2:], [spine * up, 0.1 / unit * up], 0.15 / unit * up)
    trunk = joint(middle[1], 0.1 / unit * up, [*head, *left_arm, *right_arm])
    lines += joint(middle[0], np.zeros(3), [*trunk, *left_leg, *right_leg], root=True)
    lines += ["MOTION", f"Frames: {FRAMES}", "Frame Time: 0.033333"]
    order = [line.split(maxsplit=1)[1] for line in lines if line.startswith(("ROOT", "JOINT"))]
    knees = {leg[1] for leg in legs}
    for i in range(FRAMES):
        row = [0.0, (BODIES[body][1] + BODIES[body][2] + 0.11) / unit, 0.0]
        for name in order:
            row += [0.0, 2.0 * i if name in knees else 0.0, 0.0]
        lines.append(" ".join(f"{x:.6f}" for x in row))
    return "\n".join(lines) + "\n"
