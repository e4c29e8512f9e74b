"""envs/robots/models/urdf.py: robots from URDF files, and what is refused of them."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.models.urdf import PACKAGES, find_file, find_mesh
from poise.envs.robots.robot import Robot, load_robot
from tests.support.small_urdf import BOX_SOLE, INERTIAL, JOINTS, LIMIT, mesh, write_stl, write_urdf

MASS = 12.0 + 2 * (3 * 2.0 + 2 * 0.1)  # of the links as the file says
LINK = f'<link name="{{name}}">{INERTIAL.format(z=0.0, mass=0.5, i=0.001)}</link>'
JOINT = (
    '<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="{effort}" velocity="1"/>{more}</joint>'
)
#: a link of the world, to which the trunk is joined
WORLD = (
    '<link name="world"/><joint name="base" type="floating"><parent link="world"/>'
    '<child link="trunk"/></joint>'
)
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
SHADE = mesh("lost.stl", "visual")


def part(name: str, parent: str, kind: str = "fixed", effort: float = 5.0, more: str = "") -> str:
    """A link of half a kilogram and its joint."""
    return LINK.format(name=name) + JOINT.format(
        child=name, parent=parent, kind=kind, effort=effort, more=more
    )


def problem(path: Path) -> str:
    """The text of the error, without the description's path, which it begins with."""
    with pytest.raises(ConfigError) as error:
        load_robot(path)
    text = str(error.value)
    assert text.startswith(f"{path}: ") and "\n" not in text
    return text.removeprefix(f"{path}: ")


def test_root_floats_and_efforts_limit_motors(tmp_path: Path) -> None:
    """A free joint first; a motor of its effort at each joint; masses of the links, not geoms."""
    robot = load_robot(write_urdf(tmp_path))
    model = robot.model
    assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.body(robot.root_body_id).name == "trunk"
    assert robot.joint_names == tuple(f"{s}_{j}" for s in ("left", "right") for j in JOINTS)
    assert (
        robot.torque_limit.tolist() == [60.0] * 10 and model.dof_damping[6:].tolist() == [0.3] * 10
    )
    assert robot.mass == pytest.approx(MASS)
    assert robot.joint_range.tolist() == [[-2.0, 2.0]] * 10
    assert [sole.polygon.tolist() for sole in robot.soles] == [
        pytest.approx(np.array([[0.1, 0.04], [-0.1, 0.04], [-0.1, -0.04], [0.1, -0.04]]))
    ] * 2
    assert model.geom(robot.ground_geom_id).name == "ground"


def test_links_at_fixed_joints_stay(tmp_path: Path) -> None:
    """A link of the world above the root, a head on it: nothing is fused away. Only an inertial has
    mass."""
    pad = part("pad", "trunk").replace(INERTIAL.format(z=0.0, mass=0.5, i=0.001), BOX)
    floating = WORLD + part("head", "trunk") + pad
    extra = floating.replace("floating", "fixed")
    robot = load_robot(write_urdf(tmp_path, extra=extra, push_bodies=["head"]))
    assert robot.mass == pytest.approx(MASS + 0.5)
    assert robot.model.body("head").weldid == robot.root_body_id
    other = load_robot(write_urdf(tmp_path, extra=floating))
    assert other.fingerprint == robot.fingerprint


def test_a_joint_without_effort_has_no_motor(tmp_path: Path) -> None:
    """But torque_limits may give it one."""
    extra = part("finger", "trunk", "revolute", effort=0.0)
    robot = load_robot(write_urdf(tmp_path, extra=extra))
    assert "finger_joint" in robot.joint_names and len(robot.motor_dofs) == 10
    robot = load_robot(write_urdf(tmp_path, extra=extra, torque_limits={"finger_*": 3}))
    assert robot.torque_limit.tolist() == [60.0] * 10 + [3.0]


