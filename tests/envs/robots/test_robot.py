"""Robots as everything else finds them: the fields of Robot, the standing posture, the errors."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.robots.robot import Robot, load_robot
from tests.envs.robots.test_menagerie import ROBOTS as OF_OTHERS
from tests.support.refused import invalid
from tests.support.small_biped import BOX_FOOT, LEG, motors, write_biped

ROBOTS = ("compact", "human", "humanoid", "tall", "toddler")


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


def standing(robot: Robot) -> mujoco.MjData:
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    return data


def sole_poses(robot: Robot, data: mujoco.MjData) -> list[tuple[np.ndarray, np.ndarray]]:
    axes = [data.xmat[sole.body_id].reshape(3, 3) for sole in robot.soles]
    return [
        (data.xpos[sole.body_id] + foot @ sole.position, foot @ sole.rotation)
        for sole, foot in zip(robot.soles, axes, strict=True)
    ]


def test_packaged() -> None:
    """These robots are packaged, besides those of test_menagerie.py and test_urdf.py."""
    assert set(packaged("robots")) == set(ROBOTS) | set(OF_OTHERS) | {"pal_talos"}


def test_soles_lie_flat_at_the_origin_facing_forward(robot: Robot) -> None:
    """Standing, both soles are level at z = 0, their mean at the origin, the root facing +x."""
    data = standing(robot)
    poses = sole_poses(robot, data)
    for position, axes in poses:
        np.testing.assert_allclose(axes, np.eye(3), atol=1e-9)
        assert abs(position[2]) < 1e-8
    np.testing.assert_allclose(np.mean([p for p, _ in poses], axis=0), 0, atol=1e-8)
    forward = data.xmat[robot.root_body_id].reshape(3, 3) @ robot.description.forward
    assert forward[0] > 0.99 and abs(forward[1]) < 1e-9
    assert poses[0][0][1] > 0 > poses[1][0][1], "the first foot is the left one"


def test_polygon_is_hull_of_the_simulators_contacts(robot: Robot) -> None:
    """MuJoCo touches the ground exactly at the vertices of the sole polygons."""
    data = standing(robot)
    for sole, (position, _) in zip(robot.soles, sole_poses(robot, data), strict=True):
        points = np.array([c.pos for c in data.contact if c.geom2 in sole.geom_ids]) - position
        gaps = np.linalg.norm(points[:, None, :2] - sole.polygon, axis=2)
        assert gaps.min(axis=0).max() < 1e-6
        assert gaps.min(axis=1).max() < 1e-6


def test_polygon_is_ccw_about_its_centroid(robot: Robot) -> None:
    """Polygons turn left at each vertex and are centred on the reference point."""
    for sole in robot.soles:
        edges = np.roll(sole.polygon, -1, axis=0) - sole.polygon
        after = np.roll(edges, -1, axis=0)
        assert np.all(edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] > 0)
        assert 3 <= len(sole.polygon) <= 8
        assert np.all(sole.polygon.min(axis=0) < 0) and np.all(sole.polygon.max(axis=0) > 0)


def test_only_soles_touch_when_standing(robot: Robot) -> None:
    """Standing, soles touch the ground, and nothing else touches anything."""
    data = standing(robot)
    soles = {geom for sole in robot.soles for geom in sole.geom_ids}
    for contact in data.contact:
        assert contact.geom1 == robot.ground_geom_id and contact.geom2 in soles
        assert -1e-6 < contact.dist <= 0


def test_com_is_where_the_ankles_can_hold_it(robot: Robot) -> None:
    """The standing CoM is within 2 cm of the middle of what ankle torque and sole allow."""
    data = standing(robot)
    com = data.subtree_com[robot.root_body_id]
    assert com[2] == pytest.approx(robot.height_com, abs=1e-9)
    weight = robot.mass * 9.81
    reach = []
    for sole, (position, _) in zip(robot.soles, sole_poses(robot, data), strict=True):
        body = sole.body_id
        while True:  # the ankle axis that pitches, which may sit one body above the foot
            joints = robot.model.body_jntadr[body] + np.arange(robot.model.body_jntnum[body])
            pitch = [j for j in joints if abs(data.xaxis[j, 1]) > 0.9]
            if pitch:
                break
            body = robot.model.body_parentid[body]
        motor = list(robot.motor_dofs).index(robot.model.jnt_dofadr[pitch[0]])
        arm = 2 * robot.torque_limit[motor] / weight
        ankle = data.xanchor[pitch[0], 0]
        ends = position[0] + sole.polygon[:, 0]
        reach.append((max(ends.min(), ankle - arm), min(ends.max(), ankle + arm)))
    assert abs(com[0] - np.mean(reach)) < 0.02
    assert abs(com[1]) < 1e-6


def test_ctrl_is_joint_torque(robot: Robot) -> None:
    """A control of 1 makes 1 N·m on the motor's own dof; the limits are the control range."""
    model, data = robot.model, standing(robot)
    assert list(robot.motor_dofs) == sorted(set(robot.motor_dofs))
    for i, dof in enumerate(robot.motor_dofs):
        data.ctrl[:] = 0
        data.ctrl[i] = 1
        mujoco.mj_fwdActuation(model, data)
        expected = np.zeros(model.nv)
        expected[dof] = 1
        np.testing.assert_array_equal(data.qfrc_actuator, expected)
    data.ctrl[:] = 1e6
    mujoco.mj_fwdActuation(model, data)
    np.testing.assert_array_equal(data.qfrc_actuator[robot.motor_dofs], robot.torque_limit)


