"""What both environments promise: start, pushes, rewards, end, info, errors."""

import gymnasium
import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import EnvConfig, env_config
from poise.envs.balance.mdp.reward import REWARD_TERMS
from poise.envs.balance.plain_info import PlainInfo
from poise.envs.balance.start import RESET_OPTIONS
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.pushes.sampler import PushSampler
from tests.support.refused import invalid
from tests.support.shared import robot

BOTH = pytest.mark.parametrize("make", [ResidualBalanceEnv, TorqueBalanceEnv])
PUSH = {"impulse": 12.0, "direction": 90.0, "duration": 0.1, "start": 0.5, "body": "torso"}
INFO = {
    *("reward_terms", "push", "is_success", "solver_failures", "torque_saturation", "root_wrench"),
}


def zero(env):
    return np.zeros(env.action_space.shape)


def play(env, seed=0, steps=20, options=None, actions=0.3):
    """Observations and rewards of an episode with random actions."""
    observation, _ = env.reset(seed=seed, options=options)
    rng, record = np.random.default_rng(seed), [observation]
    for _ in range(steps):
        action = rng.uniform(-actions, actions, env.action_space.shape)
        observation, reward, terminated, truncated, _ = env.step(action)
        record.append(np.append(observation, reward))
        if terminated or truncated:
            break
    return record


@BOTH
def test_the_same_seed_gives_the_same_bits(make):
    """An episode replays exactly, in the same environment and in another one."""
    env = make(robot())
    first, again, other = play(env, 3), play(env, 3), play(make(robot()), 3)
    different = play(env, 4)
    for a, b, c in zip(first, again, other, strict=True):
        assert np.array_equal(a, b) and np.array_equal(a, c)
    assert not np.array_equal(first[0], different[0])


@BOTH
def test_without_a_seed_episodes_go_on_differently(make):
    """A reset without a seed draws on; the sequence belongs to the first seed."""
    env = make(robot())
    first = [env.reset(seed=1)[0], env.reset()[0], env.reset()[0]]
    again = [env.reset(seed=1)[0], env.reset()[0], env.reset()[0]]
    assert not np.array_equal(first[0], first[1])
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a, b)


@BOTH
def test_reset_sets_exactly_the_push_of_its_options(make):
    """A mapping sets one square push, a list several, [] none."""
    env = make(robot())
    _, info = env.reset(seed=0, options={"push": PUSH})
    assert env.simulation.pushes == (Push("torso", 0.5, 0.1, 12.0, 90.0),)
    (said,) = info["push"]
    assert said == {
        "start": 0.5,
        "force": pytest.approx(120.0),
        "duration": 0.1,
        "body": "torso",
        "direction": 90.0,
        "impulse": 12.0,
        "specific_impulse": pytest.approx(12.0 / robot().mass),
    }
    _, info = env.reset(seed=0, options={"push": [PUSH, {"delta_v": 0.5, "start": 1.0}]})
    assert env.simulation.pushes[1] == Kick(1.0, 0.5, 0.0) and len(info["push"]) == 2
    assert info["push"][1]["impulse"] == pytest.approx(0.5 * robot().mass)
    _, info = env.reset(seed=0, options={"push": []})
    assert env.simulation.pushes == () and info["push"] == []


def test_actions_beyond_1_are_refused_or_clipped():
    """As Gaussian policies give them; alone and among others. A NaN is refused either way."""
    env, clipping = TorqueBalanceEnv(robot()), TorqueBalanceEnv(robot(), clip_action=True)
    many = EnvBatch([TorqueBalanceEnv(robot(), clip_action=True) for _ in range(2)])
    many.reset([0, 0])
    for each in (env, clipping):
        each.reset(seed=0)
    wide = np.full(env.action_space.shape, 1.7)
    with invalid("action"):
        env.step(wide)
    env.step(np.ones_like(wide))
    clipping.step(wide)
    many.step(np.stack([wide, wide]))
    assert np.array_equal(clipping.episode.action, np.ones_like(wide))
    assert np.array_equal(clipping.simulation.data.qpos, env.simulation.data.qpos)
    assert np.array_equal(many.envs[1].simulation.data.qpos, env.simulation.data.qpos)
    with invalid("action"):
        clipping.step(np.full_like(wide, np.nan))


