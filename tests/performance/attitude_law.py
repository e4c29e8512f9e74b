"""A law of attitude on a walker of joint servos, searched by whole trials, folded into its weights.

    a = f ∘ μ(o) + L z,   z = (ω_x, ω_y, ω_z, g_x, g_y) of the newest frame

μ is the mean of the policy, ω the gyro's rate over √(g/h), g the direction of gravity, f (na,) a
factor for each joint, L (na, 5). The right side is the mirror image of the left.

    python -m tests.performance.attitude_law search even out/even --policy OLD --spread 0.7
    python -m tests.performance.attitude_law search ideal out/ideal --policy OLD \\
        --start out/even/7.txt
    python -m tests.performance.attitude_law compare NUMBERS --policy OLD
    python -m tests.performance.attitude_law fold NUMBERS NEW --policy OLD

`search` asks CMA-ES for 14 candidates a generation, all of which meet the same trials (`MIXES`).
What counts is not to fall within 2.6 s of a kick or push, or how late. OLD is `velocity-g1`
without a law (configs/policies at commit a77f6efc). NUMBERS is a file of `search`; those of the
packaged policy are in tests/performance/attitude_law.txt. `fold` writes the policy folder NEW:
ELU is the identity above 0, so five units of each layer pass z on. Results:
docs/log/walking.md#a-law-of-attitude-on-velocity-g1-2026-11-30.
"""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cma
import numpy as np
import torch

from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import load_robot
from poise.training.learning import checkpoints, train
from poise.training.learning.policy import Policy, load_policy, locate_policy
from poise.training.learning.policy_files import POLICY, STATISTICS, read_parameters

AFTER, PARTIAL = 2.6, 0.5  # [s] that counts after a push; what a fall at its end is worth
SIZES = {"f": 0.05, "x": 0.02, "y": 0.02, "z": 0.02, "gx": 0.08, "gy": 0.08}  # of a step of 1
COLUMNS = {"x": 0, "y": 1, "z": 2, "gx": 3, "gy": 4}
SIGN = np.array([-1.0, 1.0, -1.0, 1.0, -1.0])  # of the mirror image of z
LEG = ("f", "gx", "y", "gy", "x")
AHEAD, ASIDE = ("f", "gx", "y"), ("f", "gy", "x")
#: joint, without side and `_joint`; the gains that are searched
SEARCHED: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("hip_pitch", LEG), ("hip_roll", LEG), ("hip_yaw", LEG),
    ("knee", LEG), ("knee_pitch", LEG), ("ankle_pitch", LEG), ("ankle_roll", LEG),
    ("waist_yaw", ("f", "gy", "x", "z")), ("waist", ("f", "gy", "x", "z")),
    ("waist_roll", ASIDE), ("waist_pitch", AHEAD),
    ("hip_yaw", ("z",)), ("shoulder_pitch", AHEAD), ("shoulder_roll", ASIDE),
)  # fmt: skip
#: level, kick [m/s] or push [N·s], least, largest, speed ahead [m/s], how many
MIXES: dict[str, list[tuple[str, str, float, float, float, int]]] = {
    "even": [
        ("field", "kick", 2.5, 3.8, 0.5, 11), ("field", "push", 38, 56, 0.5, 7),
        ("field", "kick", 2.3, 3.6, 0.0, 5), ("late", "kick", 3.2, 4.4, 0.5, 4),
        ("late", "push", 44, 60, 0.5, 3), ("late", "push", 40, 60, 0.0, 1),
        ("ideal", "kick", 3.5, 5.0, 0.5, 6), ("ideal", "push", 46, 64, 0.5, 7),
        ("ideal", "push", 44, 62, 0.0, 4),
    ],
    "ideal": [
        ("ideal", "kick", 3.6, 5.2, 0.5, 12), ("ideal", "push", 46, 64, 0.5, 14),
        ("ideal", "push", 46, 62, 0.0, 4), ("ideal", "kick", 3.2, 4.6, 0.0, 4),
        ("field", "kick", 2.6, 3.8, 0.5, 6), ("field", "push", 40, 56, 0.5, 4),
        ("late", "kick", 3.3, 4.4, 0.5, 4),
    ],
    "t1": [
        ("ideal", "kick", 1.7, 3.2, 0.5, 12), ("ideal", "push", 42, 60, 0.5, 12),
        ("ideal", "push", 42, 60, 0.0, 4), ("ideal", "kick", 1.7, 3.0, 0.0, 2),
        ("field", "kick", 1.2, 2.4, 0.5, 6), ("field", "push", 34, 52, 0.5, 6),
        ("field", "push", 34, 52, 0.0, 2),
        ("late", "kick", 1.4, 2.6, 0.5, 2), ("late", "push", 38, 54, 0.5, 2),
    ],
}  # fmt: skip


