"""The native vector environment: what Gymnasium's own would give, bit for bit."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics

import poise  # noqa: F401  (registers the environments)
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.vector.batch import replicate
from poise.envs.balance.vector.vector_env import BalanceVectorEnv
from tests.support.refused import invalid
from tests.support.shared import robot

RESIDUAL, TORQUE = "poise/ResidualBalance-v0", "poise/TorqueBalance-v0"
PUSHES = {"magnitude": [0.1, 1.2], "unit": "specific_impulse", "start": [0.0, 0.1]}
SMALL = {"duration": 0.16, "pushes": PUSHES, "fall": {"quiet_time": 0.1}}


def native(name=RESIDUAL, n=3, threads=2, **changes):
    settings = {**SMALL, "robot": robot(), **changes}
    return gymnasium.make_vec(
        name, num_envs=n, vectorization_mode="vector_entry_point", threads=threads, **settings
    )


def sync(name=RESIDUAL, n=3, autoreset_mode="NextStep", **changes):
    settings = {**SMALL, "robot": robot(), **changes}
    mode = {"autoreset_mode": AutoresetMode(autoreset_mode)}
    return gymnasium.make_vec(
        name, num_envs=n, vectorization_mode="sync", vector_kwargs=mode, **settings
    )


def same(a, b, path="info"):
    """Equal in structure, types and bits."""
    assert type(a) is type(b), path
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            same(a[key], b[key], f"{path}.{key}")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape) == (b.dtype, b.shape), path
        if a.dtype == object:
            for i, (x, y) in enumerate(zip(a, b, strict=True)):
                same(x, y, f"{path}[{i}]")
        else:
            assert np.array_equal(a, b), path
    elif isinstance(a, (list, tuple)):
        assert len(a) == len(b), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{path}[{i}]")
    else:
        assert a == b, path


def play(env, steps, scale=0.5):
    """All that is returned from a seeded reset and some random steps; closes the environment."""
    rng = np.random.default_rng(1)
    record = [env.reset(seed=7)]
    for _ in range(steps):
        record.append(env.step(rng.uniform(-scale, scale, env.action_space.shape)))
    env.close()
    return record


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", [RESIDUAL, TORQUE])
def test_it_is_gymnasiums_own_bit_for_bit(name, mode):
    """Observations, rewards, ends and infos equal SyncVectorEnv's through automatic resets."""
    expected = play(sync(name, autoreset_mode=mode), 20)
    assert sum((step[2] | step[3]).sum() for step in expected[1:]) >= 6
    for threads in (1, 2, 5):
        same(play(native(name, threads=threads, autoreset_mode=mode), 20), expected)


@pytest.mark.parametrize("name", [RESIDUAL, TORQUE])
def test_a_fall_is_the_same_too(name):
    """Episodes that end by falls, at different times."""
    hard = {"pushes": {**PUSHES, "magnitude": [0.2, 4.0]}, "duration": 0.8}
    expected = play(sync(name, **hard), 60)
    assert sum(step[2].sum() for step in expected[1:]) >= 2
    same(play(native(name, **hard), 60), expected)


def test_a_smoothed_action():
    """The action that the next step finds as the last one is the smoothed one."""
    expected = play(sync(smoothing=0.05), 7)
    for (observations, rewards, *_), (others, other_rewards, *_) in zip(
        play(native(smoothing=0.05), 7)[1:], expected[1:], strict=True
    ):
        assert np.array_equal(observations, others)
        np.testing.assert_allclose(rewards, other_rewards, rtol=1e-12)


def test_the_attributes_of_a_vector_environment():
    """Spaces, metadata, seeds and spec are as in SyncVectorEnv; the default mode is its own."""
    ours, theirs = native(), sync()
    for name in ("num_envs", "single_observation_space", "single_action_space", "render_mode"):
        assert getattr(ours, name) == getattr(theirs, name)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.metadata == theirs.metadata
    assert ours.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    ours.reset(seed=3), theirs.reset(seed=3)
    assert ours.np_random_seed == theirs.np_random_seed == (3, 4, 5)
    assert [g.random() for g in ours.np_random] == [g.random() for g in theirs.np_random]
    assert ours.call("arguments")[0]["robot"] is robot() and ours.get_attr("steps") == (0, 0, 0)
    ours.set_attr("push_sampler", None)
    assert ours.get_attr("push_sampler") == (None, None, None)
    with pytest.raises(ConfigError, match="needs 3 values, not 2"):
        ours.set_attr("push_sampler", [None, None])
    assert ours.spec.id == RESIDUAL and "BalanceVectorEnv(poise/" in repr(ours)
    ours.close()
    assert ours.closed
    again = gymnasium.make_vec(RESIDUAL, num_envs=2, **SMALL)  # the default way
    assert type(again) is type(ours) and again.batch.threads <= 2
    again.close()


