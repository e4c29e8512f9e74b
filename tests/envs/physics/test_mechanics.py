"""What lecture 8 and 10 of [Notes] say of simulation, held by the simulator that Poise uses."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from poise.baselines.controller import Targets
from poise.baselines.motion.clips.rotations import angle_between, exp, multiply
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, forward, push
from tests.support.shared import robot

ROUND = [int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("SPHERE", "CAPSULE")]


@pytest.fixture(scope="module")
def pushed() -> Simulation:
    """A humanoid that resists a push, at an instant of it."""
    simulation, qp = Simulation(robot()), controller(robot())
    state = simulation.reset(pushes=[push(robot(), 0.3, 60.0)])
    targets = Targets.standing(robot(), state)
    for _ in range(25):
        state = simulation.step(qp.torques(state, targets), 2)
    forward(simulation)
    return simulation


def test_orientations_are_integrated_by_the_exponential_and_normalised() -> None:
    """A step of MuJoCo from q is q Exp(ω dt), however long; a tumbling flight of 2 s leaves the
    root's quaternion at norm 1, and conserves angular momentum about the CoM."""
    model = robot().model
    qpos, qvel = robot().standing_qpos.copy(), np.zeros(model.nv)
    qvel[3:6] = [1.0, -2.0, 0.5]
    before = qpos[3:7].copy()
    mujoco.mj_integratePos(model, qpos, qvel, 1.3)
    assert angle_between(multiply(before, exp(1.3 * qvel[3:6])), qpos[3:7]) < 1e-7
    simulation = Simulation(robot())
    start = robot().standing_qpos.copy()
    start[2] += 30.0
    simulation.reset(start, qvel)
    momenta = []
    for _ in range(1000):
        simulation.step(np.zeros(model.nu))
        mujoco.mj_subtreeVel(model, simulation.data)
        momenta.append(simulation.data.subtree_angmom[1].copy())
        assert np.linalg.norm(simulation.data.qpos[3:7]) == pytest.approx(1.0, abs=1e-12)
    largest = np.linalg.norm(momenta[0])
    # joints run into soft limits, whose work is in the joints: L is of the whole body
    assert np.linalg.norm(momenta[-1] - momenta[0]) < 0.03 * largest


def test_multipliers_lead_drift_back_and_are_softened(pushed: Simulation) -> None:
    """λ = −D (J v̇ − a_ref) with D = 1/R: a constraint force mixing of R, exactly, and a reference
    acceleration a_ref = −b (J v) − k d (r − margin) that leads drift back."""
    data = pushed.data
    J = np.zeros((data.nefc, robot().model.nv))
    J[:] = data.efc_J.reshape(J.shape) if not mujoco.mj_isSparse(robot().model) else dense(data, J)
    force = -data.efc_D * (J @ data.qacc - data.efc_aref)
    assert not robot().model.neq and not robot().model.dof_frictionloss.any()  # all push only
    np.testing.assert_allclose(data.efc_force, np.maximum(force, 0.0), rtol=1e-5, atol=1e-4)
    assert (force > 1.0).sum() > 4
    np.testing.assert_allclose(data.efc_R * data.efc_D, 1.0)
    k, b, impedance = data.efc_KBIP[:, 0], data.efc_KBIP[:, 1], data.efc_KBIP[:, 2]
    led = -b * (J @ data.qvel) - k * impedance * (data.efc_pos - data.efc_margin)
    np.testing.assert_allclose(data.efc_aref, led, rtol=1e-6, atol=1e-6)
    assert (data.efc_R > 0.0).all()  # never hard


def dense(data: mujoco.MjData, out: np.ndarray) -> np.ndarray:
    mujoco.mju_sparse2dense(
        out, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
    )
    return out


def test_contact_forces_solve_a_complementarity_problem(pushed: Simulation) -> None:
    """At every contact 0 ≤ λ ⊥ J v̇ − a_ref + R λ ≥ 0, in the friction cone and its dual: an LCP
    softened by R. A sole whose gap opens bears nothing."""
    model, data = robot().model, pushed.data
    J = np.zeros((data.nefc, model.nv))
    J[:] = data.efc_J.reshape(J.shape) if not mujoco.mj_isSparse(model) else dense(data, J)
    residual = J @ data.qacc - data.efc_aref + data.efc_R * data.efc_force
    loads = 0
    for contact in data.contact:
        if contact.efc_address < 0:
            continue
        rows = slice(contact.efc_address, contact.efc_address + rows_of(model, contact))
        force, gap = data.efc_force[rows], residual[rows]
        if model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL:
            assert (force >= 0.0).all() and (gap >= -1e-6 * np.abs(gap).max() - 1e-6).all()
        else:
            assert force[0] >= 0.0
            assert (
                np.linalg.norm(force[1:3]) <= contact.friction[0] * force[0] * (1.0 + 1e-6) + 1e-9
            )
        assert abs(force @ gap) <= 1e-5 * (np.abs(force) @ np.abs(gap) + 1.0)
        loads += force[0] > 1.0
    assert loads >= 2


