"""The observation against the quantities of RobotState, index by index."""

import numpy as np
import pytest

from poise.envs.balance.mdp.observation import (
    Terms,
    View,
    mirror_terms,
    observation_table,
    observer,
    scales,
    term_table,
)
from poise.envs.balance.mdp.terms import TERMS
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.compiled.calls import Program, run
from tests.support.refused import invalid
from tests.support.shared import generic_state, robot


def terms_of(r, actions, names=None):
    """The terms of a robot, by default those that are on."""
    sizes = {
        "joints": r.joint_names,
        "motors": r.motor_names,
        "feet": tuple(sole.name for sole in r.soles),
        "actions": actions,
    }
    return [kind.of(sizes) for kind in TERMS.choose(names)]


def observed(simulation, q_ref, v_ref, action, names=None):
    """The observation as a mapping from term to its numbers."""
    terms = terms_of(simulation.robot, tuple(f"a{i}" for i in range(len(action))), names)
    whole = np.full(sum(term.size for term in terms), np.nan)
    standing = type(simulation)(simulation.robot).state.support_polygon
    world = simulation.world()

    def view(kind, out):
        return View(
            robot=simulation.arrays,
            state=simulation.state_arrays,
            scales=scales(simulation.arrays, standing),
            q_ref=q_ref,
            v_ref=v_ref,
            action=action,
            views=world.views,
            clock=world.clock,
            pushes=world.pushes,
            out=out,
        )

    run(Program.of(observer(terms, whole, np.zeros(1, dtype=np.int64), view)))
    ends = np.cumsum([term.size for term in terms])
    return dict(zip([term.name for term in terms], np.split(whole, ends[:-1]), strict=True))


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact"])
def test_every_term_is_what_its_name_says(name):
    """At a pushed state that faces another way, each term equals its definition."""
    simulation = generic_state(name)
    state, r = simulation.state, robot(name)
    rng = np.random.default_rng(1)
    q_ref, v_ref = state.q + rng.normal(0, 0.1, len(state.q)), rng.normal(0, 0.5, len(state.q))
    action = rng.uniform(-1.0, 1.0, 4)
    terms = observed(simulation, q_ref, v_ref, action)

    yaw = state.heading_yaw
    assert abs(yaw) > 0.3  # else the frames would not be told apart
    to_heading = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    polygon = type(simulation)(r).state.support_polygon
    half = (polygon.max(axis=0) - polygon.min(axis=0)) / 2
    h, g, m = r.height_com, 9.81, r.mass
    omega = np.sqrt(g / h)

    def ground(point):
        return to_heading @ (point[:2] - state.origin[:2]) / half

    def space(vector):
        return np.append(to_heading @ vector[:2], vector[2])

    expected = {
        "com": ground(state.com),
        "com_height": [(state.com[2] - state.origin[2] - h) / (0.1 * h)],
        "capture_point": ground(state.capture_point),
        "cop": ground(state.cop),
        "com_vel": space(state.com_vel) / (0.2 * omega * h),
        "angular_momentum": space(state.angular_momentum) / (0.1 * m * h**2 * omega),
        "gravity": state.root_axes.T @ [0.0, 0.0, -1.0],
        "root_rate": state.qvel[3:6] / omega,
        "load": [state.contact_wrench[2] / (m * g) - 1.0],
        "joint_pos": state.q - q_ref,
        "joint_vel": (state.qvel[6:] - v_ref) / (3.0 * omega),
        "contacts": state.contacts,
        "last_action": action,
    }
    assert list(terms) == list(expected)
    terms |= observed(simulation, q_ref, v_ref, action, ["root_vel"])
    expected["root_vel"] = state.root_axes.T @ state.qvel[:3] / (0.2 * omega * h)
    for term, value in expected.items():
        np.testing.assert_allclose(terms[term], np.clip(value, -10, 10), atol=1e-9, err_msg=term)
        if term != "contacts":
            assert np.abs(terms[term]).max() > 1e-4, f"{term} is not tested at zero"


