"""Robots of any size, made as MJCF text and read through Poise's descriptions, for `scaling`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import yaml

from poise.envs.robots.robot import Robot, load_robot
from poise.envs.robots.soles import Sole, find_sole_plane, sole_frame, sole_geoms

LEG_JOINTS = (  # name, body, axis, range [°]
    ("hip_x", "hip", "1 0 0", "-40 40"),
    ("hip_z", "hip", "0 0 1", "-40 40"),
    ("hip_y", "thigh", "0 1 0", "-100 100"),
    ("knee", "shin", "0 1 0", "5 150"),
    ("ankle_y", "foot", "0 1 0", "-60 60"),
    ("ankle_x", "foot", "1 0 0", "-30 30"),
)
BODIES = (  # of a leg: name, place, geometry
    ("hip", "{x} {y} -0.12", '<geom type="sphere" size="0.04" mass="0.5"/>'),
    ("thigh", "0 0 -0.02", '<geom type="capsule" fromto="0 0 -0.05 0 0 -0.25" size="0.04"/>'),
    ("shin", "0 0 -0.3", '<geom type="capsule" fromto="0 0 -0.05 0 0 -0.25" size="0.03"/>'),
    ("foot", "0 0 -0.3", '<geom type="box" pos="0.03 0 -0.04" size="0.1 0.04 0.01"/>'),
)
PLACES = {"left": (0.0, 0.1), "right": (0.0, -0.1)}
FOUR_PLACES = {"left": (0.25, 0.15), "right": (0.25, -0.15),
               "left2": (-0.25, 0.15), "right2": (-0.25, -0.15)}  # fmt: skip
ARM_LENGTH, ARM_MASS = 0.5, 2.0  # [m], [kg]


def make_robot(folder: Path, arm_joints: int, leg_joints: int = 6, legs: int = 2) -> Robot:
    """A trunk on two or four legs, with `arm_joints` joints in two arms.

    Legs of 3 joints (hip_y, knee, ankle_y), 4 (and ankle_x) or 6. A description names exactly two
    feet, so the soles of further legs are added to the robot afterwards.
    """
    kept = {3: (2, 3, 4), 4: (2, 3, 4, 5), 6: (0, 1, 2, 3, 4, 5)}[leg_joints]
    places = PLACES if legs == 2 else FOUR_PLACES
    names, parts = [], []
    for side, (x, y) in places.items():
        used = [LEG_JOINTS[i] for i in kept]
        names += [f"{side}_{joint[0]}" for joint in used]
        text = ""
        for body, place, geom in reversed(BODIES):
            joints = "".join(
                f'<joint name="{side}_{name}" axis="{axis}" range="{span}"/>'
                for name, where, axis, span in used
                if where == body
            )
            spot = place.format(x=x, y=y)
            text = f'<body name="{side}_{body}" pos="{spot}">{joints}{geom}{text}</body>'
        parts.append(text)
    for side, count in (("left", (arm_joints + 1) // 2), ("right", arm_joints // 2)):
        if count:
            parts.append(_arm(side, count))
            names += [f"{side}_arm{i}" for i in range(count)]
    motors = "".join(f'<motor joint="{name}" ctrlrange="-80 80"/>' for name in names)
    length = 0.08 if legs == 2 else 0.3
    (folder / "robot.xml").write_text(
        '<mujoco><compiler angle="degree" autolimits="true"/>'
        '<default><joint damping="0.2" armature="0.01"/></default>'
        '<worldbody><body name="trunk" pos="0 0 1"><freejoint/>'
        f'<geom type="box" size="{length} 0.12 0.1" mass="12" contype="0" conaffinity="0"/>'
        f"{''.join(parts)}</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )
    fields = {
        "name": "scaled",
        "source": {"mjcf": "robot.xml"},
        "root": "trunk",
        "feet": [{"name": side, "body": f"{side}_foot"} for side in ("left", "right")],
        "posture": {
            "joints": {"*_hip_y": -20, "*_knee": 40, "*_ankle_y": -20}
            | ({"*_arm*": 3} if arm_joints else {})
        },
    }
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(fields, sort_keys=False))
    robot = load_robot(path)
    return robot if legs == 2 else _with_all_soles(robot, list(places))


def _arm(side: str, count: int) -> str:
    """A chain of links with one hinge each; axes take turns."""
    y, link = (0.14 if side == "left" else -0.14), ARM_LENGTH / count
    axes = ("0 1 0", "1 0 0", "0 0 1")
    text = ""
    for i in reversed(range(count)):
        place = f"0 {y} 0.08" if i == 0 else f"0 0 {-link}"
        text = (
            f'<body pos="{place}"><joint name="{side}_arm{i}" axis="{axes[i % 3]}" '
            f'range="-90 90"/><geom type="capsule" fromto="0 0 0 0 0 {-link}" size="0.02" '
            f'mass="{ARM_MASS / count}" contype="0" conaffinity="0"/>{text}</body>'
        )
    return text


def _with_all_soles(robot: Robot, names: list[str]) -> Robot:
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    soles = []
    for name in names:
        body = model.body(f"{name}_foot").id
        geoms = sole_geoms(model, body, (), robot.ground_geom_id)
        plane = find_sole_plane(model, data, body, geoms)
        frame = sole_frame(plane, data.xmat[body])
        soles.append(Sole(name, f"{name}_foot", body, geoms, *frame))
    # the counters of contacts are not read here: any address will do
    sensors = robot.sensor_adr | dict.fromkeys(names, robot.sensor_adr["left"])
    return replace(robot, soles=tuple(soles), sensor_adr=sensors)


def with_soles(robot: Robot, count: int) -> Robot:
    """The robot as if its first `count` soles were all it stands on."""
    return replace(robot, soles=robot.soles[:count])
