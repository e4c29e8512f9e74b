"""The comparison of [Zhao]: reference models of a walk at the same commands."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allows
from poise.baselines.walking.schedule import TimedCommand, parse_commands
from poise.configs.errors import ConfigError
from poise.configs.files import packaged, write_atomic
from poise.configs.numbers import whole_number
from poise.configs.outputs import check_out_folder
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.evaluation.tick_times import clocked
from poise.training.benchmarking.statistics.rates import mean_or_none
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.agents import Agent, check_walks, load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.folder_lock import FolderLock
from poise.training.running.terminal import terminal

from .figures import GaitFigures, stance_plot
from .knee_moment import POINTS, KneeMoment, load_knee_moment
from .stance import StanceRecord, Stances

SETTLED = 5.0  # [s] after which stances count
TICKS_FROM = 3.0  # [s] after which ticks are timed, for so long
Say = Callable[[str], object]


def controller_of(model: str) -> str:
    """The packaged controller `walk-MODEL`, where there is one; other names mean themselves."""
    return f"walk-{model}" if f"walk-{model}" in packaged("controllers") else model


@allows("models")
def compare_gaits(
    models: Sequence[str],
    *,
    out: str | Path,
    speeds: Sequence[float] = (0.5, 0.8),
    starts: int = 4,
    duration: float = 20.0,
    robot: str = "humanoid",
    seed: int = 21,
    human: str | Path = "knee-moment",
    pushed: bool = False,
    push_suite: str | Path = "walk-push",
    workers: int | None = None,
    say: Say = print,
    allow: str | Iterable[str] = (),
) -> list[GaitFigures]:
    """Run walking controllers on the same commands and initial states; write the outcomes.

    `out` gets gaits.json and stance_knee.png, and with `pushed` the folder walk-push.

    Args:
        models: of packaged controllers (`lip` for `walk-lip`), or controllers that walk.
        speeds: ahead [m/s].
        starts: of each speed, a little disturbed.
        duration: of a walk [s].
        human: a packaged band of the human knee's moment, or a YAML file of one.
        pushed: find J50, too: by the suite `walk-push` at 0.5 m/s, which is long.
        push_suite: another suite, packaged or a file, with a part `walk_push`.
        workers: processes of that suite; None for all cores.
        say: what prints lines of progress.

    Raises:
        ConfigError: a name, number or file that is not valid, a controller that does not walk, a
            robot whose legs have no knees.
        PoiseError: a file cannot be written.
    """
    _check(models, speeds, starts, duration, seed)
    check_out_folder(out)
    if pushed and load_suite(push_suite).walk_push is None:
        raise ConfigError("needs a part walk_push", source=push_suite, field="push_suite")
    band, body = load_knee_moment(human), load_robot(robot)
    StanceRecord(body)  # raises where a leg has no knee
    names = [controller_of(model) for model in models]
    agents = [load_agent(name, body, duration=duration, pushes=None) for name in names]
    for name, agent in zip(names, agents, strict=True):
        check_walks(name, agent, "gait")
    with FolderLock(Path(out)):
        figures = []
        for agent in agents:
            tick = tick_time(agent, seed)
            for speed in speeds:
                figures.append(walk_at(agent, speed, starts, seed, band, tick))
                say(_line(figures[-1]))
        if pushed:
            summary = evaluate(names, push_suite, out=Path(out) / "walk-push", robot=robot,
                               seed=seed, workers=workers, console=terminal(),
                               allow=allow)  # fmt: skip
            j50 = {name: entry.get("j50_mean") for name, entry in summary["controllers"].items()}
            figures = [replace(each, j50=j50.get(each.controller)) for each in figures]
        content = {
            "robot": body.name, "seed": seed, "duration": duration, "human": asdict(band),
            "gaits": [asdict(each) for each in figures],
        }  # fmt: skip
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        write_atomic(Path(out) / "gaits.json", text)
        stance_plot(Path(out) / "stance_knee.png", figures, band)
    return figures


def _check(
    models: Sequence[str], speeds: Sequence[float], starts: int, duration: float, seed: int
) -> None:
    if not models or len(set(models)) < len(models):
        raise ConfigError("needs names, all different", field="compare", choices=KNOWN)
    if not speeds or not all(0.0 < abs(speed) < np.inf for speed in speeds):
        raise ConfigError("must be finite and not 0", field="speeds")
    if not SETTLED + 2.0 <= duration < np.inf:
        raise ConfigError(f"must be at least {SETTLED + 2.0:g} s, not {duration:g}",
                          field="duration")  # fmt: skip
    whole_number(starts, 1, "starts")
    whole_number(seed, 0, "seed")


KNOWN = ("lip", "rigid", "spring", "double")  #: models that have a packaged controller


def walk_at(
    agent: Agent, speed: float, starts: int, seed: int, band: KneeMoment, tick: float | None
) -> GaitFigures:
    """Return the figures of an agent at one speed."""
    commands = parse_commands({"ahead": speed}, "command")
    outcomes, stances = [], []
    for k in range(starts):
        record = StanceRecord(agent.env.robot)
        outcomes.append(run_trial(agent, Trial(k, seed + k, (), commands=commands), record))
        if not outcomes[-1].fallen:
            stances.append(record.stances(SETTLED))
    return figures_of(agent.name, speed, outcomes, stances, band, tick)


def figures_of(
    name: str,
    speed: float,
    outcomes: Sequence[Outcome],
    stances: Sequence[Stances],
    band: KneeMoment,
    tick: float | None,
) -> GaitFigures:
    """Return the figures of walks: falls of all of them, the rest of those that did not fall."""
    stood = [outcome for outcome in outcomes if not outcome.fallen]
    found: dict[str, Any] = {
        key: mean_or_none([getattr(each, key) for each in stood]) for key in MEANS
    }
    knees = np.concatenate([np.zeros((0, POINTS)), *(each.knees for each in stances)])
    found |= {"knee_stance": None, "knee_rmse": None, "knee_curve": ()}
    if len(knees):
        curve = knees.mean(axis=0)
        off = curve - band.curves()[0]
        found |= {"knee_stance": float(np.abs(knees).mean()), "knee_curve": tuple(curve.tolist()),
                  "knee_rmse": float(np.sqrt(np.mean(off**2)))}  # fmt: skip
    return GaitFigures(
        controller=name, speed=speed, starts=len(outcomes), falls=len(outcomes) - len(stood),
        **found, force_peak=mean_or_none([p for each in stances for p in each.peaks]),
        height_amplitude=mean_or_none([each.height_amplitude for each in stances]), tick=tick,
    )  # fmt: skip


#: figures of an `Outcome` whose means count
MEANS = (
    "speed_ahead", "speed_error_rms", "cost_of_transport", "positive_cost_of_transport",
    "knee_mean", "knee_peak", "step_length", "step_time",
)  # fmt: skip


def tick_time(agent: Agent, seed: int) -> float | None:
    """Median time of a control tick [µs] from Python, at 0.5 m/s; None if it falls before."""
    env = agent.env
    with clocked(env) as seconds:
        commands = [TimedCommand(0.5)]
        observation, _ = env.reset(seed=seed, options={"push": [], "command": commands})
        for k in range(round(2.0 * TICKS_FROM / env.config.policy_period)):
            if k == round(TICKS_FROM / env.config.policy_period):
                seconds.clear()
            env.step_without_info(agent.act(observation))
            if env.fallen:
                return None
        return 1e6 * float(np.median(seconds))


def _line(f: GaitFigures) -> str:
    if f.falls == f.starts:
        return f"{f.controller} at {f.speed:g} m/s: fell in all of {f.starts}"
    knee = "–" if f.knee_mean is None else f"{f.knee_mean:.2f} N·m/kg"
    cost = f.positive_cost_of_transport
    cost_text = "–" if cost is None else f"{cost:.2f}"
    return (f"{f.controller} at {f.speed:g} m/s: fell in {f.falls} of {f.starts}, stance knee "
            f"{knee}, cost of transport of positive work {cost_text}")  # fmt: skip
