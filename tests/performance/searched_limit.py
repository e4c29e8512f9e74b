"""How much a robot takes when its policy's actions are searched for each push, known beforehand.

    python -m tests.performance.searched_limit [--policy residual-torque] [--body torso]

For the push of each direction, from the same start, CMA-ES [Hansen16] looks for an offset of the
policy's actions,

    a(t) = clip(π(o(t)) + δ(t), −1, 1),    δ linear between knots every 0.1 s for a second

from the push on, with which the robot recovers. Levels are a `--step` [N·s] apart; each begins with
what was found for the one below, and the first one that is lost ends it. A sample that falls is
worth how long it stood, others more the slower and the more upright they are 1.9 s after the push
began.

The search knows the push and the start, and may try as often as `--samples` says; a policy has one
try and has to find out. So a policy through the same actions has less than what a perfect search
would find. This one is not perfect, and the actions are not all that the motors can do: it is an
estimate from below of what this interface can reach.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import cma
import numpy as np

from poise.envs.physics.pushes.push import Push
from poise.training.learning.policy import load_policy

KNOTS, SPACING = 11, 0.1  # of δ; [s]
JUDGED = 1.9  # [s] after the push begins
LONGEST, START, DURATION = 4.0, 0.3, 0.1  # [s] of a trial, and of its push
SPREAD, POPULATION = 0.15, 20  # of CMA-ES
CALM = 0.7  # [m/s] of the CoM, below which a sample is played to the trial's end
SEED = 7


class Trials:
    """One environment of a policy, in which pushes are played with offsets of its actions."""

    def __init__(self, policy: str):
        self.policy = load_policy(policy)
        self.env = self.policy.make_env(duration=LONGEST)
        self.size = self.env.action_space.shape[0]

    def play(self, push: Push, offsets: np.ndarray, whole: bool = False) -> tuple[float, bool]:
        """The worth of offsets (KNOTS, na), and whether the robot stands; with `whole` is at rest.

        Worth is the time of the fall, or JUDGED + 1 and more.
        """
        env, act = self.env, self.policy.act
        observation, _ = env.reset(seed=SEED, options={"push": push, "noise": 0.0})
        ends = LONGEST if whole else push.start + JUDGED
        for step in range(round(ends / env.config.policy_period)):
            action = act(observation)
            knot = (step * env.config.policy_period - push.start) / SPACING
            if 0.0 <= knot < KNOTS - 1:
                k = int(knot)
                action = action + (k + 1 - knot) * offsets[k] + (knot - k) * offsets[k + 1]
            _, fallen, _ = env.step_without_info(np.clip(action, -1.0, 1.0))
            observation = env.episode.observation.astype(np.float32)
            if fallen:
                return (step + 1) * env.config.policy_period - push.start, False
        state = env.simulation.state_arrays
        speed = float(np.hypot(state.com_vel[0], state.com_vel[1]))
        worth = JUDGED + 1.0 + max(0.0, 2.0 - speed) + max(0.0, float(state.root_axes[2, 2]))
        return worth, env.recovered if whole else speed < CALM

    def search(self, push: Push, guess: np.ndarray, samples: int) -> np.ndarray | None:
        """Offsets (KNOTS, na) with which the push is recovered from; None: none were found."""
        if self.play(push, guess, whole=True)[1]:
            return guess
        options = {"CMA_diagonal": True, "popsize": POPULATION, "verbose": -9, "seed": SEED}
        strategy = cma.CMAEvolutionStrategy(guess.ravel(), SPREAD, options)
        for _ in range(samples // POPULATION):
            numbers = strategy.ask()
            found = [each.reshape(guess.shape) for each in numbers]
            played = [self.play(push, each) for each in found]
            price = [0.02 * float(np.mean((each / SPREAD) ** 2)) for each in numbers]
            costs = [cost - worth for cost, (worth, _) in zip(price, played, strict=True)]
            strategy.tell(numbers, costs)
            best = int(np.argmin(costs))
            if played[best][1] and self.play(push, found[best], whole=True)[1]:
                return found[best]
        return None


def searched_limit(
    direction: float, policy: str, body: str, first: float, step: float, samples: int
) -> tuple[float, float]:
    """The last level [N·s] before the first one that is lost, alone and searched; 0: the first is.

    What is recovered from above a lost level does not count. The search goes on from where the
    policy alone is lost.
    """
    trials, alone = Trials(policy), 0.0
    push = partial(Push, body, START, DURATION, direction=direction)
    none = np.zeros((KNOTS, trials.size))
    level, limit, guess = first, 0.0, none
    while trials.play(push(level), none, whole=True)[1]:
        alone = limit = level
        level += step
    while (found := trials.search(push(level), guess, samples)) is not None:
        limit, guess = level, found
        level += step
    return alone, limit


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--policy", default="residual-torque")
    parser.add_argument("--body", default="torso")
    parser.add_argument("--directions", type=float, nargs="+", metavar="DEGREES",
                        default=[22.5 * i for i in range(9)])  # fmt: skip
    parser.add_argument("--first", type=float, default=16.0, help="lowest level [N·s]")
    parser.add_argument("--step", type=float, default=3.0, help="[N·s]")
    parser.add_argument("--samples", type=int, default=1500, help="at most, of each level")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    mass = load_policy(given.policy).make_env().robot.mass
    job = partial(searched_limit, policy=given.policy, body=given.body, first=given.first,
                  step=given.step, samples=given.samples)  # fmt: skip
    print(f"{given.policy}, pushes of {given.body} {DURATION} s long, {given.samples} samples a "
          f"level of {given.step:g} N·s")  # fmt: skip
    print(f"{'direction':>9} {'policy alone':>20} {'actions searched':>20}")
    found = []
    with ProcessPoolExecutor(given.workers) as pool:
        for direction, limits in zip(
            given.directions, pool.map(job, given.directions), strict=True
        ):
            found.append(limits)
            cells = [f"{limit:.0f} N·s {limit / mass:.2f} N·s/kg" for limit in limits]
            print(f"{direction:8.1f}° {cells[0]:>20} {cells[1]:>20}")
            sys.stdout.flush()
    alone, searched = np.mean(found, axis=0) / mass
    print(f"mean: policy alone {alone:.2f}, searched {searched:.2f} N·s/kg")


if __name__ == "__main__":
    main()
