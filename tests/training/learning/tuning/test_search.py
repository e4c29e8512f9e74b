"""Tuning: what a candidate is worth, what may be searched, and that a search can be resumed."""

import json
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.configs.schema import build, read_yaml, to_dict
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.training.benchmarking.trials import play as playing
from poise.training.benchmarking.trials.agents import Agent
from poise.training.benchmarking.trials.trial import Trial
from poise.training.learning.tuning.candidates import (
    Candidate,
    follow_limits,
    worth,
    worth_of_trials,
)
from poise.training.learning.tuning.gains import Gains
from poise.training.learning.tuning.search import GAINS, HISTORY, tune, tune_config
from poise.training.learning.tuning.tasks import TuneConfig, TuningPushes, TuningWalks
from tests.support.evaluations import InProcess
from tests.support.rivals import KNOWN, allowed, network
from tests.support.shared import robot
from tests.support.weekly import daily


def small(**changes):
    """A search that takes a second a generation."""
    settings = {
        "controller": "momentum-qp",
        "gains": {"com.stiffness": (0.2, 12.0), "com.offset": (-0.06, 0.06)},
        "pushes": TuningPushes(directions=(0.0, 180.0), levels=(1.0,), seconds=1.0),
        "generations": 3,
        "population": 4,
    }
    return TuneConfig(**{**settings, **changes})