def test_the_observation_does_not_depend_on_place_and_heading():
    """A robot that stands elsewhere and faces another way sees the same."""
    r = robot()
    still = np.zeros(len(r.joint_names))
    here = type(generic_state())(r)
    there = type(here)(r)
    qpos = r.standing_qpos.copy()
    q = qpos[3:7].copy()
    qpos[3:7] = np.cos(1.0) * q + np.sin(1.0) * np.array([-q[3], -q[2], q[1], q[0]])
    cos, sin = np.cos(2.0), np.sin(2.0)
    x, y = qpos[:2]
    qpos[:2] = [3.0 + cos * x - sin * y, -2.0 + sin * x + cos * y]
    there.reset(qpos)
    assert abs(there.state.heading_yaw - 2.0) < 1e-9
    a = observed(here, r.standing_qpos[7:], still, np.zeros(4))
    b = observed(there, r.standing_qpos[7:], still, np.zeros(4))
    for term in a:
        np.testing.assert_allclose(a[term], b[term], atol=1e-4, err_msg=term)


def test_the_observation_is_clipped():
    """No entry leaves the observation space, however fast the robot."""
    simulation = generic_state()
    q = simulation.state.q
    terms = observed(simulation, q - 50.0, np.full(len(q), 1e6), np.zeros(4))
    assert np.all(terms["joint_pos"] == 10.0) and np.all(terms["joint_vel"] == -10.0)


def test_scales_of_the_standing_robot():
    """Half extents, height and rate are those of the robot."""
    simulation = type(generic_state())(robot())
    scale = scales(simulation.arrays, simulation.state.support_polygon)
    polygon = simulation.state.support_polygon
    assert 2 * scale.support_x == pytest.approx(np.ptp(polygon[:, 0]))
    assert 2 * scale.support_y == pytest.approx(np.ptp(polygon[:, 1]))
    assert scale.omega == pytest.approx(simulation.state.omega)
    assert scale.weight == pytest.approx(robot().mass * 9.81)


def test_the_table_has_one_row_per_index():
    """Rows count from 0 and name the entries of each term."""
    terms = terms_of(robot(), ("push",))
    rows = observation_table(terms).splitlines()[2:]
    assert [int(row.split("|")[1]) for row in rows] == list(range(sum(t.size for t in terms)))
    assert rows[20].startswith(f"| 20 | joint_pos | {robot().joint_names[0]} | rad |")
    assert rows[-1] == "| 64 | last_action | push | 1 | action of the step before |"


def test_the_docstring_has_the_terms():
    """A row for each term that there is, on by default or not."""
    for kind in TERMS.values():
        assert term_table([kind]).splitlines()[2] in TorqueBalanceEnv.__doc__, kind.name


def test_the_configuration_chooses_the_terms():
    """In the order of the list; extra ones come last; the mirror and the space follow."""
    chosen = {"terms": ["last_action", "com"], "extra": ["gravity"]}
    env = TorqueBalanceEnv(robot(), pushes=None, observation=chosen)
    assert [term.name for term in env.terms] == ["last_action", "com", "gravity"]
    nu = robot().model.nu
    assert env.observation_space.shape == (nu + 2 + 3,)
    observation, _ = env.reset(seed=0)
    whole, _ = TorqueBalanceEnv(robot(), pushes=None).reset(seed=0)
    np.testing.assert_array_equal(observation[nu:], [*whole[:2], *whole[13:16]])
    observation = env.step(np.full(nu, 0.1))[0]
    np.testing.assert_array_equal(observation[:nu], np.float32(0.1))
    assert env.mirrors()[0].order.shape == env.observation_space.shape


def test_an_observation_of_several_steps():
    """Oldest first; the first one stands for the time before it, also of the next episode."""
    chosen = {"terms": ["last_action", "com_vel", "joint_pos"], "history": 3}
    env = TorqueBalanceEnv(robot(), pushes=None, observation=chosen)
    single = TorqueBalanceEnv(robot(), pushes=None, observation={"terms": chosen["terms"]})
    rng = np.random.default_rng(8)
    for _ in range(2):
        first = single.reset(seed=4)[0]
        kept = [first, first, first]
        np.testing.assert_array_equal(env.reset(seed=4)[0], np.concatenate(kept))
        for _ in range(4):
            action = rng.uniform(-0.3, 0.3, env.action_space.shape)
            kept = [*kept[1:], single.step(action)[0]]
            np.testing.assert_array_equal(env.step(action)[0], np.concatenate(kept))
    names = [term.name for term in env.terms]
    assert names[:2] == ["last_action[-2]", "com_vel[-2]"] and names[-1] == "joint_pos"
    seen, _ = env.mirrors()
    one, _ = single.mirrors()
    whole = rng.normal(size=env.observation_space.shape)
    expected = np.concatenate([one(frame) for frame in np.split(whole, 3)])
    np.testing.assert_array_equal(seen(whole), expected)