def test_a_sole_by_the_name_of_its_collision_or_its_link(tmp_path: Path) -> None:
    """The sole of a foot of two links, one of which is fixed to the other and further out."""
    heel = part("{side}_heel", "{side}_foot").replace(
        "</link>", BOX_SOLE.replace("{side}_sole", "{side}_pad").replace("0.03", "-0.2") + "</link>"
    )
    both = heel.format(side="left") + heel.format(side="right")
    lengths = {"left_sole": 0.2, "left_heel": 0.2, "left_foot": 0.2, "": 0.43}
    for name, length in lengths.items():
        geoms = [[name], [name.replace("left", "right")]] if name else [[], []]
        feet = [
            {"name": side, "body": f"{side}_foot", "geoms": own}
            for side, own in zip(("left", "right"), geoms, strict=True)
        ]
        sole = load_robot(write_urdf(tmp_path, extra=both, feet=feet)).soles[0]
        assert np.ptp(sole.polygon[:, 0]) == pytest.approx(length), name


def test_meshes_of_another_machine(tmp_path: Path) -> None:
    """By the last folders of their names, near the file; those of a package whose folder was
    renamed too. A relative name that is not there stays missing."""
    mesh_file = write_stl(tmp_path / "copied/meshes/a.stl")
    beside = tmp_path / "copied/robot.urdf"
    for name in ("/home/her/ws/robot/meshes/a.stl", "file:///home/her/robot/meshes/a.stl",
                 "F:/RobotProject/robot/meshes/a.stl", "F:\\robot\\meshes\\a.stl",
                 "package://her_robot/meshes/a.stl"):  # fmt: skip
        for near in (beside, tmp_path / "copied/urdf/robot.urdf"):
            assert find_mesh(name, near) == mesh_file, name
        assert find_mesh(name, tmp_path / "copied/a/b/c/robot.urdf") is None
    for name in ("her/meshes/a.stl", "/home/her/../meshes/a.stl", "package://her_robot/b.stl"):
        assert find_mesh(name, beside) is None, name


