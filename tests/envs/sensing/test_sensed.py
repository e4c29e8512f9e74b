"""envs/sensing/sensed.py: environments in a level of realism."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.servos import drive
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import replicate
from poise.envs.balance.vector.vector_env import BalanceVectorEnv
from poise.envs.physics.state_source import StateSource
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.realism import Realism, load_realism
from tests.support.refused import invalid
from tests.support.sensing import PLAIN
from tests.support.shared import robot

PUSH = {"impulse": 8.0, "direction": 30.0, "start": 0.05}
LATE = {"latency": {"sense": 0.02}}


def play(env: BalanceEnv, steps: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Observations and final position of a pushed episode without action."""
    seen = [env.reset(seed=3, options={"push": PUSH})[0]]
    for _ in range(steps):
        seen.append(env.step(np.zeros(env.action_space.shape))[0])
    return np.array(seen), env.simulation.state.qpos.copy()


@pytest.fixture(scope="module")
def pd() -> ResidualBalanceEnv:
    return ResidualBalanceEnv(robot(), controller="pd", duration=1.0, pushes=None)


@pytest.fixture(scope="module")
def limp() -> TorqueBalanceEnv:
    return TorqueBalanceEnv(robot(), duration=1.0)


def under(env: BalanceEnv, level: object) -> BalanceEnv:
    env.realism = load_realism(level)
    return env


def test_the_ideal_world_has_no_layer(limp):
    """A plain source and no kernels, also when the environment has been in another level."""
    for env in (TorqueBalanceEnv(robot()), under(under(limp, "field"), "ideal")):
        assert type(env.state_source) is StateSource and env.realism.ideal and env.drawn is None
        assert env.simulation.model is env.robot.model
        programs = env.simulation.motors, env.simulation.sensors, env.state_source.estimate
        assert all(len(program.rows) == 0 for program in programs)
        assert "realism" not in env.reset(seed=0)[1]
        with invalid("realism", source="reset"):
            env.reset(options={"realism": {"latency": {"sense": 0.01}}})


def test_one_seed_is_one_robot_one_start_and_one_push(limp):
    """For every environment and controller; start and push are those of the ideal world."""
    ideal = ResidualBalanceEnv(robot())
    _, first = ideal.reset(seed=11)
    start, told = ideal.data.qpos.copy(), []
    for env in (
        ResidualBalanceEnv(robot(), realism="field"),
        ResidualBalanceEnv(robot(), controller="pd", realism="field"),
        PositionBalanceEnv(robot(), realism="field"),
        under(limp, "field"),
    ):
        _, info = env.reset(seed=11)
        np.testing.assert_array_equal(env.data.qpos, start)
        assert info["push"] == first["push"]
        told.append(info["realism"])
    assert told == 4 * [told[0]] and told[0]["level"] == "field" and told[0]["sense_delay"] > 0.0
    assert limp.reset()[1]["realism"] != told[0]  # the next one is another


def test_fields_are_fixed_at_a_reset(limp):
    """For this episode; what is wrong is named."""
    under(limp, "field")
    options = {"realism": {"latency": {"sense": 0.014}, "ground": {"slope": 0.0}}}
    told = limp.reset(seed=1, options=options)[1]["realism"]
    assert told["sense_delay"] == pytest.approx(0.014) and told["slope"] == 0.0
    assert limp.reset(seed=1)[1]["realism"]["sense_delay"] <= 0.01
    for given, message in (
        ({"latency": {"sens": 0.01}}, "reset: realism: latency.sens: .*sense"),
        ({"latency": {"sense": 0.05, "command": 0.05}, "motors": {"lag": 0.1}}, "at most 0.124 s"),
        (0.01, "reset: realism: must be a mapping, not 0.01"),
        ({"ground": {"bumps": 0.01}}, "ground.bumps: the environment's realism has no bumps"),
    ):
        with pytest.raises(ConfigError, match=message):
            limp.reset(options={"realism": given})


def test_bumps_come_and_go_with_the_level(limp):
    """Built for levels that have them; the robot is otherwise the one of the level without."""
    told = under(limp, "field").reset(seed=2)[1]["realism"]
    geoms = limp.model.ngeom
    bumpy = under(limp, {"base": "field", "ground": {"bumps": [0.01, 0.02]}})
    more = bumpy.reset(seed=2)[1]["realism"]
    assert limp.model.ngeom > geoms + 50 and 0.01 <= more.pop("bumps") <= 0.02
    assert {**more, "level": "field"} == told
    assert limp.reset(seed=2, options={"realism": {"ground": {"bumps": 0.0}}})[1]["realism"] == more
    assert under(limp, "lab").model.ngeom == geoms == under(limp, "ideal").model.ngeom
    stairs = TorqueBalanceEnv(robot(), terrain="stairs", realism="lab")
    with pytest.raises(ConfigError, match="ground.bumps: only on level ground"):
        under(stairs, {"ground": {"bumps": 0.01}})
    assert stairs.realism.name == "lab"


@pytest.mark.parametrize(
    ("terrain", "unseen"),
    [({"kind": "slope"}, False), ({"kind": "slope", "unseen": True}, True), ("bumps", True)],
)
def test_what_nobody_sees_is_not_believed(terrain, unseen):
    """Known surfaces are in the model that is led on, unseen ones are not."""
    source = TorqueBalanceEnv(robot(), terrain=terrain, realism="lab").state_source
    assert source.ahead.robot.terrain.flat == source.known.robot.terrain.flat == unseen


