"""The figures of a policy's card, each read from a result that exists."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.reading import is_folder
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.results.summary import read_summary
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.learning.policy import Policy
from poise.training.running.columns import J50_MEAN
from poise.training.running.files import SUMMARY


@dataclass(frozen=True)
class ExportFigure:
    """A number of a result.

    Attributes:
        key: what it is, as a word.
        name: the same for a reader.
        value: the number.
        text: the number for a reader, with its interval and unit.
        source: where it was measured.
    """

    key: str
    name: str
    value: float
    text: str
    source: str


def figures(
    policy: Policy, name: str, robot: Robot, result: str | Path | None
) -> list[ExportFigure]:
    """Return the figures of the run's own evaluation of this policy, then those of `result`.

    `result` is a folder of `poise evaluate` or `poise benchmark`, or its summary.json.

    Raises ConfigError for another file, or one in which this very policy (by its fingerprint) did
    not take part.
    """
    found = _of_training(policy)
    if result is not None:
        found += _of_result(load_agent(name, robot).fingerprint, Path(result))
    return found


def _of_training(policy: Policy) -> list[ExportFigure]:
    """Return this checkpoint's rates of recovered and fallen held-out pushes, if evaluated."""
    rows = policy.state.get("evaluations")
    row = next((r for r in rows if _met(r, policy)), None) if isinstance(rows, list) else None
    if row is None:
        return []
    source = f"{policy.config.evaluation.trials} held-out pushes during training"
    return [
        ExportFigure(key, f"{key}, {source}", row[key], f"{row[key]:.1%}", source)
        for key in ("recovered", "fallen")
        if isinstance(row.get(key), float) and 0.0 <= row[key] <= 1.0
    ]


def _met(row: object, policy: Policy) -> bool:
    return isinstance(row, Mapping) and row.get("timesteps") == policy.state["timesteps"]


def _of_result(fingerprint: str, path: Path) -> list[ExportFigure]:
    path = path / SUMMARY if is_folder(path) else path
    summary = read_summary(path)
    entries = summary["controllers"].values()
    entry = next((each for each in entries if each.get("fingerprint") == fingerprint), None)
    if entry is None:
        raise ConfigError("this policy took no part: no controller has its fingerprint",
                          source=path, field="controllers",
                          choices=summary["controllers"])  # fmt: skip
    source = f"suite {summary['suite']}, seed {summary['seed']}, robot {summary['robot']['name']}"
    low, high = entry["recovered_ci95"]
    rate = f"{entry['recovered_rate']:.1%} of {entry['trials']}"
    found = [ExportFigure("recovered_rate", f"recovered, {source}", entry["recovered_rate"],
                    f"{rate}, 95 % {_interval(low, high, '.1%')}", source)]  # fmt: skip
    if "j50_mean" in entry and "j50_mean_ci95" in entry:
        low, high = entry["j50_mean_ci95"]
        text = f"{entry['j50_mean']:.1f} N·s, 95 % {_interval(low, high, '.1f')}"
        name = f"{J50_MEAN.heading}, {source}"
        found.append(ExportFigure("j50_mean", name, entry["j50_mean"], text, source))
    return found


def _interval(low: float | None, high: float | None, form: str) -> str:
    return " to ".join("unknown" if end is None else f"{end:{form}}" for end in (low, high))