def test_the_specification_has_the_steps_of_an_episode():
    """Of this environment, without a wrapper that cuts it off."""
    for duration, steps in ((6.0, 300), (8.0, 400)):
        env = gymnasium.make("poise/TorqueBalance-v0", duration=duration)
        assert env.spec.max_episode_steps == steps == env.unwrapped.max_steps
        again = gymnasium.make(env.spec)
        assert again.unwrapped.max_steps == steps
        env.close()


def test_the_push_as_arrays():
    """An entry for each push; everything else of `info` is as it was."""
    env = PlainInfo(TorqueBalanceEnv(robot()))
    push = [PUSH, {"delta_v": 0.5, "start": 1.0}]
    _, info = env.reset(seed=0, options={"push": push})
    told, plain = info["push"], env.unwrapped.info()
    assert {key: each.shape for key, each in told.items()} == dict.fromkeys(plain["push"][0], (2,))
    assert told["body"][0] == robot().model.body("torso").id and told["impulse"][0] == 12.0
    *_, info = env.step(zero(env))
    assert set(info) == set(plain) and info["push"]["start"].tolist() == [0.5, 1.0]
    assert env.reset(options={"push": []})[1]["push"]["impulse"].shape == (0,)
    with invalid("env"):
        PlainInfo(gymnasium.make("CartPole-v1"))


@BOTH
def test_the_push_of_the_options_reaches_the_body(make):
    """During the push, and only then, the simulator applies 120 N to the left on the torso."""
    env = make(robot())
    env.reset(seed=0, options={"push": {**PUSH, "start": 0.04}, "noise": 0.0})
    torso, forces = robot().model.body("torso").id, []
    for _ in range(9):
        env.step(zero(env))
        forces.append(env.simulation.data.xfrc_applied.copy())
    expected = [0, 0, 120, 120, 120, 120, 120, 0, 0]
    np.testing.assert_allclose([f[torso, 1] for f in forces], expected, atol=1e-9)
    assert all(np.abs(np.delete(f, torso, axis=0)).max() == 0.0 for f in forces)


@BOTH
def test_pushes_are_drawn_from_the_sampler(make):
    """Without options the schedule follows the configuration and the seed."""
    sampler = PushSampler((5.0, 6.0), "impulse", bodies=("torso",), count=(2, 2))
    env = make(robot(), pushes=sampler)
    env.reset(seed=0)
    pushes = env.simulation.pushes
    assert len(pushes) == 2 and all(5.0 <= p.impulse <= 6.0 for p in pushes)
    env.reset(seed=1)
    assert env.simulation.pushes != pushes
    env.reset(seed=0)
    assert env.simulation.pushes == pushes
    quiet = make(robot(), pushes=None)
    assert quiet.reset(seed=0)[1]["push"] == []