@pytest.fixture
def in_process(monkeypatch):
    """Candidates are played in this process."""
    monkeypatch.setattr("poise.training.learning.tuning.search.Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None


@pytest.fixture(scope="module")
def agent():
    env = ResidualBalanceEnv(robot(), duration=3.0, pushes=None)
    return Agent("momentum-qp", env, lambda observation: np.zeros(len(env.action_names)), "")


def trial(impulse):
    """A push forward."""
    return Trial(0, 5, (Push("torso", 0.5, 0.1, impulse, 0.0),))


def test_a_fall_is_worth_less_than_standing(agent, monkeypatch):
    """A recovery counts fully, a fall by how long it took; a dragged foot is no recovery."""
    assert worth(agent, trial(5.0), in_place=True) == 1.0
    assert 0.03 < worth(agent, trial(40.0), in_place=True) < 0.15
    monkeypatch.setattr(playing, "FOOT_DISPLACED", 1e-6)
    assert worth(agent, trial(5.0), in_place=True) == 0.6
    assert worth(agent, trial(5.0), in_place=False) == 1.0


def test_pushes_surround_the_limits():
    """Each direction has its levels of its own limit, at angles that fill its share."""
    directions, limits = tuple(45.0 * k for k in range(8)), np.linspace(10.0, 17.0, 8)
    pushes = TuningPushes(directions, jitter=22.5, levels=(0.9, 1.1))
    angles = []
    for seed in range(50):
        trials = pushes.draw(seed, robot(), limits)
        assert [t.push.impulse for t in trials] == pytest.approx(
            np.outer(limits, [0.9, 1.1]).ravel()
        )
        assert {t.push.body for t in trials} == {push_bodies(robot())[0]}
        away = [t.push.direction - 45.0 * (t.number // 2) for t in trials]
        angles += [(a + 180.0) % 360.0 - 180.0 for a in away]
        assert len({t.seed for t in trials}) == len(trials)
    assert -22.5 <= min(angles) < -20.0 and 20.0 < max(angles) <= 22.5


def test_limits_follow_what_is_recovered():
    """Up where more than half is recovered, down where less; not quiet is not recovered."""
    values = np.array([[[1.0, 1.0], [1.0, 0.6], [0.3, 0.6]]])
    found = follow_limits(np.array([10.0, 20.0, 30.0]), values)
    np.testing.assert_allclose(found, [10.0 * np.exp(0.05), 20.0, 30.0 * np.exp(-0.05)])


@pytest.mark.parametrize("name", daily(packaged("tuning"), 5))
def test_packaged_ranges(name, monkeypatch):
    """All are numbers of the controller, and hold where the search starts from.

    A configuration refuses a number that is out of range, before a controller is made of it.
    """
    made = "poise.training.learning.tuning.gains.load_controller"
    monkeypatch.setattr(made, lambda data, _: controller_config(data))
    config = tune_config(name)
    with allowed(network(config.controller)) if config.controller in KNOWN else nullcontext():
        gains = Gains(config.controller, config.gains, config.robot)
        start = to_dict(controller_config(config.controller))
    assert np.all((gains.first() >= 0.0) & (gains.first() <= 1.0))
    again = gains.at(gains.first())
    for path, (low, high) in config.gains.items():
        value, found = start, again
        for part in path.split("."):
            value, found = value[part], found[part]
        assert low <= value <= high, path
        assert found == pytest.approx(value, rel=1e-4, abs=1e-12)


def test_gains_are_put_in_their_places():
    """On a log scale where both ends are above 0; what is not searched stays."""
    gains = Gains("momentum-qp", small().gains, "humanoid")
    data = gains.at(np.array([0.5, 0.25]))
    assert data["com"]["stiffness"] == pytest.approx(np.sqrt(0.2 * 12.0), rel=1e-4)
    assert data["com"]["offset"] == pytest.approx(-0.03)
    data["com"].update({k: gains.start["com"][k] for k in ("stiffness", "offset")})
    assert data == to_dict(controller_config("momentum-qp"))


def test_what_is_searched_plays_at_every_level():
    """Nothing takes the place of a candidate: its gains would count for nothing there."""
    assert controller_config("walk").uncertain is not None
    data = Gains("walk", {"step_margin": (0.0, 0.05)}, "humanoid").at(np.array([0.5]))
    assert "uncertain" not in data and controller_config(data).uncertain is None


def test_the_candidate_is_what_plays():
    """Another configuration, another outcome: without torque the same push is a fall."""
    data = to_dict(controller_config("momentum-qp"))
    config = small(pushes=TuningPushes(seconds=3.0), in_place=True)
    job = Candidate(0, config, data, (trial(8.0),))
    assert worth_of_trials(job) == ([1.0], [])
    under = replace(config, policy="residual")
    policy = replace(job, config=under, alone=(), below=(trial(8.0), trial(40.0)))
    alone, (won, lost) = worth_of_trials(policy)
    assert alone == [] and won == 1.0 and lost < 0.15
    data["torque"]["share"] = 0.05
    assert worth_of_trials(replace(job, controller=data))[0][0] < 0.3


@pytest.mark.parametrize(
    ("gains", "field", "words"),
    [
        ({"com.stifness": (1.0, 2.0)}, "gains.com.stifness", "com.stiffness"),
        ({"com": (1.0, 2.0)}, "gains.com", "no such number"),
        ({"solver": (1.0, 2.0)}, "gains.solver", "no such number"),
        ({"contact.polygon_share": (0.5, 1.5)}, "gains.contact.polygon_share", "1.5 is out of"),
    ],
)
def test_gains_that_are_not_there(gains, field, words):
    """One error that names the gain."""
    with pytest.raises(ConfigError, match=words) as error:
        Gains("momentum-qp", gains, "humanoid")
    assert error.value.field == field


def test_ranges_the_wrong_way_round():
    """Ends in order, and at least one gain."""
    data = to_dict(small())
    for gains in ({}, {"com.weight": [2.0, 1.0]}):
        with pytest.raises(ConfigError, match="gains"):
            build(TuneConfig, {**data, "gains": gains}, "file")


def test_a_search_resumes_as_if_nothing_had_happened(tmp_path, monkeypatch):
    """Two generations and one more are three, bit for bit, with any number of workers."""
    once, twice = tmp_path / "once", tmp_path / "twice"
    tune(small(generations=2), twice, workers=2)
    monkeypatch.setattr("poise.training.learning.tuning.search.Executor", InProcess)
    monkeypatch.setattr(InProcess, "stop_after", None)
    found = tune(small(), once)
    with pytest.raises(ConfigError, match="--resume"):
        tune(small(), twice)
    with pytest.raises(ConfigError) as error:
        tune(small(seed=1), twice, resume=True)
    assert error.value.field == "seed"
    assert tune(small(), twice, workers=2, resume=True) == found
    for name in (GAINS, HISTORY):
        assert (once / name).read_bytes() == (twice / name).read_bytes()
    assert to_dict(controller_config(once / GAINS)) == found
    lines = [json.loads(line) for line in (once / HISTORY).read_text().splitlines()]
    assert len({str(line["units"]) for line in lines}) == 3  # a generation is not the one before

    def changed(name, value):
        return json.dumps({**lines[1], name: value})

    lines[1]["units"][0][0] += 0.1
    (twice / HISTORY).write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(ConfigError, match="line 2"):
        tune(small(generations=4), twice, resume=True)
    for wrong in ("5", "[]", "null", '{"units": 1}', changed("alone", [[1.0]]),
                  changed("alone", None), changed("alone", [[2.0, 0.0]] * 4),
                  changed("below", [{}] * 4)):  # fmt: skip
        text = (once / HISTORY).read_text().splitlines()
        (twice / HISTORY).write_text("\n".join([text[0], wrong]))
        with pytest.raises(ConfigError, match="line 2"):
            tune(small(generations=4), twice, resume=True)
    assert read_yaml(twice / GAINS) == found  # nothing lost
    with pytest.raises(ConfigError, match="no search"):
        tune(small(), tmp_path / "none", resume=True)


def test_a_range_reaches_to_where_the_search_starts(tmp_path):
    """A start outside of a range is where the search starts, not the nearer end."""
    path = tmp_path / "stiff.yaml"
    path.write_text("base: momentum-qp\nkind: momentum-qp\ncom: {stiffness: 20.0}\n")
    gains = Gains(str(path), {"com.stiffness": (0.2, 12.0)}, "humanoid")
    assert gains.first() == pytest.approx([1.0])
    assert gains.at(gains.first()) == to_dict(controller_config(path))
    assert gains.at(np.zeros(1))["com"]["stiffness"] == pytest.approx(0.2)


def test_a_search_ends_when_its_minutes_are_over(tmp_path, capsys, in_process):
    """One generation is played, then none that would end late; the rest by `resume`."""
    tune(small(), tmp_path / "short", workers=1, minutes=1e-6, console=Console())
    said = capsys.readouterr().out
    assert "generation 1 of 3" in said and "s each" in said and "left" not in said
    assert len((tmp_path / "short" / HISTORY).read_text().splitlines()) == 1
    tune(small(), tmp_path / "short", workers=1, resume=True, console=Console())
    assert "min left" in capsys.readouterr().out
    tune(small(), tmp_path / "long", workers=1)
    for name in (GAINS, HISTORY):
        assert (tmp_path / "short" / name).read_bytes() == (tmp_path / "long" / name).read_bytes()
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ConfigError, match="above 0"):
            tune(small(), tmp_path / "none", minutes=wrong)
    assert not (tmp_path / "none").exists()


WALKS = {"commands": [{"ahead": 0.6}, {"ahead": 0.4, "left": 0.1, "turn": 0.3}], "seconds": 6.0}


def walking(**changes) -> TuneConfig:
    """A search for gains of a walk."""
    settings = {"controller": "walk", "gains": {"gait.height": [0.9, 1.0]}, "walks": WALKS,
                "generations": 1, "population": 4}  # fmt: skip
    return build(TuneConfig, {**settings, **changes}, "tests")


def test_walks_are_as_fast_as_the_search_has_got():
    """Speeds times level and limit, to either side; steps as they are told."""
    walks = walking(walks={**WALKS, "levels": [0.9, 1.1]}).tasks
    assert isinstance(walks, TuningWalks) and np.array_equal(walks.first(robot()), [1.0, 1.0])
    sides = set()
    for seed in range(8):
        trials = walks.draw(seed, robot(), np.array([1.0, 2.0]))
        told = np.array([t.command.array()[:3] for t in trials])
        np.testing.assert_allclose(told[:2], [[0.54, 0.0, 0.0], [0.66, 0.0, 0.0]])
        np.testing.assert_allclose(np.abs(told[2:]), [[0.72, 0.18, 0.54], [0.88, 0.22, 0.66]])
        assert np.array_equal(np.sign(told[2:, 1]), np.sign(told[2:, 2]))
        sides |= set(np.sign(told[2:, 1]))
        assert len({t.seed for t in trials}) == len(trials) and not any(t.pushes for t in trials)
    assert sides == {-1.0, 1.0}


def test_a_walk_is_worth_what_it_does_of_what_it_is_told():
    """All where it goes so, less where it is too slow, least where it falls or cannot be told."""
    data = to_dict(controller_config("walk"))

    def of(speed: float, turn: float = 0.0, **gait: float) -> float:
        told = [{"ahead": speed, "turn": turn}]
        walks = build(TuningWalks, {"commands": told, "levels": [1.0]}, "tests")
        changed = {**data, "gait": {**data["gait"], **gait}}
        trials = tuple(walks.draw(3, robot(), walks.first(robot())))
        config = small(walks=replace(walks, seconds=9.0))
        ((value,), below) = worth_of_trials(Candidate(0, config, changed, trials))
        assert below == []
        return value

    assert 0.95 < of(0.5) <= 1.0
    assert 0.95 < of(0.3, turn=0.4) <= 1.0  # though feet point beside the curve
    assert 0.6 < of(1.0, acceleration=0.016) < 0.95  # it has been on its way for long
    assert of(1.0, acceleration=0.005) == 0.6
    assert 0.0 < of(1.7) < 0.3
    assert of(0.5, step_time=4.9) == 0.0


def test_a_search_for_a_walk(tmp_path, in_process):
    """It is told as pushes are, and goes on from its file."""
    console, short = Console(record=True, width=200), {**WALKS, "commands": [{"ahead": 0.6}]}
    tune(walking(walks=short), tmp_path, workers=1, console=console)
    assert "half walk alone at 1.0" in console.export_text()
    found = tune(walking(walks=short, generations=2), tmp_path, workers=1, resume=True)
    assert found["gait"]["height"] != to_dict(controller_config("walk"))["gait"]["height"]
    stands = {"controller": "momentum-qp", "gains": {"com.weight": [1, 2]}}
    fast = {"walks": {"commands": [{"ahead": 9.0}]}}
    for changed, message in ((stands, "does not walk"), (fast, "out of range")):
        with pytest.raises(ConfigError, match=message):
            tune(walking(**changed), tmp_path / "none")
    assert not (tmp_path / "none").exists()
    none, still = {"commands": []}, {**WALKS, "levels": [0.0]}
    for wrong, message in ((none, "commands: must be one"), (still, "levels: must be one")):
        with pytest.raises(ConfigError, match=message):
            walking(walks=wrong)