def test_joints_are_in_dof_order(robot: Robot) -> None:
    """Names and ranges follow the dofs after the free joint; the posture is inside the ranges."""
    model = robot.model
    assert len(robot.joint_names) == len(robot.joint_range) == model.nv - 6
    for i, name in enumerate(robot.joint_names):
        assert model.joint(name).dofadr[0] == 6 + i
        assert model.joint(name).qposadr[0] == 7 + i
    q = robot.standing_qpos[7:]
    assert np.all(robot.joint_range[:, 0] <= q) and np.all(q <= robot.joint_range[:, 1])


def test_contact_sensors(robot: Robot) -> None:
    """Each foot counts its own contacts with the ground; the rest belongs to other bodies."""
    model, data = robot.model, standing(robot)
    left, right = (robot.sensor_adr[sole.name] for sole in robot.soles)
    ground = robot.sensor_adr["ground"]
    assert data.sensordata[left] == data.sensordata[right] == data.ncon / 2
    assert data.sensordata[ground] == data.ncon

    data.qpos[2] = robot.standing_qpos[2] + 1
    mujoco.mj_forward(model, data)
    assert not data.sensordata[[ground, left, right]].any()

    lying = Rotation.from_euler("y", 90, degrees=True)
    data.qpos[3:7] = (lying * Rotation.from_quat(data.qpos[3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    data.qpos[2] = 0.05
    mujoco.mj_forward(model, data)
    assert data.sensordata[ground] > data.sensordata[left] + data.sensordata[right]


def test_contact_sensor_counts_the_foots_children(tmp_path: Path) -> None:
    """Contacts of bodies that hang on the foot body count as the foot's."""
    robot = load_robot(write_biped(tmp_path, foot=f"<body>{BOX_FOOT}</body>"))
    assert standing(robot).sensordata[robot.sensor_adr["left"]] == 4


def test_standing_posture_can_be_held(robot: Robot) -> None:
    """Some contact forces hold the standing posture with half of each motor's torque.

    A linear program: h = Sᵀτ + Σ Jᵀf with f in the friction pyramid at the polygon's vertices,
    least largest |τ|/limit.
    """
    model, data = robot.model, standing(robot)
    rows = []
    for sole, (position, axes) in zip(robot.soles, sole_poses(robot, data), strict=True):
        for vertex in sole.polygon:
            jacobian = np.zeros((3, model.nv))
            point = position + axes @ [*vertex, 0.0]
            mujoco.mj_jac(model, data, jacobian, None, point, sole.body_id)
            rows.append(jacobian)
    friction = model.geom_friction[robot.soles[0].geom_ids[0], 0]
    nu, nf = model.nu, len(rows)
    effort = np.zeros((model.nv, nu))
    effort[robot.motor_dofs, np.arange(nu)] = robot.torque_limit
    pyramid = np.array(
        [[1, 0, -friction], [-1, 0, -friction], [0, 1, -friction], [0, -1, -friction]]
    )
    bounds = np.zeros((2 * nu + 4 * nf, nu + 3 * nf + 1))
    bounds[:nu, :nu], bounds[nu : 2 * nu, :nu] = np.eye(nu), -np.eye(nu)
    bounds[: 2 * nu, -1] = -1
    bounds[2 * nu :, nu:-1] = np.kron(np.eye(nf), pyramid)
    result = linprog(
        c=np.eye(nu + 3 * nf + 1)[-1],
        A_ub=bounds,
        b_ub=np.zeros(len(bounds)),
        A_eq=np.hstack([effort, np.vstack(rows).T, np.zeros((model.nv, 1))]),
        b_eq=data.qfrc_bias - data.qfrc_passive,
        bounds=(None, None),
    )
    assert result.success, "no forces hold the posture"
    assert result.fun < 0.5


def test_arrays_are_read_only(robot: Robot) -> None:
    """Nobody changes a robot that others use."""
    for array in (robot.standing_qpos, robot.torque_limit, robot.soles[0].polygon):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def paired_biped(folder: Path, friction: float) -> Path:
    """A biped whose soles collide with this friction, as an explicit contact pair."""
    pair = f'<pair geom1="left_sole" geom2="right_sole" friction="{friction} {friction} 0 0 0"/>'
    return write_biped(folder, extra=motors(ctrlrange="-9 9") + f"<contact>{pair}</contact>")


def test_fingerprint_follows_the_dynamics(tmp_path: Path) -> None:
    """The same description gives the same one; mass, friction, posture and contact pairs count."""
    names = ("same", "again", "mass", "friction", "posture", "pair", "other pair")
    folders = {name: tmp_path / name for name in names}
    for folder in folders.values():
        folder.mkdir()
    posture = {"joints": {"*_hip": -20, "*_knee": 41, "*_ankle": -21}}
    paths = {
        "same": write_biped(folders["same"]),
        "again": write_biped(folders["again"], name="another name"),
        "mass": write_biped(folders["mass"], trunk='<geom size="0.01" mass="0.1"/>'),
        "friction": write_biped(folders["friction"], options={"friction": 0.5}),
        "posture": write_biped(folders["posture"], posture=posture),
        "pair": paired_biped(folders["pair"], 0.5),
        "other pair": paired_biped(folders["other pair"], 0.4),
    }
    prints = {name: load_robot(path).fingerprint for name, path in paths.items()}
    assert prints["same"] == prints["again"]
    assert len(set(prints.values())) == 6


def test_options_replace_the_models(tmp_path: Path) -> None:
    """Time step, integrator and solver are those of the description, 2 ms by default."""
    opt = load_robot(write_biped(tmp_path)).model.opt
    assert opt.timestep == 0.002
    assert opt.integrator == int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    assert opt.solver == int(mujoco.mjtSolver.mjSOL_NEWTON)
    options = {"timestep": 0.001, "integrator": "Euler", "solver": "CG"}
    opt = load_robot(write_biped(tmp_path, options=options)).model.opt
    assert opt.timestep == 0.001
    assert opt.integrator == int(mujoco.mjtIntegrator.mjINT_EULER)
    assert opt.solver == int(mujoco.mjtSolver.mjSOL_CG)


BALL = '<body name="ball"><joint type="ball"/><geom size="0.02"/></body>'
WELD = '<equality><weld body1="left_shin" body2="right_shin"/></equality>'
WRONG = [
    ({"root": "torso"}, ["root", "'torso'", "trunk", "left_foot"]),
    ({"root": "left_thigh"}, ["root", "free joint", "trunk"]),
    ({"root_joint": ""}, ["root", "free joint"]),
    ({"trunk": BALL}, ["ball joints"]),
    ({"extra": WELD}, ["closed kinematic loops"]),
    (
        {"world": "<body><joint/><geom size='0.02'/></body>"},
        ["root", "moving parts other than the robot", "hinge joint"],
    ),
    ({"world": BALL.replace("<joint type='ball'/>", "<freejoint/>")}, ["root"]),
    ({"leg": LEG.replace('axis="0 1 0"', 'axis="0 0 0"')}, ["biped.xml does not compile"]),
    ({"feet": []}, ["feet", "two feet"]),
    ({"feet": [{"name": "l", "body": "left_foot"}]}, ["feet", "two feet"]),
    ({"feet": [{"name": "l", "body": "x"}, {"name": "r", "body": "right_foot"}]}, ["feet[0]"]),
    ({"feet": [{"name": "l", "body": "trunk"}, {"name": "r", "body": "left_foot"}]}, ["no limb"]),
    ({"legs": 2}, ["legs", "unknown field", "feet"]),
    ({"source": {"mjcf": "none.xml"}}, ["source.mjcf", "no such file", "none.xml"]),
    ({"source": {"builder": "android"}}, ["source.builder", "humanoid"]),
]


@pytest.mark.parametrize(("change", "words"), WRONG, ids=lambda value: str(value)[:40])
def test_wrong_descriptions(tmp_path: Path, change: dict, words: list[str]) -> None:
    """What does not fit gives one line with the file, the field and the choices."""
    path = write_biped(tmp_path, **change)
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    text = str(caught.value)
    assert "\n" not in text
    for word in [str(path), *words]:
        assert word in text


def test_unknown_robot_lists_names() -> None:
    """A robot that does not exist is refused with the names of those that do."""
    with invalid("robot", "tall", "toddler", "unitree_g1"):
        load_robot("atlas")


def test_where_the_centre_of_mass_is_ahead_of_the_soles() -> None:
    """As MuJoCo has it in the standing posture, whose soles are about the origin."""
    for name in ("humanoid", "tall"):
        robot = load_robot(name)
        data = mujoco.MjData(robot.model)
        data.qpos[:] = robot.standing_qpos
        mujoco.mj_forward(robot.model, data)
        com = data.subtree_com[robot.root_body_id]
        assert robot.com_ahead == pytest.approx(com[0], abs=1e-12) and abs(com[0]) > 0.01