@BOTH
def test_the_observation_does_not_know_the_push(make):
    """A scheduled push changes nothing before it starts."""
    env = make(robot())
    options = {"push": {**PUSH, "start": 0.2}}
    pushed, free = play(env, 1, 11, options), play(env, 1, 11, {"push": []})
    for a, b in zip(pushed[:11], free[:11], strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(pushed[11], free[11])


@BOTH
def test_the_start_is_disturbed_with_the_soles_on_the_ground(make):
    """Noise moves joints and speeds; no sole is far above or anywhere below the ground."""
    env = make(robot())
    standing = robot().standing_qpos
    postures = []
    for seed in range(5):
        env.reset(seed=seed)
        state = env.simulation.state
        heights = [
            (point + sole.polygon @ axes[:, :2].T)[:, 2]
            for point, axes, sole in zip(
                state.sole_points, state.sole_axes, robot().soles, strict=True
            )
        ]
        assert min(h.min() for h in heights) == pytest.approx(0.0, abs=1e-9)
        assert max(h.max() for h in heights) < 0.03
        low, high = robot().joint_range.T
        assert np.all(state.q >= low) and np.all(state.q <= high)
        assert 0.0 < np.abs(state.q - standing[7:]).max() <= 0.02
        assert 0.0 < np.abs(state.qvel[6:]).max() <= 0.05
        assert 0.0 < np.abs(state.qvel[:2]).max() <= 0.02
        postures.append(state.q.copy())
    assert not np.array_equal(postures[0], postures[1])
    env.reset(seed=0, options={"noise": 0.0})
    np.testing.assert_allclose(env.simulation.state.qpos, standing, atol=1e-8)
    assert not env.simulation.state.qvel.any()


@BOTH
def test_the_start_itself_may_be_given(make):
    """qpos and qvel are taken as they are."""
    env = make(robot())
    qpos, qvel = robot().standing_qpos.copy(), np.zeros(robot().model.nv)
    qpos[0], qvel[1] = 3.0, 0.25
    env.reset(seed=0, options={"qpos": qpos, "qvel": qvel})
    np.testing.assert_allclose(env.simulation.state.qpos, qpos, atol=1e-12)
    np.testing.assert_array_equal(env.simulation.state.qvel, qvel)


@BOTH
def test_info_names_every_reward_term(make):
    """The reward is the sum of the terms in info; info has its keys from the reset on."""
    env = make(robot())
    _, info = env.reset(seed=0)
    assert set(info) == INFO and info["is_success"] is False
    for _ in range(5):
        _, reward, _, _, info = env.step(np.full(env.action_space.shape, 0.1))
        assert set(info) == INFO and tuple(info["reward_terms"]) == REWARD_TERMS
        assert reward == pytest.approx(sum(info["reward_terms"].values()), rel=1e-12)
        assert type(reward) is float and type(info["is_success"]) is bool
        assert type(info["solver_failures"]) is int
        assert 0.0 <= info["torque_saturation"] <= 1.0 and info["root_wrench"].shape == (6,)


@BOTH
def test_a_fall_terminates(make):
    """A push that nobody stands ends the episode as a fall, without success."""
    env = make(robot())
    env.reset(seed=0, options={"push": {"impulse": 60.0, "start": 0.0, "body": "torso"}})
    terminated = False
    while not terminated:
        _, _, terminated, truncated, info = env.step(zero(env))
        assert not truncated and env.fallen == terminated
    assert info["reward_terms"]["fall"] == -5.0 and info["is_success"] is False
    assert env.simulation.time < 2.0


def test_the_end_of_time_truncates():
    """After `duration` seconds the episode is truncated; standing quietly is a success."""
    env = ResidualBalanceEnv(robot(), duration=0.5, fall={"quiet_time": 0.2})
    env.reset(seed=0, options={"push": []})
    for k in range(25):
        _, _, terminated, truncated, info = env.step(zero(env))
        assert not terminated and truncated == (k == 24)
    assert env.simulation.time == pytest.approx(0.5) and info["is_success"] is True


@BOTH
def test_step_needs_a_reset(make):
    """Before the first reset, after the end and after a failed reset, step() says so."""
    env = make(robot(), duration=0.02)
    with pytest.raises(PoiseError, match="reset"):
        env.step(zero(env))
    env.reset(seed=0)
    env.step(zero(env))
    with pytest.raises(PoiseError, match="reset"):
        env.step(zero(env))
    env.reset(seed=0)
    with pytest.raises(ConfigError):
        env.reset(options={"push": {"impulse": -1.0}})
    with pytest.raises(PoiseError, match="reset"):
        env.step(zero(env))


@BOTH
def test_a_simulation_that_diverges_is_a_fall(make, tmp_path, monkeypatch):
    """MuJoCo starts a diverged simulation anew, standing: that is no recovery."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log here
    env = make(robot())
    qvel = np.zeros(robot().model.nv)
    qvel[8] = 1e9
    env.reset(seed=0, options={"push": [], "qvel": qvel})
    observation, reward, terminated, _, info = env.step(zero(env))
    assert terminated and env.fallen and not info["is_success"]
    assert reward == -5.0 == sum(info["reward_terms"].values())
    assert env.observation_space.contains(observation)
    env.reset(seed=0, options={"push": []})
    assert not env.step(zero(env))[2]


@BOTH
@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda a: a[:-1], ["shape", "expected"]),
        (lambda a: a[None], ["shape", "expected"]),
        (lambda a: np.where(np.arange(len(a)) == 1, np.nan, a), ["[-1, 1]", "nan"]),
        (lambda a: np.where(np.arange(len(a)) == 1, np.inf, a), ["[-1, 1]", "inf"]),
        (lambda a: np.where(np.arange(len(a)) == 1, -1.01, a), ["[-1, 1]", "-1.01"]),
        (lambda a: "left", ["numbers", "left"]),
        (lambda a: None, ["shape"]),
    ],
)
def test_bad_actions_are_refused(make, spoil, named):
    """One error names the field, what is wrong and the entries; the episode can go on."""
    env = make(robot())
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="action") as error:
        env.step(spoil(zero(env)))
    text = str(error.value)
    for word in named:
        assert word in text
    if "numbers" not in named:
        assert env.action_names[1] in text
    env.step(zero(env))
    assert env.steps == 1


@BOTH
@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"pushes": []}, RESET_OPTIONS),
        ({"push": "hard"}, ("push",)),
        ({"push": {"impulse": 1.0, "body": "tail"}}, ("body", "tail", "torso")),
        ({"noise": "loud"}, ("noise", "number")),
        ({"noise": np.nan}, ("noise", "finite")),
        ({"qpos": np.zeros(3)}, ("qpos", "28")),
        ({"qvel": np.full(27, np.nan)}, ("qvel", "27")),
    ],
)
def test_bad_options_are_refused(make, options, named):
    """One error names the option and what it may be."""
    with pytest.raises(ConfigError) as error:
        make(robot()).reset(seed=0, options=options)
    for word in named:
        assert word in str(error.value)


@BOTH
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"robot": "nobody"}, ("nobody", "robot", "humanoid")),
        ({"render_mode": "ascii"}, ("render_mode", "ascii", "rgb_array")),
        ({"duraton": 3.0}, ("unexpected keyword argument 'duraton'", "duration")),
        ({"duration": -1.0}, ("duration", "-1.0")),
        ({"reward": {"alive": "much"}}, ("reward.alive", "much")),
        ({"fall": {"tilt": 200.0}}, ("fall.tilt", "200.0")),
        ({"pushes": {"magnitude": [1.0, 0.0], "unit": "impulse"}}, ("magnitude",)),
        ({"policy_period": 0.005}, ("policy_period", "0.002")),
        ({"config": "nothing"}, ("nothing",)),
        ({"config": "nothing.yaml"}, ("nothing.yaml",)),
        ({"config": 3}, ("config", "3")),
    ],
)
def test_bad_arguments_are_refused(make, arguments, named):
    """One error names the field, the value and the choices."""
    with pytest.raises(ConfigError) as error:
        make(**{"robot": robot(), **arguments})
    for word in named:
        assert word in str(error.value)


@BOTH
@pytest.mark.parametrize("name", ["tall", "compact"])
def test_other_robots(make, name):
    """Nothing is tied to the default robot: spaces follow it, pushes name its bodies."""
    env = make(name)
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert info["push"][0]["body"] in robot(name).description.push_bodies
    observation, *_ = env.step(np.full(env.action_space.shape, 0.05))
    assert env.observation_space.contains(observation)
    with pytest.raises(ConfigError, match="body"):
        env.reset(options={"push": {"impulse": 1.0, "body": "no such body"}})


def test_the_configuration_is_read_from_anything(tmp_path):
    """An object, a mapping and a file mean the same; fields given by name win."""
    file = tmp_path / "short.yaml"
    file.write_text("duration: 2.0\nfall: {tilt: 45}\npushes: null\n")
    mapping = {"duration": 2.0, "fall": {"tilt": 45.0}, "pushes": None}
    config = env_config(file)
    assert config == env_config(mapping) == env_config(config) == env_config(str(file))
    assert config.fall.tilt == 45.0 and config.pushes is None
    assert env_config(file, duration=3.0).duration == 3.0
    assert env_config(None) == EnvConfig()
    file.write_text("duration: [2.0]\n")
    with pytest.raises(ConfigError, match="short.yaml: duration"):
        env_config(file)


def test_an_unknown_argument_is_a_type_error_too():
    """TorchRL offers `frameskip`, and goes on without it after this TypeError."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        TorqueBalanceEnv(robot(), frameskip=1)


def test_frames_per_second_follow_the_policy_period():
    """Videos play at the speed of the simulation."""
    assert TorqueBalanceEnv(robot(), policy_period=0.04).metadata["render_fps"] == 25
    assert TorqueBalanceEnv.metadata["render_fps"] == 50