def test_privileged_terms_are_of_the_true_robot():
    """They come last, of this step alone; what is believed comes first, with its history."""
    names = ["com", "com_vel", "mass", "friction", "push"]
    chosen = {"terms": ["com", "com_vel"], "history": 2, "privileged": names}
    env = TorqueBalanceEnv(robot(), realism="field", observation=chosen)
    blind = TorqueBalanceEnv(
        robot(), realism="field", observation={"terms": ["com", "com_vel"], "history": 2}
    )
    push = {"force": 60.0, "direction": 30.0, "start": 0.0, "duration": 0.5, "body": "torso"}
    options = {"push": push, "realism": {"body": {"scale": 0.1}, "ground": {"friction": 0.45}}}
    seen, _ = blind.reset(seed=2, options=options)
    whole, _ = env.reset(seed=2, options=options)
    assert [t.name for t in env.terms[-5:]] == [f"true_{name}" for name in names]
    assert env.seen == len(seen) == 10 and len(whole) == 10 + 2 + 3 + 1 + 1 + 3
    np.testing.assert_array_equal(whole[:10], seen)
    for _ in range(4):
        action = np.full(env.action_space.shape, 0.05)
        np.testing.assert_array_equal(env.step(action)[0][:10], blind.step(action)[0])
    true = env.episode.observation[10:]
    s, scale = env.simulation.state, env.scales
    along = np.array([[s.heading[0], s.heading[1]], [-s.heading[1], s.heading[0]]])
    com = along @ (s.com - s.origin)[:2] / [scale.support_x, scale.support_y]
    velocity = [*(along @ s.com_vel[:2]), s.com_vel[2]] / np.float64(scale.velocity)
    np.testing.assert_allclose(true[:2], com, atol=1e-12)
    np.testing.assert_allclose(true[2:5], velocity, atol=1e-12)
    assert np.abs(true[:2] - env.episode.observation[5:7]).max() > 1e-3  # it is not the belief
    mass = sum(env.simulation.model.body_mass) / sum(robot().model.body_mass)
    np.testing.assert_allclose(true[5], mass - 1.0, atol=1e-9)
    assert true[5] > 0.05 and true[6] == 0.45
    force = [60.0 * np.cos(np.pi / 6.0), 60.0 * np.sin(np.pi / 6.0), 0.0]  # where it began
    np.testing.assert_allclose(true[7:], force / np.float64(scale.weight), atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(true[7:]), 60.0 / scale.weight, atol=1e-12)


MEASURED = ["measured_gravity", "measured_rate", "measured_joint_pos", "measured_joint_vel"]
BELIEVED = ["gravity", "root_rate", "joint_pos", "joint_vel"]


def test_measurements_are_late_and_what_is_believed_is_not():
    """Exact sensors that are 8 ms late tell what was true two ticks before, whatever leads on."""
    level = {"latency": {"sense": 0.008}}
    env = TorqueBalanceEnv(robot(), realism=level, observation={"terms": MEASURED})
    ideal = TorqueBalanceEnv(robot(), observation={"terms": MEASURED + BELIEVED})
    nj = len(robot().joint_names)
    before, _ = ideal.reset(seed=5)
    np.testing.assert_array_equal(before[: 6 + 2 * nj], before[6 + 2 * nj :])
    env.reset(seed=5)
    data, steps, rows = env.simulation.data, [], env.state_source.sensors.rings
    rng = np.random.default_rng(1)
    for _ in range(5):
        env.step(rng.uniform(-0.2, 0.2, env.action_space.shape))
        now = (rows.next - 1) % len(rows.q)
        np.testing.assert_array_equal(rows.q[now], data.qpos[7:])
        then = rows.q[now - 4], rows.dq[now - 4], rows.gyro[now - 4], rows.attitude[now - 4]
        steps.append(np.abs(then[1] - data.qvel[6:]).max())
        omega = env.scales.omega
        expected = [-then[3][2], then[2] / omega, then[0] - env._references()[0],
                    then[1] / (3.0 * omega)]  # fmt: skip
        np.testing.assert_allclose(env.episode.observation, np.concatenate(expected), atol=1e-12)
    assert min(steps) > 0.01  # what is late is not what is true now


