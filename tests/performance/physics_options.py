"""The same pushes in other physics: `python -m tests.performance.physics_options`.

The robot is simulated in other steps, by another integrator, with other friction cones, and with
contacts that are twice as soft; the same starts, directions and pushes as with its own options. A
row that differs from the first by more than its interval is marked. `--out DIR` keeps the results,
and goes on where it stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from poise.configs.files import resolve, write_atomic
from poise.training.benchmarking.evaluation.evaluate import benchmark
from poise.training.benchmarking.evaluation.folder import read_outcomes
from poise.training.benchmarking.statistics.differences import paired_rates

Recovered = dict[tuple[str, int], bool]  # controller, trial


@dataclass(frozen=True)
class Physics:
    """Options in place of the robot's own, and fields of a level of realism."""

    name: str
    options: Mapping[str, Any]
    ground: Mapping[str, Any]


OWN = Physics("its own", {}, {})
OTHERS = (
    Physics("step 1 ms", {"timestep": 0.001}, {}),
    Physics("step 4 ms", {"timestep": 0.004}, {}),
    Physics("Euler", {"integrator": "Euler"}, {}),
    Physics("elliptic cones", {"cone": "elliptic"}, {}),
    Physics("contacts twice as soft", {}, {"softness": 0.04}),
)


def play(
    physics: Physics, robot: str, controllers: list[str], trials: int, seed: int, out: Path
) -> Recovered:
    """Whether each trial of the suite `random` was recovered; pushes go by the ankle limit."""
    folder = out / physics.name.replace(" ", "-")
    description = yaml.safe_load(resolve("robots", robot).read_text())
    description.setdefault("options", {}).update(physics.options)
    path = out / f"{folder.name}.yaml"
    write_atomic(path, yaml.safe_dump(description))
    level = out / f"{folder.name}-realism.yaml"
    write_atomic(level, yaml.safe_dump({"ground": dict(physics.ground)}))
    benchmark(
        controllers,
        "random",
        out=folder,
        robot=str(path),
        seed=seed,
        trials=trials,
        realism=str(level) if physics.ground else None,
    )
    played, _ = read_outcomes(folder)
    return {key: outcome.recovered for key, outcome in played.items()}


def compare(own: Recovered, other: Recovered, controller: str) -> str:
    """Recovered there, and the paired difference to the robot's own options."""
    pairs = [(own[key], other[key]) for key in own if key[0] == controller]
    counts = [pairs.count(pair) for pair in ((True, True), (True, False), (False, True))]
    both, lost, won = counts
    change, (low, high) = paired_rates(both, lost, won, len(pairs) - sum(counts))
    moved = " *" if low > 0.0 or high < 0.0 else ""
    rate = (both + won) / len(pairs)
    return f"{rate:6.1%}  {100 * change:+5.1f} [{100 * low:+.1f}, {100 * high:+.1f}]{moved}"


def main() -> None:
    """Print a line per physics and controller."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("controllers", nargs="*", default=["momentum-qp", "feedback-step"])
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    named = (given.robot, given.controllers, given.trials, given.seed, given.out)
    own = play(OWN, *named)
    for controller in given.controllers:
        rate = sum(own[key] for key in own if key[0] == controller) / given.trials
        print(f"{controller:20} {OWN.name:24} {rate:6.1%}", flush=True)
    for physics in OTHERS:
        other = play(physics, *named)
        for controller in given.controllers:
            print(
                f"{controller:20} {physics.name:24} {compare(own, other, controller)}", flush=True
            )


if __name__ == "__main__":
    main()
