"""The same trials in two engines, row by row: `python -m tests.performance.two_engines QUEUE OUT`.

QUEUE is a YAML list of blocks: `robot`, `controllers`, `suite` (the fields of one), `trials`,
`seed`, `variants` (as in `tests.performance.verdicts`) and `starts` (numbers added to the seeds of
starts). Every trial is a line of OUT, written at once; a second call goes on. `--until HH:MM` (UTC)
ends it before the next trial. `--table` prints what OUT has: recovered and not fallen with Wilson's
interval, chatter and drift, and each variant beside the first one on the trials of both.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from poise.baselines.allowance import allowing
from poise.configs.schema import build
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.statistics.rates import mcnemar, wilson_interval
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits, load_limits
from poise.training.benchmarking.trials.trial import Trial
from tests.performance.verdicts import variant

KEY = ("block", "robot", "controller", "variant", "trial", "start")
Row = dict[str, Any]


@cache
def robot_of(name: str) -> tuple[Robot, PushLimits]:
    robot = load_robot(name)
    return robot, load_limits(robot, None)


@cache
def agent(robot: str, controller: str, text: str, duration: float) -> Agent:
    _, made, physics = variant(text, robot)
    return load_agent(controller, made, physics=physics, realism="ideal", duration=duration)


def work(block: Row) -> Iterator[tuple[Row, Trial]]:
    """All trials of a block, those of one push one after the other."""
    _, limits = robot_of(block["robot"])
    suite = build(Suite, block["suite"], block["block"]).resized(block["trials"])
    for trial in TrialPlan(suite, limits, block["seed"], block["controllers"]).first:
        for controller in block["controllers"]:
            for start in block.get("starts", [0]):
                for text in block["variants"]:
                    row = {"block": block["block"], "robot": block["robot"],
                           "controller": controller, "variant": text,
                           "trial": trial.number, "start": start}  # fmt: skip
                    yield row, replace(trial, seed=trial.seed + start)


def play(queue: list[Row], out: Path, until: str) -> None:
    done = {tuple(row[key] for key in KEY) for row in rows_of(out)}
    for block in queue:
        for row, trial in work(block):
            if tuple(row[key] for key in KEY) in done:
                continue
            if time.strftime("%H:%M", time.gmtime()) >= until:
                return
            duration = block["suite"].get("duration", Suite.duration)
            acts = agent(row["robot"], row["controller"], row["variant"], duration)
            wall, spent = time.perf_counter(), time.process_time()
            outcome = run_trial(acts, trial)
            row |= {
                "fraction": trial.limit_fraction,
                "recovered": outcome.recovered,
                "fallen": outcome.fallen,
                "error": outcome.error,
                "chatter": outcome.torque_variation,
                "drift": outcome.com_drift,
                "sim": acts.env.simulation.state.time,
                "cpu": round(time.process_time() - spent, 2),
                "wall": round(time.perf_counter() - wall, 2),
            }
            with out.open("a") as file:
                file.write(json.dumps(row) + "\n")


def rows_of(out: Path) -> list[Row]:
    return [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []


def mean(values: list[float | None]) -> float:
    """Their mean, without those of trials that have none."""
    return float(np.mean([value for value in values if value is not None] or [np.nan]))


def table(rows: list[Row]) -> None:
    """Print each variant, and its pairs with the first one of its block, robot and controller."""
    found: dict[tuple, dict[str, dict[tuple, Row]]] = defaultdict(lambda: defaultdict(dict))
    for row in rows:
        group = found[row["block"], row["robot"], row["controller"]]
        group[row["variant"]][row["trial"], row["start"]] = row
    for group, variants in found.items():
        first = next(iter(variants.values()))
        for name, trials in variants.items():
            given = list(trials.values())
            won, upright = (sum(row["recovered"] for row in given),
                            sum(not row["fallen"] for row in given))  # fmt: skip
            low, high = wilson_interval(upright, len(given))
            cost = sum(row["cpu"] for row in given) / sum(row["sim"] for row in given)
            print(*group, f"{name}: recovered {won}, not fallen {upright} of {len(given)} "
                  f"[{low:.3f}, {high:.3f}], chatter {mean([row['chatter'] for row in given]):.3f}"
                  f" /s, drift {1e3 * mean([row['drift'] for row in given]):.1f} mm, "
                  f"{cost:.2f} s CPU a second")  # fmt: skip
            both = [key for key in first if key in trials]
            pairs = [(first[key]["recovered"], trials[key]["recovered"]) for key in both]
            if trials is not first and both:
                lost, gained = pairs.count((True, False)), pairs.count((False, True))
                chatter = [mean([part[key]["chatter"] for key in both]) for part in (trials, first)]
                print(f"    of {len(both)} in both: recovered {sum(a for a, _ in pairs)}, "
                      f"{sum(b for _, b in pairs)}, equal {len(both) - lost - gained}, lost {lost},"
                      f" won {gained}, p = {mcnemar(lost, gained):.2g}, chatter ratio "
                      f"{chatter[0] / chatter[1]:.2f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("queue", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--until", default="24:00")
    parser.add_argument("--allow", nargs="*", default=[], help="as of poise evaluate")
    parser.add_argument("--table", action="store_true")
    args = parser.parse_args()
    if not args.table:
        with allowing(args.allow):
            play(yaml.safe_load(args.queue.read_text()), args.out, args.until)
    table(rows_of(args.out))


if __name__ == "__main__":
    main()
