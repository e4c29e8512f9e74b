"""The course of `evaluate` and `benchmark`: run missing trials, then write figures."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

from rich.console import Console

from poise.baselines.allowance import allowing
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError, naming, shown
from poise.configs.files import resolve
from poise.configs.outputs import check_out_folder
from poise.configs.problems import out_of_range
from poise.configs.schema import to_dict
from poise.envs.physics.engines.config import MUJOCO, Physics, load_physics
from poise.envs.physics.engines.engine import check_engine
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import IDEAL, load_realism
from poise.envs.terrain.bumps import Bumps
from poise.training.benchmarking.metrics.entry import controller_entry, robot_figures
from poise.training.benchmarking.metrics.evaluated import RATED, Evaluated, lost
from poise.training.benchmarking.metrics.motions import suite_repertoire, suite_stage
from poise.training.benchmarking.metrics.pairs import pair_figures
from poise.training.benchmarking.metrics.seed_groups import seed_groups
from poise.training.benchmarking.suites.draw import MOST_TRIALS
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.agents import (
    Agent,
    can_follow,
    can_walk,
    check_may_walk,
    check_walks,
    follows_no_motion,
    stand_in,
)
from poise.training.benchmarking.trials.jobs import Job, run_job
from poise.training.benchmarking.trials.names import check_name
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit, curves, stepping_limits
from poise.training.benchmarking.trials.table import trial_row
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.benchmarking.trials.variants import level_of
from poise.training.learning.seeds.records import expand_seeds
from poise.training.running.executor import Executor, check_backend
from poise.training.running.files import LOG, SETTINGS, SUMMARY, TRIALS, plain
from poise.training.running.provenance import circumstances, versions
from poise.training.running.stopping import keeps
from poise.training.running.summary import FORMAT, Summary
from poise.training.running.terminal import print_paths, progress_bar

from .folder import ResultFolder, Settings, check_folder
from .tables import print_lost, print_summary, ranked
from .tick_times import tick_times

FEW = 5  # controllers up to which progress shows the rates of each
GET_UP_TIME = 10.0  # [s] after a fall


class Run:
    """One call of `evaluate` or `benchmark`, whose arguments it takes; checks them.

    Args:
        motions: replace the suite's; none: its own.
        reference: controller that others are compared with, if it takes part; None: the first.
        measured: robot → reference impulses of pushes.
        realism: name or file of a level, instead of the suite's; it is then the only one.
        physics: name or file of an engine's settings, instead of the suite's.
    """

    def __init__(
        self, controllers: Sequence[str], suite: str | Path, out: str | Path, robot: str, seed: int,
        workers: int | None, backend: str, trials: int | None, overwrite: bool,
        console: Console | None, *, reference: str | None,
        measured: Callable[[Robot], PushLimits], motions: Sequence[str] = (),
        realism: str | None = None, get_up: bool = False, physics: str | None = None,
    ):  # fmt: skip
        self.started, self.console = time.perf_counter(), console or Console(quiet=True)
        names = expand_seeds(controllers)
        _check(names, seed, workers, trials)
        check_backend(backend)
        self.suite = load_suite(suite)
        if motions:
            self.suite = self.suite.performing(motions)
        if trials is not None:
            self.suite = self.suite.resized(trials)
        if realism is not None:
            self.suite = replace(self.suite, realism=realism, levels=())
        if get_up:
            self.suite = replace(self.suite, get_up_time=GET_UP_TIME)
        if physics is not None:
            self.suite = replace(self.suite, physics=physics)
        engine = load_physics(self.suite.physics)
        file = resolve("suites", suite)
        with naming(None if realism else file):
            for level in (self.suite.realism, *self.suite.levels):
                load_realism(level)
        self.out, self.overwrite, self.executor = Path(out), overwrite, Executor(backend, workers)
        check_out_folder(out)
        self.robot = load_robot(robot)
        known: dict[str, Any] = {
            "format": FORMAT,
            "suite_name": str(suite),
            "suite": to_dict(self.suite),
            "robot": str(robot),
            "robot_fingerprint": self.robot.fingerprint,
            "seed": seed,
            "versions": versions((*dict.fromkeys(("mujoco", engine.engine)), "numpy", "numba")),
        }
        check_folder(self.out, known, overwrite)
        self.limits, self.reference = measured(self.robot), reference
        self.repertoire = suite_repertoire(self.suite, self.robot, self.out, overwrite)
        with naming(file):
            plan = self._plan(seed, names)  # refuses what does not fit the robot
        _check_engine(engine, self.robot, plan)
        if self.suite.walks:
            for name in names:
                check_may_walk(name, f"suite {suite}")
        prepare()
        self.stage = suite_stage(self.suite, robot, self.out)
        self.agents = {name: self.stage.load(name, self.robot) for name in names}
        for name, agent in self.agents.items():
            if self.suite.walks:
                check_walks(name, agent, f"suite {suite}")
            if self.suite.motions is not None and not can_follow(agent):
                raise follows_no_motion(name, f"suite {suite}")
        self.settings = Settings(
            **known,
            limits=self.limits.table,
            controllers={name: agent.fingerprint for name, agent in self.agents.items()},
            motions=self.repertoire.digests,
        )

    def _plan(self, seed: int, names: Sequence[str], standing: Collection[str] = ()) -> TrialPlan:
        return TrialPlan(self.suite, self.limits, seed, names, self.repertoire.durations, standing)

    def play(self, plots: bool = False, timed: bool = False) -> Summary:
        """Run missing trials and write the result; return the summary."""
        folder = ResultFolder(self.out, self.settings, self.overwrite, self.suite.paired,
                              self._load_others)  # fmt: skip
        keeps(self.out / LOG, f"the finished trials are kept in {self.out}; "
              "the same command goes on")  # fmt: skip
        with closing(folder):
            if folder.damaged:
                self.console.print(f"{folder.damaged} lines of {self.out} could not be read: "
                                   "their trials are repeated")  # fmt: skip
            if folder.finished:
                self.console.print(f"continuing after {len(folder.finished)} finished trials")
            self.repertoire.write(self.out)
            names = tuple(folder.settings.controllers)
            agents = {name: self.agents[name] for name in names}
            standing = [name for name, agent in agents.items() if not can_walk(agent)]
            plan = self._plan(self.settings.seed, names, standing if self.suite.scenarios else ())
            _warm_up(agents.values())
            self._play(folder, plan)
            evaluated: dict[str, Evaluated] = {
                name: [(trial, folder.finished[name, trial.number]) for trial in trials]
                for name, trials in plan.trials(folder.finished).items()
            }
            outcomes = {name: [o for _, o in evaluated[name]] for name in names}
            steps = stepping_limits(agents.values(), outcomes, self.limits)
            ticks = tick_times(agents) if timed else dict.fromkeys(names)
            summary = self._summary(folder, plan, evaluated, steps, ticks)
            learned = {name: agent.timesteps for name, agent in agents.items()}
            drawn = []
            if plots:
                from .plots import draw_plots  # loads Matplotlib

                drawn = draw_plots(self.out, plan, evaluated, steps, learned)
            rows = [(trial, name, outcome) for name in names for trial, outcome in evaluated[name]]
            rows.sort(key=lambda row: row[0].number)  # of one number, in the order of the names
            folder.finish([trial_row(*row) for row in rows], summary)
        print_summary(summary, self.console)
        numbers = {name: lost(evaluated[name]) for name in summary["ranking"]}
        print_lost(numbers, summary["controllers"], self.out, self.console)
        print_paths([*drawn, self.out / TRIALS, self.out / SUMMARY], self.console)
        return summary

    def _summary(
        self,
        folder: ResultFolder,
        plan: TrialPlan,
        evaluated: Mapping[str, Evaluated],
        steps: Mapping[str, NStepLimit],
        ticks: Mapping[str, float | None],
    ) -> Summary:
        settings, suite = folder.settings, self.suite
        entries = {
            name: controller_entry(evaluated[name], plan, steps.get(name)) for name in evaluated
        }
        for name, entry in entries.items():
            entry["tick_us"], entry["fingerprint"] = ticks[name], settings.controllers[name]
            if (learned_from := self.agents[name].timesteps) is not None:
                entry["timesteps"] = learned_from
            found = (
                stand_in(self.agents[name], level_of(t.conditions)) for t, _ in evaluated[name]
            )
            if others := Counter(each for each in found if each is not None):
                entry["stand_ins"] = dict(others)
        first = next(iter(evaluated))
        reference = self.reference if self.reference and self.reference in evaluated else first
        pairs: Iterator[tuple[str, str]] = combinations(evaluated, 2)
        if self.reference is not None:
            pairs = compared(reference, evaluated, ranked(entries))
        whole: Summary = {
            "format": FORMAT,
            "suite": settings.suite_name,
            "seed": settings.seed,
            "robot": robot_figures(self.limits),
            "rated": next((name for name in RATED if name in suite.parts), None),
            "scale": self.limits.scale,
            "reference": reference,
            "ranking": ranked(entries),
            "controllers": entries,
            "pairs": [pair_figures(a, b, evaluated, entries) for a, b in pairs],
            "step_limits": curves(steps, suite.push_duration) if "directions" in entries[first]
            else [],
            "seeds": seed_groups(tuple(evaluated), entries),
            **circumstances(self.started, self.executor.workers, self.executor.backend),
        }  # fmt: skip
        if suite.realism != IDEAL:
            whole["realism"] = suite.realism
        if suite.physics != MUJOCO:
            whole["physics"] = suite.physics
        return plain(whole)

    def _load_others(self, settings: Settings) -> None:
        """Load the folder's other controllers; raise ConfigError for one that has changed."""
        for name in [each for each in settings.controllers if each not in self.agents]:
            with allowing(source=self.out / SETTINGS):
                self.agents[name] = self.stage.load(name, self.robot)
            if self.agents[name].fingerprint != settings.controllers[name]:
                raise ConfigError(
                    f"holds trials of {shown(name)}, which has changed since: choose another "
                    "folder", source=self.out, field="controllers",
                )  # fmt: skip

    def _play(self, folder: ResultFolder, plan: TrialPlan) -> None:
        """Run missing trials: the first stage, then the second, which depends on it."""

        def missing(pairs: Iterable[tuple[str, Trial]]) -> list[Job]:
            jobs = [Job(self.stage, name, trial) for name, trial in pairs
                    if (name, trial.number) not in folder.finished]  # fmt: skip
            return sorted(jobs, key=lambda job: job.trial.number)

        def stages() -> Iterator[list[Job]]:
            yield missing(
                (name, trial)
                for trial in plan.first
                for name in plan.names
                if plan.plays(name, trial)
            )
            second = plan.second(folder.finished)
            yield missing((name, trial) for name, trials in second.items() for trial in trials)

        rates = Rates(plan.names)
        for (name, _), outcome in folder.finished.items():
            rates.add(name, outcome)
        with progress_bar(self.console) as bar, contextlib.ExitStack() as working:
            task = bar.add_task("", total=plan.count, completed=len(folder.finished), rates="")
            executor = None
            for jobs in filter(None, stages()):
                executor = executor or working.enter_context(self.executor)
                for job, outcome in executor.each(run_job, jobs):
                    folder.append(job.controller, job.trial.number, outcome)
                    rates.add(job.controller, outcome)
                    bar.update(task, completed=len(folder.finished), rates=str(rates))


