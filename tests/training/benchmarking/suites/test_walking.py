"""training/benchmarking/suites/walking.py: who walks how, and when it is pushed."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.physics.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))


def trials(name: str, limits: PushLimits) -> list[Trial]:
    return TrialPlan(load_suite(name), limits, 7, ["walk"]).first


def test_a_walk_has_every_command(limits: PushLimits) -> None:
    """20 starts of each, named by what is not zero; standing is a command too."""
    found = trials("walk", limits)
    levels = [trial.level for trial in found]
    assert {level: levels.count(level) for level in levels}.keys() >= {"stand", "left -0.3"}
    assert all(levels.count(level) == 20 for level in levels)
    assert all(trial.options["command"] == list(trial.commands) for trial in found)
    by_level = {trial.level: trial.commands for trial in found}
    assert by_level["turn 0.5"] == (TimedCommand(turn=0.5),)
    assert by_level["stand"] == (TimedCommand(),)
    assert not any(trial.pushes or trial.kicks for trial in found)


def test_a_walk_has_all_of_its_command(limits: PushLimits) -> None:
    """Its step time and width too, in the trials and in the name of the level."""
    command = {"ahead": 0.4, "step_time": 0.35, "width": 0.2}
    for part in ("walk", "walk_push", "walk_kick", "walk_repeated"):
        field = {"commands": [command]} if part == "walk" else {"command": command}
        plan = TrialPlan(build(Suite, {part: field}, "suite"), limits, 7, ["walk"])
        assert {trial.command for trial in plan.first} == {TimedCommand(**command)}
        levels = {trial.level for trial in plan.first if part != "walk_kick"}
        assert levels <= {"ahead 0.4, step_time 0.35, width 0.2"}


def test_pushes_come_at_all_phases(limits: PushLimits) -> None:
    """Of any period, in every direction, and among the small pushes as among the large ones."""
    found = trials("walk-push", limits)
    assert {trial.command for trial in found} == {TimedCommand(0.5)}
    starts = np.array([trial.pushes[0].start for trial in found])
    assert starts.min() >= 5.0 and starts.max() <= 5.0 + 12.0 / load_robot().omega
    impulse = np.array([trial.pushes[0].impulse for trial in found])
    for chosen in (impulse < np.median(impulse), impulse >= np.median(impulse)):
        for period in (0.5, 0.84):
            counts, _ = np.histogram(starts[chosen] % period / period, 8, (0.0, 1.0))
            assert counts.min() >= 0.5 * counts.mean()
    other = TrialPlan(load_suite("walk-push"), limits, 8, ["walk"]).first
    assert other[0].pushes[0].start != starts[0]  # every seed has times of its own


def test_second_stage_pushes_walk_too(limits: PushLimits) -> None:
    """Around each controller's own J50, at commands and times of their own; not to fall counts."""
    plan = TrialPlan(load_suite("walk-push"), limits, 7, ["walk"])
    held = {("walk", t.number): Outcome(False, t.pushes[0].impulse >= 20.0) for t in plan.first}
    second = plan.second(held)["walk"]
    assert len(second) == 16 * 24 and {trial.part for trial in second} == {"walk_push"}
    assert all(10.0 <= trial.pushes[0].impulse <= 33.0 for trial in second)
    assert len({trial.pushes[0].start for trial in second}) == len(second)
    assert all(trial.commands for trial in second)


def test_who_does_not_fall_meets_larger_pushes(limits: PushLimits) -> None:
    """Up to 2.5 N·s/kg in the second stage, where the first one makes too few fall; one at it."""
    suite, mass = load_suite("walk-push"), limits.robot.mass
    plan = TrialPlan(suite, limits, 7, ["strong", "weak"])
    assert max(trial.pushes[0].impulse for trial in plan.first) < 1.0 * mass
    fell = {"strong": 10.0 * mass, "weak": 0.5 * mass}
    ends = {(name, t.number): Outcome(True, t.pushes[0].impulse > most)
            for t in plan.first for name, most in fell.items()}  # fmt: skip
    second = plan.second(ends)
    assert len(second["strong"]) == len(second["weak"]) == 16 * 24
    for angle in range(0, 360, 45):
        impulses = {
            name: np.array([t.pushes[0].impulse for t in own if t.pushes[0].direction == angle])
            for name, own in second.items()
        }
        assert impulses["strong"].max() == pytest.approx(2.5 * mass)
        assert impulses["strong"].min() > 0.5 * mass and len(set(impulses["strong"])) == 24
        assert impulses["weak"].max() < 1.4 * 0.6 * mass