def test_measurements_are_as_noisy_as_sensors():
    """In `field` joint velocities are off by 0.2 rad/s from what was true when they were taken."""
    env = TorqueBalanceEnv(robot(), realism="field", observation={"terms": MEASURED + BELIEVED})
    env.reset(seed=6, options={"push": []})
    errors, nj, rings = [], len(robot().joint_names), env.state_source.sensors.rings
    for _ in range(10):
        seen = env.step(np.zeros(env.action_space.shape))[0] * 3.0 * env.scales.omega
        row = (rings.next - 1 - env.drawn.sense) % len(rings.q)
        errors.append(seen[6 + nj : 6 + 2 * nj] - rings.truth_qvel[row, 6:])
        assert np.abs(seen[6 + nj : 6 + 2 * nj] - seen[-nj:]).max() > 0.1  # of what is believed
    assert 0.17 < np.std(errors) < 0.23 and abs(np.mean(errors)) < 0.05


@pytest.mark.parametrize(
    ("chosen", "error"),
    [
        ({"privileged": ["measured_rate"]}, ("privileged", "'measured_rate'", "root_rate")),
        ({"privileged": ["mas"]}, ("privileged", "'mas'", "friction")),
        ({"privileged": ["com", "com"]}, (None, "'com'", "twice")),
        ({"history": 0}, ("history", "at least 1")),
        ({"terms": ["com", "comm"]}, ("terms", "'comm'", "com_height")),
        ({"extra": ["push me"]}, ("extra", "'push me'")),
        ({"extra": ["com"]}, (None, "'com'", "twice")),
        ({"terms": []}, ("terms", "at least one")),
        ({"terms": "com"}, ("terms", "a list", "'com'")),
    ],
)
def test_wrong_terms_are_refused(chosen, error):
    """Unknown, twice or none; the line names the choices."""
    field, *values = error
    with invalid("observation" if field is None else f"observation.{field}", *values):
        TorqueBalanceEnv(robot(), observation=chosen)


def test_a_term_is_one_function():
    """Whatever fills `out` can be a term: its entries, unit, meaning and image are told once."""
    terms = Terms()

    @terms.add(("n", "m"), "1", "squared", "number")
    def square(v: View):
        v.out[0], v.out[1] = v.action[0] ** 2, v.action[1] ** 2

    (term,) = [kind.of({}) for kind in terms.choose(None)]
    assert (term.name, term.size, term.unit) == ("square", 2, "1")
    out, simulation = np.zeros(2), generic_state()
    blank = np.zeros(1)

    def view(kind, out):
        scale = scales(simulation.arrays, simulation.state.support_polygon)
        world = simulation.world()
        action = np.array([3.0, 4.0])
        return View(
            simulation.arrays, simulation.state_arrays, scale, blank, blank, action,
            world.views, world.clock, world.pushes, out,
        )  # fmt: skip

    run(Program.of(observer([term], out, np.zeros(1, dtype=np.int64), view)))
    assert out.tolist() == [9.0, 10.0]  # clipped
    assert mirror_terms([term], {}).sign.tolist() == [1.0, 1.0]


def test_a_term_cannot_take_the_name_of_another():
    terms = Terms(TERMS)
    with pytest.raises(ValueError, match="joint_pos"):

        @terms.add(("n",), "1", "another", "number")
        def joint_pos(v: View):
            v.out[0] = 0.0


def test_the_push_that_acts_is_observed():
    """Its force in the heading frame over the weight, while it acts; a half-sine's at its phase."""
    env = TorqueBalanceEnv(robot(), pushes=None, observation={"terms": ["push"]})
    still = np.zeros(env.action_space.shape)
    pushes = [
        {"force": 60.0, "direction": 90.0, "duration": 0.03, "start": 0.01},
        {"force": 40.0, "duration": 0.04, "start": 0.07, "profile": "half-sine"},
        {"delta_v": 0.1, "start": 0.2},
    ]
    observation, _ = env.reset(seed=0, options={"push": pushes})
    seen = [observation, *(env.step(still)[0] for _ in range(5))]
    left = np.array([0.0, 60.0, 0.0]) / (robot().mass * 9.81)
    ahead = np.array([40.0 * np.sin(np.pi / 4), 0.0, 0.0]) / (robot().mass * 9.81)
    for moment, force in zip(seen, (0.0, left, 0.0, 0.0, ahead, ahead), strict=True):
        # 0.04 s is the end of the first push, 0.08 s and 0.1 s quarters of the second
        np.testing.assert_allclose(moment, np.broadcast_to(force, 3), atol=0.01)