def test_seeds_options_and_masks():
    """reset takes a seed, seeds, options for each, and a mask of those that start anew."""
    mask = np.array([True, False, True])
    calls = [
        {"seed": 5},
        {"seed": [9, None, 11], "options": {"push": {"impulse": 3.0}}},
        {"seed": [1, 2, 3], "options": {"reset_mask": mask, "noise": 0.0}},
        {"options": {"reset_mask": ~mask, "push": []}},
    ]
    records = []
    for env in (native(), sync()):
        env.reset(seed=0)
        for _ in range(8):  # to the end of time: the next step would reset, but a reset comes first
            ended = env.step(np.zeros(env.action_space.shape))[3]
        assert ended.all()
        record = []
        for call in calls:
            options = dict(call["options"]) if "options" in call else None
            if call.get("seed") == [9, None, 11]:
                env.envs[1].unwrapped.np_random = np.random.default_rng(2)
            record.append(env.reset(seed=call.get("seed"), options=options))
            record.append(env.step(np.zeros(env.action_space.shape)))
        records.append(record)
        env.close()
    same(*records)


def test_a_disabled_reset_is_the_callers():
    """With DISABLED only the masked reset starts a new episode; forgetting it is an error."""
    ours, theirs = native(autoreset_mode="Disabled"), sync(autoreset_mode="Disabled")
    for env in (ours, theirs):
        env.reset(seed=0)
    zeros = np.zeros(ours.action_space.shape)
    for _ in range(8):
        got, expected = ours.step(zeros), theirs.step(zeros)
        same(got, expected)
    assert got[3].all()
    with pytest.raises(PoiseError, match="call reset"):
        ours.step(zeros)
    options = {"reset_mask": np.array([True, True, True])}
    same(ours.reset(options=options), theirs.reset(options=dict(options)))
    assert "reset_mask" in options  # the caller's own is left as it was
    same(ours.step(zeros), theirs.step(zeros))
    ours.close()


def test_an_ended_environment_is_not_stepped_on():
    """Not by Python either, where only one of them has ended; then nothing has moved."""
    pairs = [ResidualBalanceEnv(robot(), controller="pd", duration=d) for d in (1.0, 0.02)]
    env = BalanceVectorEnv(pairs, threads=2, autoreset_mode="Disabled")
    env.reset(seed=0)
    zeros = np.zeros(env.action_space.shape or ())
    assert env.step(zeros)[3].tolist() == [False, True]
    before = [other.simulation.time for other in env.envs]
    with pytest.raises(PoiseError, match="call reset"):
        env.step(zeros)
    assert [other.simulation.time for other in env.envs] == before
    env.close()


def test_wrappers_of_gymnasium():
    """Statistics of episodes and normalised observations equal those over SyncVectorEnv."""
    records = []
    for env in (native(), sync()):
        wrapped = NormalizeObservation(RecordEpisodeStatistics(env))
        record = play(wrapped, 20)
        for step in record[1:]:
            if "episode" in step[4]:
                step[4]["episode"].pop("t"), step[4]["episode"].pop("_t", None)  # seconds
        records.append(record)
    same(*records)
    assert any("episode" in step[4] for step in records[0][1:])
    same_step = RecordEpisodeStatistics(native(autoreset_mode="SameStep"))
    lengths = [
        info["episode"]["l"][info["_episode"]]
        for *_, info in play(same_step, 17)[1:]
        if "episode" in info
    ]
    assert np.concatenate(lengths).tolist() == 6 * [8]


def test_what_is_returned_is_not_overwritten():
    """Arrays of one step are unchanged by the next."""
    env = native()
    first = env.reset(seed=0)[0]
    kept = first.copy()
    step = env.step(np.full(env.action_space.shape, 0.3))
    copies = [np.copy(part) for part in step[:4]] + [step[4]["reward_terms"]["com"].copy()]
    env.step(np.full(env.action_space.shape, -0.3))
    assert np.array_equal(first, kept)
    arrays = [*step[:4], step[4]["reward_terms"]["com"]]
    assert all(np.array_equal(a, b) for a, b in zip(arrays, copies, strict=True))
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_what_is_returned_may_be_overwritten(mode):
    """Nothing that follows depends on it, resets included."""
    records = []
    for spoil in (False, True):
        env, record = native(autoreset_mode=mode), []
        env.reset(seed=0)
        for _ in range(20):
            step = env.step(np.full(env.action_space.shape, 0.3))
            record.append([part.copy() for part in step[:4]])
            if spoil:
                for part in step[:4]:
                    part[:] = 1
        env.close()
        records.append(record)
    same(*records)
    assert any(step[3].any() for step in records[0])


