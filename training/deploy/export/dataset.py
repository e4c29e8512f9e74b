"""Trials of a suite as a data set of Minari: what was observed, done, earned and pushed."""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allowing, named
from poise.configs.errors import ConfigError, shown
from poise.configs.extras import needing
from poise.configs.files import new_folder
from poise.envs.balance.plain_info import push_arrays
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.benchmarking.trials.trial import Trial
from poise.training.running.processes import environment

PLACE = "MINARI_DATASETS_PATH"  # of Minari's data sets
NAME = re.compile(r"[\w.-]+/[\w./-]+-v\d+")


def write_dataset(
    controller: str,
    out: str | Path,
    *,
    name: str = "poise/pushes-v0",
    suite: str = "strong",
    robot: str = "humanoid",
    trials: int | None = None,
    seed: int = 0,
    allow: str | Iterable[str] = (),
) -> dict[str, int]:
    """Run trials and write them as a Minari data set into the folder `out`.

    Each episode is a trial; `infos` contain the push as arrays (`push_arrays`) and `is_success`.
    ``MINARI_DATASETS_PATH=OUT`` lets `minari.load_dataset` find it.

    Args:
        controller: as `evaluate` takes one; its environment is that of the data.
        out: new, or empty.
        name: of the data set, as Minari writes names: namespace/name-v0.
        suite: of pushes, with one stage; packaged or a .yaml file.
        robot: packaged or a .yaml description.
        trials: instead of the suite's number.
        seed: of the trials.
        allow: external controllers that may run though a file names them.

    Returns:
        how many episodes, steps and recoveries it has.

    Raises:
        ConfigError: Minari is not installed, a name is not valid, a folder is not empty.
    """
    with needing("dataset", "dataset"):
        import minari
        from minari.data_collector.episode_buffer import EpisodeBuffer
    if NAME.fullmatch(name) is None:
        raise ConfigError(f"must be such as poise/pushes-v0, not {shown(name)}", field="name")
    chosen, known = load_suite(suite), load_robot(robot)
    if trials is not None:
        chosen = chosen.resized(trials)
    with allowing([*named(controller), *([allow] if isinstance(allow, str) else allow)]):
        given: dict[str, Any] = {"duration": chosen.duration, "pushes": None, "noise": chosen.noise}
        agent = load_agent(controller, known, **given)
        plan = TrialPlan(chosen, load_limits(known), seed, [controller])
        episodes = [_episode(agent, trial, EpisodeBuffer) for trial in plan.first]
    won = sum(bool(each.infos["is_success"][-1]) for each in episodes)
    with (
        new_folder(out) as folder,
        environment({PLACE: str(folder.resolve())}),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", UserWarning)  # advice to publishers
        minari.create_dataset_from_buffers(
            dataset_id=name, buffer=episodes, algorithm_name=controller,
            action_space=agent.env.action_space, observation_space=agent.env.observation_space,
            description=f"{controller} on {known.name}, suite {suite}, seed {seed}; Poise",
        )  # fmt: skip
    return {"episodes": len(episodes), "steps": sum(map(len, episodes)), "recovered": won}


def _episode(agent: Agent, trial: Trial, buffer: Any) -> Any:
    """Return a trial as a buffer of Minari."""
    env = agent.env
    observation, info = env.reset(seed=trial.seed, options=trial.options)
    if agent.begin is not None:
        agent.begin()
    push = push_arrays(info["push"], env)
    seen, success = [observation], [info["is_success"]]
    done: list[np.ndarray] = []
    earned: list[float] = []
    ends: list[tuple[bool, bool]] = []
    while not (ends and any(ends[-1])):
        action = np.asarray(agent.act(observation), dtype=np.float32)
        observation, reward, fell, ended, info = env.step(action)
        seen.append(observation)
        done.append(action)
        earned.append(reward)
        ends.append((fell, ended))
        success.append(info["is_success"])
    infos = {key: np.repeat(value[None], len(seen), axis=0) for key, value in push.items()}
    return buffer(
        id=trial.number, seed=trial.seed, observations=np.array(seen), actions=np.array(done),
        rewards=earned, terminations=[fell for fell, _ in ends],
        truncations=[ended for _, ended in ends],
        infos={"push": infos, "is_success": np.array(success)},
    )  # fmt: skip