def compared(
    reference: str, names: Iterable[str], ranking: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Return pairs (a, b) of a long ranking: all against the reference, and adjacent ranks."""
    yield from ((reference, name) for name in names if name != reference)
    yield from ((b, a) for a, b in pairwise(ranking) if reference not in (a, b))


class Rates:
    """The rates of trials without a fall and of recovered ones so far as text: of each controller,
    or of many taken together.

    Of a walk, recovered is to have gone on as commanded.
    """

    def __init__(self, names: Sequence[str]):
        self._together = len(names) > FEW
        self._counts = {"" if self._together else name: [0, 0, 0] for name in names}

    def add(self, name: str, outcome: Outcome) -> None:
        """Count a trial."""
        count = self._counts.setdefault("" if self._together else name, [0, 0, 0])
        for k, one in enumerate((outcome.upright, outcome.recovered, True)):
            count[k] += one

    def __str__(self) -> str:
        return "  ".join(
            f"{name} {upright / trials:.0%}, {recovered / trials:.0%}".lstrip()
            for name, (upright, recovered, trials) in self._counts.items()
            if trials
        )


def _check(names: Sequence[str], seed: int, workers: int | None, trials: int | None) -> None:
    for name in names:
        if list(names).count(name) > 1:
            raise ConfigError(f"{shown(name)} is given twice", field="controllers")
        check_name(name)
    for value, name, least in ((seed, "seed", 0), (workers, "workers", 1), (trials, "trials", 1)):
        if value is not None and value < least:
            raise out_of_range(value, name, least=least)
    if trials is not None and trials > MOST_TRIALS:
        raise ConfigError(f"must be at most {MOST_TRIALS}", field="trials")


def _check_engine(engine: Physics, robot: Robot, plan: TrialPlan) -> None:
    """Raise ConfigError where the engine cannot hold the robot, a trial's terrain or its bumps."""
    levels = dict.fromkeys(trial.conditions.realism for trial in plan.first)
    bumps = [Bumps() for level in levels if load_realism(level).bumpy]
    built = [trial.terrain for trial in plan.first if trial.terrain and not trial.terrain.flat]
    for terrain in [None, *bumps[:1], *built[:1]]:
        check_engine(engine, robot, terrain)


def _warm_up(agents: Iterable[Agent]) -> None:
    """Compile all kernels once, instead of in every process."""
    for agent in agents:
        with contextlib.suppress(Exception):  # an external controller: its trials record the error
            observation, _ = agent.env.reset(seed=0, options={"push": []})
            agent.env.step(agent.act(observation))
