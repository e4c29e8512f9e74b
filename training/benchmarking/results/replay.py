"""Repeat one trial of a result exactly, from its folder, and film it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from poise.baselines.allowance import allowing
from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build
from poise.envs.balance.base import BalanceEnv
from poise.envs.robots.robot import load_robot
from poise.envs.viewing.camera import Camera, beside
from poise.training.benchmarking.metrics.motions import suite_stage
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.agents import Agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.signals import TrialSignals
from poise.training.benchmarking.trials.table import outcome_cells
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.benchmarking.trials.variants import AgentVariants
from poise.training.pictures.figures.video import SIZE, Episode, record_together, usual
from poise.training.running.files import SETTINGS
from poise.training.running.terminal import filming

from .read import Results, load_results

NARROW = (480, 480)  # [pixels] of one of several


@dataclass(frozen=True)
class Replay:
    """A repeated trial."""

    trial: Trial
    controller: str  #: its name
    outcome: Outcome  #: of the repetition
    #: column of trials.csv → (recorded, now), for those that differ
    differences: dict[str, tuple[str, str]]


def replay(
    folder: str | Path | Results,
    trial: int,
    controller: str | None = None,
    *,
    video: str | Path | None = None,
    plot: str | Path | None = None,
    watch: Callable[[BalanceEnv], object] | None = None,
    allow: str | Iterable[str] = (),
) -> Replay:
    """Repeat a trial of a result and compare it with the record.

    Args:
        folder: written by `evaluate` or `benchmark`, or what `load_results` has read there.
        trial: its number in trials.csv.
        controller: one that took part; None: the last, which is the first if it is alone.
        video: an MP4 or WebP file to write, see `film`.
        plot: a PNG file to write: CoM, CoP, capture point and torque over time.
        watch: called with the environment after the reset and after every step.
        allow: external controllers (``module:Class``) that may run.

    Raises:
        ConfigError: no finished result there, no such trial or controller, or a controller or
            robot that is no longer the one that took part, or may not run.
        PoiseError: nothing can be drawn here, or a file cannot be written.
    """
    with _opened(folder, allow) as results:
        name = results.controllers[-1] if controller is None else controller
        record = results.record(name, trial)
        again = results.trial(record)
        agent = player(results, name, again)
    signals = TrialSignals() if plot is not None else None
    watches = [each for each in (signals, watch) if each is not None]
    outcome = run_trial(agent, again, lambda env: [each(env) for each in watches])
    differences = {
        key: (record.line[key], text)
        for key, value in outcome_cells(outcome).items()
        if record.line.get(key, "") != (text := "" if value is None else str(value))
        and key in record.line  # older results say less
    }
    if plot is not None and signals is not None:
        _draw(signals, Path(plot), again, f"Trial {trial}, {name}")
    if video is not None:
        film(results, trial, [name], video, allow=allow)
    return Replay(again, name, outcome, differences)


def _draw(signals: TrialSignals, path: Path, trial: Trial, title: str) -> None:
    from poise.training.pictures.figures.time_series import trial_timeseries

    pushes = [(push.start, push.duration) for push in trial.pushes]
    trial_timeseries(path, signals.t, signals.columns, pushes=pushes, title=title)


def film(
    folder: str | Path | Results,
    trial: int,
    controllers: Sequence[str],
    path: str | Path,
    *,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    allow: str | Iterable[str] = (),
    console: Console | None = None,
) -> None:
    """Repeat a trial of a result with several controllers and film them side by side.

    The camera stands beside the first push (`beside`).

    Args:
        folder: written by `evaluate` or `benchmark`, or what `load_results` has read there.
        trial: its number in trials.csv, in the results of all `controllers`.
        controllers: names, from left to right.
        path: of the video, ending in .mp4 or .webp.
        fps: frames a second that are wanted [1/s]; None: as of `record`.
        size: width and height of each picture [pixels]; None: as of `record`, but `NARROW` of
            several that are no WebP.
        allow: external controllers (``module:Class``) that may run.
        console: shows how much is filmed, which takes minutes without a graphics card; None: none.

    Raises:
        ConfigError: as `replay`, and for a path or size that is not valid.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    usual_size, usual_rate = usual(path)
    if len(controllers) > 1 and usual_size == SIZE:
        usual_size = NARROW
    size, fps = size or usual_size, fps or usual_rate
    with _opened(folder, allow) as results, ExitStack() as stack:
        episodes = {}
        for name in controllers:
            again = results.trial(results.record(name, trial))
            episode = _episode(results, name, again, size)
            episodes[name] = stack.enter_context(episode)
        seconds = max(episode.base.config.duration for episode in episodes.values())
        with filming(seconds, console) as watch:
            record_together(episodes, path, fps=fps, watch=watch)


@contextmanager
def _opened(folder: str | Path | Results, allow: str | Iterable[str]) -> Iterator[Results]:
    """Open the results of a folder; inside, the allowed external controllers may run."""
    path = folder.folder if isinstance(folder, Results) else Path(folder)
    with allowing(allow, source=path / SETTINGS):
        yield folder if isinstance(folder, Results) else load_results(path)


def _episode(results: Results, name: str, trial: Trial, size: tuple[int, int]) -> Episode:
    agent = player(results, name, trial)
    if agent.begin is not None:
        agent.begin()
    camera = Camera() if trial.push is None else beside(trial.push.direction)
    start = {"seed": trial.seed, "options": trial.options}
    return Episode(agent.env, agent.act, start, size, camera)


def player(results: Results, name: str, trial: Trial) -> Agent:
    """Return the controller as it took part, in the conditions of `trial`.

    Raises ConfigError if it or the robot has changed since.
    """
    settings, folder = results.settings, results.folder
    robot = load_robot(settings.robot)
    if robot.fingerprint != settings.robot_fingerprint:
        raise ConfigError(f"the robot {shown(settings.robot)} has changed since", source=folder,
                          field="robot_fingerprint")  # fmt: skip
    suite = build(Suite, settings.suite, str(folder / SETTINGS))
    stage = suite_stage(suite, settings.robot, folder)
    agent = stage.load(name, robot)
    if agent.fingerprint != settings.controllers[name]:
        raise ConfigError(f"the controller {shown(name)} has changed since", source=folder,
                          field="controllers")  # fmt: skip
    motion = stage.motion(trial.motion, agent.env.robot)
    return AgentVariants(agent).under(trial.conditions, trial.terrain, motion)