def test_a_level_is_checked_when_it_is_set(limp):
    """By an environment's configuration as by its property; the level before stays."""
    under(limp, "lab")
    long = {"latency": {"sense": 0.05, "command": 0.05}, "motors": {"lag": 0.1}}
    with invalid("latency", "0.124 s"):
        under(limp, long)
    assert limp.realism.name == "lab"
    with invalid("realism", "'moon'"):
        TorqueBalanceEnv(robot(), realism="moon")
    with invalid("estimator.kind"):
        TorqueBalanceEnv(robot(), estimator="guess")


@pytest.mark.parametrize("controller", ["momentum-qp", "pd"])
def test_perfect_sensors_change_nothing(controller):
    """The same path as without sensors, of a compiled controller and of one called from Python."""
    env = ResidualBalanceEnv(robot(), controller=controller, duration=1.0, pushes=None)
    seen, end = play(env)
    seen_other, end_other = play(under(env, PLAIN))
    assert isinstance(env.state_source, EstimatedState)
    assert seen_other == pytest.approx(seen, abs=1e-5)
    assert end_other == pytest.approx(end, abs=1e-6)


def test_the_policy_sees_late_observations():
    """With one policy step of delay every observation is that of one step before."""
    env = TorqueBalanceEnv(robot(), duration=1.0, pushes=None, estimator={"predictor": "none"})
    (seen, end), (late, end_late) = play(under(env, PLAIN), 8), play(under(env, LATE), 8)
    assert np.array_equal(end, end_late)  # the torques are zero, whatever is seen
    np.testing.assert_allclose(late[2:], seen[1:-1], atol=1e-6)
    assert not np.allclose(seen, late, atol=1e-6)
    assert np.array_equal(play(under(env, Realism()), 8)[1], end)


def test_a_late_controller_acts_on_what_it_sees(pd):
    """Before the delay has passed the push is unknown; then it is answered, too late."""
    end = play(under(pd, "ideal"))[1]
    assert not np.allclose(end, play(under(pd, LATE))[1], atol=1e-6)
    assert not np.allclose(end, play(under(pd, {"body": {"scale": 0.1}}))[1], atol=1e-6)


@pytest.mark.parametrize("kind", [TorqueBalanceEnv, ResidualBalanceEnv, ResidualStepEnv])
def test_real_environments_run_compiled(kind):
    """A level takes no step to Python, and a compiled tick sees what one from Python does."""
    env = kind(robot(), duration=1.0, pushes=None, realism="lab")
    env.reset(seed=0)
    assert env.compiled_step() is not None
    if kind is TorqueBalanceEnv:
        return
    seen, end = play(env, 8)
    env._compiled = False
    seen_python, end_python = play(env, 8)
    np.testing.assert_allclose(seen_python, seen, atol=1e-6)
    np.testing.assert_allclose(end_python, end, atol=1e-8)


def test_servos_go_by_their_own_present_readings():
    """An external policy sees late joints; its motors' encoders err by their bias, and are not
    late."""
    level = {"sensors": {"encoder_bias": 0.05}, **LATE}
    env = PositionBalanceEnv(robot(), pushes=None, realism=level, estimator={"predictor": "none"})
    env.reset(seed=2)
    rng = np.random.default_rng(1)
    for _ in range(5):
        env.step(rng.uniform(-0.3, 0.3, env.action_space.shape))
    servos, world, dofs = env.servos, env.simulation.world(), robot().motor_dofs
    q, dq = env.data.qpos[dofs + 1], env.data.qvel[dofs]
    read = q + env.drawn.encoder_bias[dofs - 6]
    torque = servos.stiffness * (servos.target - read) - servos.damping * dq
    drive(servos, world)
    np.testing.assert_allclose(
        env.data.ctrl, np.clip(torque, -servos.limit, servos.limit), atol=1e-9
    )
    believed = env.state_source.state
    assert abs(believed.q - env.simulation.state.q).max() > 1e-3
    np.testing.assert_allclose(believed.motor_q[dofs - 6], read, atol=1e-12)


def test_threads_change_no_bit():
    """Of environments in `field`, each with its own robot and its own noise."""
    ends = []
    for threads in (1, 2):
        envs = replicate(ResidualBalanceEnv(robot(), realism="field", duration=0.3), 3)
        many = BalanceVectorEnv(envs, threads)
        many.reset(seed=4)
        rng = np.random.default_rng(0)
        seen = [
            many.step(rng.uniform(-0.3, 0.3, many.action_space.shape).astype(np.float32))[0]
            for _ in range(20)
        ]
        ends.append((np.array(seen), [env.data.qpos.copy() for env in envs]))
        many.close()
    assert np.array_equal(ends[0][0], ends[1][0]) and np.array_equal(ends[0][1], ends[1][1])
    first, second = ends[0][1][:2]
    assert not np.allclose(first, second, atol=1e-6)


def test_the_fall_is_judged_by_the_truth(limp):
    """A limp robot falls when it does, however late that is known."""
    falls = []
    for level in (PLAIN, {"latency": {"sense": 0.05}}):
        under(limp, level).reset(seed=0, options={"noise": 0.0, "push": []})
        while limp.episode.running:
            limp.step_without_info(np.zeros(limp.action_space.shape))
        falls.append(limp.steps)
    assert limp.fallen and falls[0] == falls[1]