def searched(names: Sequence[str]) -> list[tuple[int, str]]:
    """(action, gain) of each number, for the actions of these `names`; those of the left side."""
    plain = [name.lower().removesuffix("_joint").removeprefix("left_") for name in names]
    return [(plain.index(joint), gain) for joint, gains in SEARCHED if joint in plain
            for gain in gains]  # fmt: skip


def law_of(
    numbers: np.ndarray, rows: list[tuple[int, str]], policy: Policy
) -> tuple[np.ndarray, np.ndarray]:
    """f (na,) and L (na, 5); what `rows` leave out is 1 and 0."""
    assert policy.mirrors is not None
    done = policy.mirrors[1]
    f, law = np.ones(len(done.order)), np.zeros((len(done.order), 5))
    for number, (j, gain) in zip(numbers, rows, strict=True):
        if gain == "f":
            f[j] += SIZES[gain] * number
        else:
            law[j, COLUMNS[gain]] = SIZES[gain] * number
    image = done.sign[:, None] * law[done.order] * SIGN
    right = done.order < np.arange(len(done.order))
    f[right] = f[done.order][right]
    law[right] = image[right]
    middle = done.order == np.arange(len(done.order))
    law[middle] = 0.5 * (law + image)[middle]
    return f, law


def mean_action(policy: Policy, seen: np.ndarray) -> np.ndarray:
    """μ(o) (n, na), which `Policy.act` clips."""
    assert policy.mirrors is not None
    observation, action = policy.mirrors
    image = action(policy._mean_action(observation(seen)))
    return 0.5 * (policy._mean_action(seen) + image)