def test_wrong_actions_move_nothing():
    """NaN, bounds, shape and text are named; the batch is as it was before."""
    env = native(threads=2)
    env.reset(seed=0)
    before = env.batch.episodes["observation"].copy()
    good = np.zeros(env.action_space.shape)
    for value in (np.nan, 1.5):
        bad = good.copy()
        bad[1, 2] = value
        with pytest.raises(ConfigError, match=r"must lie in \[-1, 1\], but cop_x is (nan|1.5)"):
            env.step(bad)
    with invalid("action", "2", "4", "3"):
        env.step(good[:2])
    with invalid("action"):
        env.step("left")
    assert env.get_attr("steps") == (0, 0, 0)
    assert np.array_equal(env.batch.episodes["observation"], before)
    env.step(good)
    env.batch.terminated[1] = True  # this one is reset: its action is not looked at
    bad[0] = 0.0
    bad[1] = np.nan
    assert env.step(bad)[1][1] == 0.0
    env.close()


def test_wrong_arguments_are_named():
    """Mode, threads, number, seeds, mask and step before reset."""
    for wrong, field in (
        ({"autoreset_mode": "Now"}, "autoreset_mode.*NextStep"),
        ({"autoreset_mode": np.zeros(2, [("a", float)])}, "autoreset_mode.*NextStep"),
        ({"threads": 0}, "threads.*at least 1"),
        ({"n": 0}, "num_envs.*at least 1"),
        ({"robots": 2}, "unexpected keyword argument 'robots'"),
    ):
        with pytest.raises(ConfigError, match=field):
            native(**wrong)
    env = native()
    with pytest.raises(PoiseError, match="call reset"):
        env.step(np.zeros(env.action_space.shape))
    with pytest.raises(ConfigError, match="2 seeds and 3 options for 3 environments"):
        env.reset(seed=[1, 2])
    for mask, problem in (
        (np.ones(2, dtype=bool), "bool array"),
        ([True, True, True], "bool array"),
        (np.zeros(3, dtype=bool), "at least one True"),
    ):
        with pytest.raises(ConfigError, match=problem):
            env.reset(options={"reset_mask": mask})
    with pytest.raises(ConfigError, match="unknown option"):
        env.reset(options={"pushes": []})
    env.close()


def test_the_robot_is_loaded_once():
    """Environments share robot, motion and configuration, and nothing that changes."""
    env = gymnasium.make_vec(RESIDUAL, num_envs=3, threads=1, motion="squat", **SMALL)
    first, second, _ = env.envs
    assert first.robot is second.robot and first.motion is second.motion
    assert first.config is not None and first.config == second.config
    assert first.simulation.data is not second.simulation.data
    assert not np.shares_memory(first.controller.workspace.H, second.controller.workspace.H)
    assert not np.shares_memory(first.episode.action, second.episode.action)
    env.close()


def test_a_controller_object_serves_one_environment():
    """An own controller has a memory: it cannot be shared, a configuration can."""

    class Still:
        period = 0.004

        def reset(self, state):
            pass

        def torques(self, state, targets):
            return np.zeros(21)

    with invalid("controller"):
        native(controller=Still())
    env = native(n=1, threads=1, controller=Still())
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape))
    env.close()
    given = MomentumQP(robot())
    envs = replicate(ResidualBalanceEnv(robot(), controller=given), 2)
    assert envs[0].controller is given and envs[1].controller is not given


def test_arguments_make_the_same_environment():
    """A replica has every argument of the first."""
    first = ResidualBalanceEnv(
        robot(), duration=0.4, controller={"period": 0.01}, motion="bow", residual={"lean": 0.1},
        smoothing=0.05,
    )  # fmt: skip
    second = replicate(first, 2)[1]
    assert second.config == first.config and second.residual == first.residual
    assert second.controller.config == first.controller.config
    assert second.smoothing == first.smoothing and second.motion is first.motion
    zeros = np.zeros(first.action_space.shape)
    for env in (first, second):
        env.reset(seed=1)
    assert np.array_equal(first.step(zeros)[0], second.step(zeros)[0])
