"""Random pushes: determinism, ranges, units, and what is refused."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.compiled.maths.pendulum import duration_factor
from poise.envs.physics.pushes.options import body_names
from poise.envs.physics.pushes.push import Kick
from poise.envs.physics.pushes.sampler import LimitTable, PushSampler
from poise.envs.robots.robot import load_robot


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


@pytest.fixture
def sampler(robot):
    return PushSampler(
        magnitude=(2.0, 8.0),
        unit="impulse",
        bodies=body_names(robot)[:3],
        duration=(0.05, 0.3),
        direction=(-90.0, 90.0),
        elevation=(-10.0, 20.0),
        offset=0.1,
        start=(0.5, 1.0),
        count=(1, 3),
        interval=(0.2, 0.4),
    )


def test_one_seed_gives_one_schedule(robot, sampler):
    """The same generator state gives the same pushes, another seed others."""
    one, two, other = (sampler.sample(np.random.default_rng(s), robot) for s in (3, 3, 4))
    assert one == two != other


def test_draws_stay_in_their_ranges(robot, sampler):
    """Every drawn field lies in its range, and the ranges are used."""
    rng = np.random.default_rng(0)
    episodes = [sampler.sample(rng, robot) for _ in range(300)]
    pushes = [push for pushes in episodes for push in pushes]
    for name, low, high in [
        ("impulse", 2, 8), ("duration", 0.05, 0.3), ("direction", -90, 90), ("elevation", -10, 20),
    ]:  # fmt: skip
        values = np.array([getattr(push, name) for push in pushes])
        assert low <= values.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < values.max() <= high
    assert {push.body for push in pushes} == set(body_names(robot)[:3])
    assert 0.09 < np.abs([push.point for push in pushes]).max() <= 0.1
    assert {len(pushes) for pushes in episodes} == {1, 2, 3}
    for pushes in episodes:
        assert 0.5 <= pushes[0].start <= 1.0
        for before, after in itertools.pairwise(pushes):
            assert 0.2 - 1e-12 <= after.start - before.start - before.duration <= 0.4 + 1e-12


def test_magnitude_does_not_disturb_the_other_draws(robot, sampler):
    """A curriculum that changes the magnitude meets the same directions, bodies and times."""
    harder = replace(sampler, magnitude=(20.0, 30.0))
    for seed in range(5):
        soft = sampler.sample(np.random.default_rng(seed), robot)
        hard = harder.sample(np.random.default_rng(seed), robot)
        assert [replace(p, impulse=0.0) for p in soft] == [replace(p, impulse=0.0) for p in hard]
        assert all(p.impulse >= 20.0 for p in hard)


def test_probability_of_no_push(robot, sampler):
    """no_push is the fraction of episodes without a push."""
    rng = np.random.default_rng(0)
    sampler = replace(sampler, no_push=0.3)
    quiet = [not sampler.sample(rng, robot) for _ in range(1000)]
    assert np.mean(quiet) == pytest.approx(0.3, abs=0.05)


def test_no_body_named_means_those_of_the_robot(robot):
    """Without bodies the sampler serves any robot: all its push bodies, or the root."""
    sampler, rng = PushSampler((1.0, 2.0), "impulse"), np.random.default_rng(0)
    drawn = {sampler.sample(rng, robot)[0].body for _ in range(60)}
    assert drawn == set(robot.description.push_bodies)
    plain = replace(robot, description=replace(robot.description, push_bodies=()))
    (push,) = sampler.sample(rng, plain)
    assert push.body == robot.model.body(robot.root_body_id).name


def test_kicks_among_pushes(robot, sampler):
    """A fraction of the pushes are kicks; without it what is drawn stays as it was."""
    rng, mixed = np.random.default_rng(0), replace(sampler, kicks=0.4, kick_speed=(1.0, 3.0))
    drawn = [push for _ in range(400) for push in mixed.sample(rng, robot)]
    kicks = [push for push in drawn if isinstance(push, Kick)]
    assert len(kicks) / len(drawn) == pytest.approx(0.4, abs=0.05)
    speeds = [kick.delta_v for kick in kicks]
    assert 1.0 <= min(speeds) < 1.1 and 2.9 < max(speeds) <= 3.0
    one, other = (each.sample(np.random.default_rng(3), robot)
                  for each in (sampler, replace(sampler, kick_speed=(1.0, 3.0))))  # fmt: skip
    assert one == other


def test_kicks(robot):
    """Unit delta_v gives velocity kicks."""
    (kick,) = PushSampler((0.2, 0.2), "delta_v").sample(np.random.default_rng(0), robot)
    assert isinstance(kick, Kick) and kick.delta_v == 0.2


def test_limit_table_is_periodic():
    """Between 270° and 0° the limit interpolates across the wrap, also for negative angles."""
    table = LimitTable((0.0, 90.0, 180.0, 270.0), (10.0, 20.0, 16.0, 18.0))
    assert table(90.0) == 20.0 and table(45.0) == pytest.approx(15.0)
    assert table(315.0) == table(-45.0) == pytest.approx(14.0)
    assert table(360.0) == 10.0


def test_controller_fraction_follows_limit_and_duration(robot):
    """J = fraction × J50(θ) × the ankle limit's growth from 0.1 s to the push's duration."""
    table = LimitTable((0.0, 180.0), (10.0, 20.0))
    sampler = PushSampler(
        (0.5, 0.5), "controller_fraction", direction=(90.0, 90.0), limit_table=table
    )
    (push,) = sampler.sample(np.random.default_rng(0), robot)
    assert push.impulse == pytest.approx(7.5)

    longer = replace(sampler, duration=(0.3, 0.3), profile="half-sine")
    (push,) = longer.sample(np.random.default_rng(0), robot)
    omega = robot.omega
    growth = duration_factor(omega, 0.3, "half-sine") / duration_factor(omega, 0.1)
    assert growth > 1.2
    assert push.impulse == pytest.approx(7.5 * growth)

    (push,) = sampler.sample(np.random.default_rng(0), robot, limits=lambda direction: 100.0)
    assert push.impulse == pytest.approx(50.0)


def test_ankle_fraction_asks_for_the_margin_of_its_direction(robot):
    """The margin is that of the drawn direction; the impulse is proportional to it."""
    sampler = PushSampler((1.0, 1.0), "ankle_fraction", direction=(30.0, 30.0))
    asked = []
    (push,) = sampler.sample(
        np.random.default_rng(0), robot, margin=lambda angle: asked.append(angle) or 0.1
    )
    assert asked == [30.0]
    omega = robot.omega
    assert push.impulse == pytest.approx(robot.mass * omega * 0.1 * duration_factor(omega, 0.1))


def test_a_sampler_survives_its_yaml_form(sampler):
    """build(to_dict(sampler)) is the sampler."""
    sampler = replace(sampler, limit_table=LimitTable((0.0, 90.0), (1.0, 2.0)))
    assert build(PushSampler, to_dict(sampler), "x.yaml") == sampler


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"unit": "pounds"}, ("unit", "ankle_fraction")),
        ({"magnitude": [2.0, 1.0]}, ("magnitude",)),
        ({"magnitude": [-1.0, 1.0]}, ("magnitude",)),
        ({"duration": [0.0, 0.1]}, ("duration",)),
        ({"count": [0, 1]}, ("count",)),
        ({"count": [1.0, 2.0]}, ("count",)),
        ({"no_push": 1.1}, ("no_push",)),
        ({"kicks": 1.1}, ("kicks",)),
        ({"kick_speed": [3.0, 1.0]}, ("kick_speed",)),
        ({"size": 1}, ("size", "magnitude")),
        ({"limit_table": {"directions": [0.0, 360.0], "impulses": [1.0, 1.0]}}, ("limit_table",)),
        ({"limit_table": {"directions": [0.0], "impulses": []}}, ("limit_table",)),
    ],
)
def test_bad_samplers_are_refused(change, named):
    """The error names the file, the field and the choices."""
    with pytest.raises(ConfigError) as error:
        build(PushSampler, {"magnitude": [1.0, 2.0], "unit": "impulse", **change}, "x.yaml")
    for word in ("x.yaml", *named):
        assert word in str(error.value)


def test_what_the_robot_or_the_caller_lacks_is_named(robot):
    """An unknown body, a missing margin and missing limits are ConfigErrors."""
    rng = np.random.default_rng(0)
    for sampler, word in [
        (PushSampler((1.0, 1.0), "impulse", bodies=("tail",)), "tail"),
        (PushSampler((1.0, 1.0), "ankle_fraction"), "margin"),
        (PushSampler((1.0, 1.0), "controller_fraction"), "limit_table"),
    ]:
        with pytest.raises(ConfigError, match=word):
            sampler.sample(rng, robot)


def test_an_environment_refuses_a_share_of_unknown_limits_before_its_reset(robot):
    """Also where another distribution of the same sampler asks for it."""
    share = PushSampler((1.0, 1.0), "controller_fraction")
    table = LimitTable((0.0,), (18.0,))
    TorqueBalanceEnv(robot, pushes=replace(share, limit_table=table))
    for pushes in (share, PushSampler((1.0, 1.0), "impulse", others=(share,))):
        with pytest.raises(ConfigError, match="limit_table.*--write-limits"):
            TorqueBalanceEnv(robot, pushes=pushes)


def test_a_specific_force_is_a_peak_force_over_the_mass(robot):
    """2 N/kg for 2 s is F T of a step, and 2/π F T of half a sine; both profiles are drawn."""
    sampler = PushSampler((2.0, 2.0), "specific_force", duration=(2.0, 2.0), profile="any")
    rng = np.random.default_rng(0)
    pushes = [sampler.sample(rng, robot)[0] for _ in range(40)]
    assert {push.profile for push in pushes} == {"square", "half-sine"}
    for push in pushes:
        assert push.peak_force == pytest.approx(2.0 * robot.mass)
        share = 1.0 if push.profile == "square" else 2.0 / np.pi
        assert push.impulse == pytest.approx(share * 4.0 * robot.mass)


def test_an_episode_of_gusts_has_one_side(robot):
    """All are within `spread` of one direction, which differs from episode to episode."""
    sampler = PushSampler((1.0, 1.0), "impulse", count=(8, 8), spread=20.0)
    rng, sides = np.random.default_rng(0), []
    for _ in range(200):
        angles = np.radians([push.direction for push in sampler.sample(rng, robot)])
        side = np.angle(np.exp(1j * angles).mean())
        off = np.degrees(np.abs(np.angle(np.exp(1j * (angles - side)))))
        assert off.max() < 40.0
        sides.append(np.degrees(side) % 360.0)
    assert np.histogram(sides, 4, (0, 360))[0].min() > 30


def test_either_side_mirrors_all_pushes_of_an_episode(robot):
    """Directions of an episode are all to the left or all to the right."""
    sampler = PushSampler(
        (1.0, 1.0), "impulse", direction=(60.0, 120.0), count=(3, 3), either_side=True
    )
    rng = np.random.default_rng(0)
    signs = []
    for _ in range(50):
        directions = np.array([push.direction for push in sampler.sample(rng, robot)])
        assert np.all((np.abs(directions) >= 60.0) & (np.abs(directions) <= 120.0))
        assert abs(np.sign(directions).sum()) == 3
        signs.append(np.sign(directions[0]))
    assert 15 < sum(sign > 0 for sign in signs) < 35


def test_an_episode_is_of_one_of_several_distributions(robot):
    """Each is as likely as the others, and is what it is by itself."""
    short = PushSampler((5.0, 5.0), "impulse")
    long = PushSampler((1.0, 1.0), "specific_force", duration=(2.0, 2.0), count=(2, 2))
    sampler = replace(short, others=(long,))
    rng = np.random.default_rng(0)
    counts = [len(sampler.sample(rng, robot)) for _ in range(200)]
    assert 70 < counts.count(2) < 130 and set(counts) == {1, 2}
    assert build(PushSampler, to_dict(sampler), "again") == sampler


def test_what_is_new_is_left_out_of_files(robot):
    """Fingerprints of policies hash configurations, which had no such fields."""
    data = to_dict(PushSampler((1.0, 1.0), "impulse"))
    assert not {"spread", "either_side", "others"} & data.keys()