def kicks(suite: Suite, limits: PushLimits, level: str) -> tuple[np.ndarray, np.ndarray]:
    """Sizes [m/s] and directions [rad] of the kicks of a level."""
    found = [t.kicks[0] for t in TrialPlan(suite, limits, 7, ["walk"]).first if t.level == level]
    return (np.array([kick.delta_v for kick in found]),
            np.radians([kick.direction for kick in found]))  # fmt: skip


def test_kicks_of_fixed_sizes(limits: PushLimits) -> None:
    """1, 2 and 3 m/s in all directions alike; the environment is given them as pushes."""
    suite = load_suite("walk-kick")
    for size in (1.0, 2.0, 3.0):
        sizes, angles = kicks(suite, limits, f"{size:g} m/s")
        assert len(sizes) == 100 and (sizes == size).all()
        counts, _ = np.histogram(angles % (2.0 * np.pi), 4, (0.0, 2.0 * np.pi))
        assert counts.min() >= 12
    found = trials("walk-kick", limits)
    assert len(found) == 300 and found[0].options["push"] == [found[0].kicks[0]]


def test_kicks_fill_a_square(limits: PushLimits) -> None:
    """Up to ± the speed along each axis, evenly, besides those of fixed sizes."""
    suite = build(Suite, {"walk_kick": {"speeds": [0.5, 1.0], "sizes": [2.0]}}, "suite")
    assert len(kicks(suite, limits, "2 m/s")[0]) == 400
    for speed in (0.5, 1.0):
        size, angle = kicks(suite, limits, f"± {speed:g} m/s")
        assert len(size) == 400
        for part in (size * np.cos(angle), size * np.sin(angle)):
            assert np.abs(part).max() <= speed + 1e-9 and np.abs(part).max() > 0.97 * speed
            assert abs(np.mean(part)) < 0.1 * speed
            assert np.std(part) == pytest.approx(speed / np.sqrt(3.0), rel=0.1)


def test_repeated_pushes_wait_for_the_walk(limits: PushLimits) -> None:
    """The first one after 5 s, the last one 5 s before the end."""
    found, suite = trials("walk-repeated", limits), load_suite("walk-repeated")
    assert all(5.0 <= trial.pushes[0].start <= 8.0 for trial in found)
    assert all(trial.pushes[-1].start <= suite.duration - 5.0 for trial in found)
    assert all(len(trial.pushes) > 10 and trial.commands for trial in found)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"walk": {"commands": []}}, "walk: commands: must not be empty"),
        (
            {"walk": {"commands": [{"speed": 1}]}},
            r"commands\[0\].speed: unknown field \(choices: a",
        ),
        ({"velocity": {"courses": {"a": []}}}, "velocity: courses: needs one command or more"),
        ({"velocity": {"courses": {"a": [{}, {}]}}}, "courses.a: start: must increase"),
        ({"walk_kick": {"speeds": []}}, "walk_kick: speeds: must not be empty where"),
        ({"walk_push": {"reach": 0.5, "impulses": [0.1, 1.0]}}, "reach: must be above impulses, 1"),
        ({"walk_push": {}, "grid": {}}, "J50 is that of a walk or of standing, not of both"),
        ({"walk_push": {"impulses": [2.0, 1.0]}}, "impulses: .* must increase"),
    ],
)
def test_bad_suites(fields: dict, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        build(Suite, fields, "suite")