def test_meshes_of_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Above the file, then in ROS_PACKAGE_PATH; files of one name in two folders stay two."""
    beside = write_stl(tmp_path / "ws/my_robot/meshes/a.stl")
    urdf = write_urdf(tmp_path / "ws/my_robot/urdf").with_suffix(".urdf")
    elsewhere = write_stl(tmp_path / "opt/other/a.stl", (0.2, 0.2, 0.2))
    monkeypatch.delenv(PACKAGES, raising=False)
    assert find_file("package://my_robot/meshes/a.stl", urdf) == beside
    assert find_file("package:///my_robot/meshes/a.stl", urdf) == beside
    assert find_file("../meshes/a.stl", urdf) == urdf.parent / "../meshes/a.stl"
    assert find_file(f"file://{beside}", urdf) == beside
    assert find_file("package://other/a.stl", urdf) is None
    for named in (elsewhere.parent, elsewhere.parent.parent):
        monkeypatch.setenv(PACKAGES, f"{tmp_path}/nowhere:{named}")
        assert find_file("package://other/a.stl", urdf) == elsewhere
    trunk = mesh("package://my_robot/meshes/a.stl") + mesh("package://other/a.stl")
    robot = load_robot(write_urdf(urdf.parent, trunk=trunk))
    assert sorted(np.round(robot.model.mesh_vert.max(axis=1), 6).tolist())[-1] > 0.05
    assert robot.model.nmesh == 2 and robot.mass == pytest.approx(MASS)


def test_what_is_only_seen_may_be_missing(tmp_path: Path) -> None:
    """Or of a form that MuJoCo does not read; where it is there, pictures show it alone."""
    write_stl(tmp_path / "there.stl")
    (tmp_path / "shape.dae").write_text("<COLLADA/>")
    seen = mesh("there.stl", "visual") + SHADE + mesh("shape.dae", "visual")
    model = load_robot(write_urdf(tmp_path, trunk=seen + mesh("there.stl"))).model
    trunk = [i for i in range(model.ngeom) if model.geom_bodyid[i] == model.body("trunk").id]
    assert [(model.geom_contype[i] > 0, model.geom_group[i] > 2) for i in trunk] == [
        (False, False),
        (True, True),
    ]


REFUSED = {
    "no file": ({"source": {"urdf": "no.urdf"}}, "source.urdf: no such file: .*no.urdf"),
    "no XML": ({"change": ("</robot>", "")}, "source.urdf: .*biped.urdf is not valid URDF: "),
    "MJCF": ({"change": ("robot", "mujoco")}, "source.urdf: .* it begins with <mujoco>"),
    "no link": (
        {"change": ('<child link="left_shin"/>', '<child link="shin"/>')},
        "source.urdf: .*biped.urdf is not valid URDF: .*joint parent or child missing",
    ),
    "two joints of one name": (
        {"extra": part("a", "trunk", "revolute") + part("a2", "trunk", "revolute").replace(
            "a2_joint", "a_joint")},
        "source.urdf: .*biped.urdf is not valid URDF: two joints are called 'a_joint'",
    ),
    "a document type": (
        {"change": ("<robot", "<!DOCTYPE robot><robot")},
        "source.urdf: .*biped.urdf has a document type",
    ),
    "deep": (
        {"extra": "<a>" * 5000 + "</a>" * 5000},
        "source.urdf: .*biped.urdf is not valid URDF: ",
    ),
    "large": (
        {"extra": '<link name="x"/>' * 20_001},
        "source.urdf: the model has more than 20000 elements",
    ),
    "a missing mesh": (
        {"trunk": mesh("meshes/trunk.stl")},
        "source.urdf: the mesh 'meshes/trunk.stl' of the link 'trunk' is missing$",
    ),
    "a missing package": (
        {"trunk": mesh("package://my_robot/trunk.stl")},
        "source.urdf: the mesh 'package://my_robot/trunk.stl' of the link 'trunk' is missing: "
        "its package is looked for above .* and in ROS_PACKAGE_PATH$",
    ),
    "a mesh of another form": (
        {"trunk": mesh("biped.urdf")},
        "source.urdf: the mesh 'biped.urdf' of the link 'trunk' is not of a form that MuJoCo reads",
    ),
    "a mimic joint": (
        {"extra": part("thumb", "trunk", "revolute", more='<mimic joint="left_hip"/>')},
        "source.urdf: the joint 'thumb_joint' mimics 'left_hip', which is not supported: make it",
    ),
    "two free joints": (
        {"extra": WORLD + part("ball", "world", "floating")},
        "root: the model has moving parts other than the robot 'trunk': 'ball' ",
    ),
    "a free joint on the robot": (
        {"extra": part("ball", "trunk", "floating")},
        "source.urdf: the floating joint 'ball_joint' does not join its link to the world",
    ),
    "two roots": (
        {"extra": LINK.format(name="other")},
        "root: nothing moves the root 'trunk', it is fixed to the world: give .* <freejoint/>",
    ),
    "a root below the one that floats": (
        {"extra": part("trunk", "base").replace('<link name="trunk"', '<link name="base"')},
        "root: the root must be the body that has the free joint, which is 'base', not 'trunk'",
    ),
    "no effort": (
        {"limit": LIMIT.replace(' effort="60"', "")},
        r"torque_limits: the model has no actuators; give torque limits .*\(choices: left_hip_roll",
    ),
    "a link without mass": (
        {"extra": part("hand", "trunk", "revolute").replace("0.5", "0")},
        r"source: the model .*biped\.urdf does not compile: .*hand",
    ),
    "a sole's link that is fixed to the foot": (
        {
            "extra": part("left_sole_link", "left_foot"),
            "feet": [
                {"name": "left", "body": "left_sole_link"},
                {"name": "right", "body": "right_foot"},
            ],
        },
        r"feet\[0\]: the foot 'left_sole_link' has no collision .*; it is fixed to 'left_foot': "
        "name that one",
    ),
    "an unknown sole": (
        {
            "feet": [
                {"name": "left", "body": "left_foot", "geoms": ["pad"]},
                {"name": "right", "body": "right_foot"},
            ]
        },
        r"feet\[0\].geoms: 'pad' is no geom of the foot .*\(choices: left_sole, left_foot\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused_by_name(tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that names the file, the field and what is wrong."""
    monkeypatch.delenv(PACKAGES, raising=False)
    change, text = REFUSED[case]
    found = problem(write_urdf(tmp_path, **change))
    assert re.match(text, found), found