def rows_of(model: mujoco.MjModel, contact: mujoco.MjContact) -> int:
    pyramidal = model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    return max(1, 2 * (contact.dim - 1)) if pyramidal else contact.dim


def test_joints_hold_in_generalised_coordinates_without_a_constraint() -> None:
    """At random postures and speeds the point of a joint is at one place, and has one velocity,
    as the body above it and as the body below it have it."""
    model, rng = robot().model, np.random.default_rng(3)
    data = mujoco.MjData(model)
    for _ in range(5):
        data.qpos[:] = robot().standing_qpos
        data.qpos[7:] += rng.uniform(-1.0, 1.0, model.nq - 7)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        for joint in range(1, model.njnt):
            below = int(model.jnt_bodyid[joint])
            above = int(model.body_parentid[below])
            velocities = [
                point_velocity(model, data, b, data.xanchor[joint]) for b in (above, below)
            ]
            # joints of one body that share it move each other's anchors; the first one's stays
            if joint == model.body_jntadr[below]:
                axes = data.xmat[above].reshape(3, 3)
                local = axes.T @ (data.xanchor[joint] - data.xpos[above])
                assert local == pytest.approx(resting_anchor(model, joint), abs=1e-9)
                if model.body_jntnum[below] == 1:
                    np.testing.assert_allclose(*velocities, atol=1e-9)


def resting_anchor(model: mujoco.MjModel, joint: int) -> np.ndarray:
    """Of a joint in the frame of the body above, as the model has it."""
    body = int(model.jnt_bodyid[joint])
    turn = Rotation.from_quat(model.body_quat[body], scalar_first=True)
    return np.asarray(model.body_pos[body] + turn.apply(model.jnt_pos[joint]))


def point_velocity(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, point: np.ndarray
) -> np.ndarray:
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return jacobian @ data.qvel


@pytest.mark.parametrize(("gap", "touches"), [(-0.002, True), (-0.0002, True), (0.0003, False)])
def test_contacts_are_found_where_bodies_touch(gap: float, touches: bool) -> None:
    """At the steps of time alone: from a gap of 0 on. A sole is so thick, and a step so short, that
    none passes through the floor between two steps at any speed of a fall from 2 m."""
    simulation = Simulation(robot())
    qpos = robot().standing_qpos.copy()
    mujoco.mj_resetData(robot().model, simulation.data)
    state = simulation.reset(qpos)
    lowest = min(
        (point + sole.polygon @ axes[:, :2].T)[:, 2].min()
        for point, axes, sole in zip(
            state.sole_points, state.sole_axes, robot().soles, strict=True)
    )  # fmt: skip
    qpos[2] += gap - (lowest - state.origin[2])
    state = simulation.reset(qpos)
    forward(simulation)
    assert bool(simulation.data.ncon) == touches
    assert np.sqrt(2.0 * 9.81 * 2.0) * robot().model.opt.timestep < thickness()


def thickness() -> float:
    """The least thickness of what a sole touches the ground with [m]."""
    model, soles = robot().model, {sole.body_id for sole in robot().soles}
    sizes = [
        model.geom_size[geom, 0 if model.geom_type[geom] in ROUND else 2]
        for geom in range(model.ngeom)
        if model.geom_bodyid[geom] in soles
    ]
    return float(2.0 * min(sizes))


def test_a_body_rests_exactly_while_its_com_is_over_the_soles() -> None:
    """Forces at the soles' corners that push only can hold the body at rest if and only if the
    CoM's projection is in the support polygon; then the ankles bear m g times its way from them."""
    simulation, rng = Simulation(robot()), np.random.default_rng(1)
    inside = []
    for _ in range(40):
        qpos = robot().standing_qpos.copy()
        lean = Rotation.from_rotvec([*rng.uniform(-0.35, 0.35, 2), 0.0])
        names = [f"{side}_ankle_y" for side in ("left", "right")]
        qpos[7 + np.array([robot().joint_names.index(name) for name in names])] += lean.as_rotvec()[
            1
        ]
        state = simulation.reset(qpos)
        com = state.com[:2] + rng.uniform(-0.15, 0.15, 2)  # also of a body with another load
        corners = np.concatenate([
            point + sole.polygon @ axes[:, :2].T
            for point, axes, sole in zip(
                state.sole_points, state.sole_axes, robot().soles, strict=True)
        ])  # fmt: skip
        weight = robot().mass * 9.81
        balance = np.vstack([np.ones(len(corners)), corners[:, :2].T])
        found = linprog(np.zeros(len(corners)), A_eq=balance, b_eq=weight * np.array([1.0, *com]))
        distance = state.support_distance(com)
        if abs(distance) > 1e-3:
            assert found.success == (distance > 0.0)
            inside.append(found.success)
        if found.success:
            ankles = state.sole_points[:, :2].mean(axis=0)
            torque = found.x @ (corners[:, 0] - ankles[0])
            assert torque == pytest.approx(weight * (com[0] - ankles[0]), abs=1e-6)
    assert {True, False} == set(inside)