class Trials:
    """The trials of a mix, stepped together."""

    def __init__(self, mix: str, policy: str):
        self.policy = load_policy(policy)
        self.rows = [row[:5] for row in MIXES[mix] for _ in range(row[5])]
        self.batch = EnvBatch([self.policy.make_env(duration=9.0, pushes=None, realism=level)
                               for level, *_ in self.rows])  # fmt: skip
        env = self.batch.envs[0]
        self.numbers, self.body = searched(env.action_names), push_bodies(env.robot)[0]
        self.period = self.batch.envs[0].config.policy_period
        self.newest = len(self.policy.mean) - sum(t.size for t in self.batch.envs[0]._newest)

    def draw(self, seed: int) -> tuple[list[dict[str, Any]], np.ndarray]:
        options, starts = [], []
        for i, (_, kind, low, high, ahead) in enumerate(self.rows):
            rng = np.random.default_rng([seed, i])
            size, direction = rng.uniform(low, high), rng.uniform(0.0, 360.0)
            start = (1.5 if ahead else 0.6) + rng.uniform(0.0, 0.6)
            push: dict[str, Any] = {"direction": direction, "start": start}
            if kind == "kick":
                push["delta_v"] = size
            else:
                push |= {"impulse": size, "duration": 0.1, "body": self.body}
            options.append({"command": [{"start": 0.0, "ahead": ahead}], "push": push})
            starts.append(start)
        return options, np.array(starts)

    def play(self, numbers: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """What each trial is worth, and who did not fall."""
        f, law = law_of(numbers, self.numbers, self.policy)
        options, starts = self.draw(seed)
        count, batch = len(starts), self.batch
        batch.reset([1000 * seed + i for i in range(count)], options)
        ends, live = np.full(count, np.inf), np.ones(count, dtype=bool)
        for step in range(1, int((starts.max() + AFTER) / self.period) + 1):
            seen = batch.observations
            action = f * mean_action(self.policy, seen)
            action += seen[:, self.newest : self.newest + 5] @ law.T
            batch.advance(np.clip(action, -1.0, 1.0), batch.ended)  # who fell begins anew
            fell = live & batch.ended
            ends[fell], live[fell] = step * self.period, False
            if (~live | (step * self.period > starts + AFTER)).all():
                break
        stands = ends > starts + AFTER
        late = np.clip((np.where(stands, 0.0, ends) - starts) / AFTER, -0.2, 1.0)
        return np.where(stands, 1.0, PARTIAL * late), stands


def search(trials: Trials, out: Path, start: np.ndarray, generations: int, spread: float) -> None:
    out.mkdir(parents=True, exist_ok=True)
    strategy = cma.CMAEvolutionStrategy(start, spread, {"popsize": 14, "seed": 7, "verbose": -9})
    for generation in range(generations):
        begun, candidates = time.perf_counter(), strategy.ask()
        worth = [trials.play(each, 500 + generation)[0].mean() for each in candidates]
        strategy.tell(candidates, [-each for each in worth])
        np.savetxt(out / f"{generation}.txt", strategy.mean)
        print(f"{generation}: best {max(worth):.3f}, mean {np.mean(worth):.3f}, "
              f"{time.perf_counter() - begun:.0f} s", flush=True)  # fmt: skip


def compare(trials: Trials, numbers: np.ndarray, seed: int, batches: int) -> None:
    levels = np.tile([level for level, *_ in trials.rows], batches)
    without, with_it = (
        np.concatenate([trials.play(each, seed + k)[1] for k in range(batches)])
        for each in (np.zeros(len(numbers)), numbers)
    )
    for level in dict.fromkeys(levels):
        a, b = without[levels == level], with_it[levels == level]
        print(f"{level}: not fallen {a.sum()}, {b.sum()} of {len(a)}, won {(b & ~a).sum()}, "
              f"lost {(a & ~b).sum()}")  # fmt: skip


def fold(numbers: np.ndarray, trials: Trials, name: str, out: Path) -> None:
    policy, source, newest = load_policy(name), locate_policy(name), trials.newest
    f, law = law_of(numbers, trials.numbers, policy)
    mean, scale = policy.mean[newest : newest + 5], policy.scale[newest : newest + 5]
    weights = {
        key: value.clone() for key, value in read_parameters(source / POLICY)["policy"].items()
    }
    for layer in range(0, 2 * (len(policy.layers) - 1), 2):
        key = f"mlp_extractor.policy_net.{layer}"
        weight, bias = weights[f"{key}.weight"], weights[f"{key}.bias"]
        rows, columns = weight.shape
        more = 5 if layer else 0
        wide, shift = torch.zeros(rows + 5, columns + more), torch.zeros(rows + 5)
        wide[:rows, :columns], shift[:rows] = weight, bias
        first = columns if layer else newest
        wide[rows:, first : first + 5] = torch.eye(5)
        shift[rows:] = 0.0 if layer else policy.clip  # so that what passes is not negative
        weights[f"{key}.weight"], weights[f"{key}.bias"] = wide, shift
    factor = torch.tensor(f, dtype=torch.float32)
    passed = torch.tensor(law / scale, dtype=torch.float32)
    offset = torch.tensor(law @ mean - policy.clip * (law / scale).sum(1), dtype=torch.float32)
    head = weights["action_net.weight"]
    weights["action_net.weight"] = torch.cat([head * factor[:, None], passed], 1)
    weights["action_net.bias"] = weights["action_net.bias"] * factor + offset
    ppo = replace(policy.config.ppo, net_arch=tuple(n + 5 for n in policy.config.ppo.net_arch))
    config = replace(policy.config, ppo=ppo)
    one = replace(config, ppo=replace(ppo, n_envs=1), start_from=None)
    normalize = train._training_envs(one, load_robot(config.robot))
    model = train.make_model(one, normalize)
    model.policy.load_state_dict(weights)
    checkpoints.restore_statistics(source / STATISTICS, normalize)
    model.num_timesteps = policy.state["timesteps"]
    checkpoints.save_checkpoint(out, model, normalize, config, policy.state)
    for name in ("LICENSE", "NOTICE.md", "evaluations.csv"):
        shutil.copy(source / name, out / name)
    seen = 0.5 * np.random.default_rng(1).normal(size=(200, len(policy.mean)))
    action = f * mean_action(policy, seen) + seen[:, newest : newest + 5] @ law.T
    error = np.abs(load_policy(out).act(seen) - np.clip(action, -1.0, 1.0)).max()
    print(f"{out}: differs by {error:.1e} at most")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=("search", "compare", "fold"))
    parser.add_argument("what", help="a mix for search, else a file of numbers")
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("--policy", default="velocity-g1", help="a packaged one, or its folder")
    parser.add_argument("--mix", choices=MIXES, default="ideal", help="of compare")
    parser.add_argument("--start", type=Path, help="a file of numbers")
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--spread", type=float, default=0.5)
    parser.add_argument("--seed", type=int, default=95001)
    parser.add_argument("--batches", type=int, default=3)
    args = parser.parse_args()
    trials = Trials(args.what if args.task == "search" else args.mix, args.policy)
    numbers = np.zeros(len(trials.numbers))
    known = args.start if args.task == "search" else Path(args.what)
    if known is not None:
        numbers = np.loadtxt(known)
    if args.task == "search":
        search(trials, args.out, numbers, args.generations, args.spread)
    elif args.task == "compare":
        compare(trials, numbers, args.seed, args.batches)
    else:
        fold(numbers, trials, args.policy, args.out)


if __name__ == "__main__":
    main()