PAIRS = """<robot name="biped"><group name="x"><joint name="left_hip"/></group>
<disable_collisions link1="{}" link2="{}" reason="Never"/>
<disable_collisions link1="trunk" link2="camera"/> <disable_collisions link1="a" link2="a"/>
<disable_collisions link1="{}" link2="{}"/></robot>"""


def test_pairs_of_an_srdf_file_do_not_collide(tmp_path: Path) -> None:
    """Said once or twice, in either order; links that there are not are passed over."""
    two = "".join(part(n, "trunk", "revolute").replace("</link>", BOX + "</link>") for n in "ab")
    free = write_urdf(tmp_path, extra=two)
    assert contacts(load_robot(free)) == {("a", "b")}
    (tmp_path / "biped.srdf").write_text(PAIRS.format("a", "b", "b", "a"))
    source = {"urdf": "biped.urdf", "srdf": "biped.srdf"}
    robot = load_robot(write_urdf(tmp_path, extra=two, source=source))
    assert robot.model.nexclude == 1 and contacts(robot) == set()


def contacts(robot: Robot) -> set[tuple[str, str]]:
    """Links of the robot that touch each other, standing."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    geoms = [(c.geom1, c.geom2) for c in data.contact if robot.ground_geom_id not in c.geom]
    return {tuple(robot.model.body(robot.model.geom_bodyid[g]).name for g in p) for p in geoms}


WRONG_SRDF = {
    "none": (None, "source.srdf: no such file: .*biped.srdf"),
    "no XML": ("<robot>", "source.srdf: .*biped.srdf is not valid SRDF: "),
    "something else": ("<mujoco/>", "source.srdf: .*is not valid SRDF: it begins with <mujoco>"),
}


@pytest.mark.parametrize("case", WRONG_SRDF)
def test_a_wrong_srdf_file(tmp_path: Path, case: str) -> None:
    """One line with its field."""
    text, message = WRONG_SRDF[case]
    if text is not None:
        (tmp_path / "biped.srdf").write_text(text)
    source = {"urdf": "biped.urdf", "srdf": "biped.srdf"}
    assert re.match(message, problem(write_urdf(tmp_path, source=source)))


def test_a_package_that_this_machine_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """How to get it; with it, the description finds it; an SRDF file goes with a URDF file."""
    monkeypatch.delenv(PACKAGES, raising=False)
    urdf = write_urdf(tmp_path / "opt/no-such-robot").with_suffix(".urdf")
    source = {"urdf": f"package://no-such-robot/{urdf.name}"}
    own = write_urdf(tmp_path / "own", source=source)
    assert problem(own) == (
        f"source.urdf: this machine has no {source['urdf']}: pip install no-such-robot, if there "
        "is such a wheel, or name the package's folder in ROS_PACKAGE_PATH"
    )
    monkeypatch.setenv(PACKAGES, str(tmp_path / "opt"))
    assert load_robot(own).fingerprint == load_robot(urdf.with_suffix(".yaml")).fingerprint
    alone = write_urdf(tmp_path / "own", source={"mjcf": "a.xml", "srdf": "b.srdf"})
    assert problem(alone) == "source: srdf: goes with urdf alone"


def test_talos() -> None:
    """PAL's Talos: its mass and joints, box soles, no links inside each other."""
    try:
        robot = load_robot("pal_talos")
    except ConfigError as error:
        assert "pip install example-robot-data" in str(error)
        pytest.skip("its model is not installed: pip install --no-deps example-robot-data")
    assert robot.mass == pytest.approx(90.27, abs=0.01) and len(robot.joint_names) == 32
    assert contacts(robot) == set() and robot.model.nmesh > 50
    for sole in robot.soles:
        assert np.ptp(sole.polygon, axis=0) == pytest.approx([0.21, 0.13])
