"""What a level of realism costs: `python -m tests.performance.realism [LEVEL…]`.

In one process. The layer (motors before a physics step, sensors after it) and the belief of a tick
are called in a compiled loop, in the middle of a recovery; a belief with the measurements of the
physics steps of a tick before it, which are taken off again. Of these the least of five passes
counts. Trials of the same pushes are played as by `poise evaluate`, by turns at `ideal` and at each
level, and compared by the time of a policy step, since some end early; the median counts.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.jit import compiled
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import load_robot
from poise.envs.sensing.estimator import EstimatedState
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Trial

CALLS, PASSES, TRIALS = 2000, 5, 24
IMPULSE = 12.0  # [N·s]
CONTROLLER = "momentum-qp"


@compiled
def _layer(drive: Program, sense: Program, count: int):
    for _ in range(count):
        run(drive)
        run(sense)


@compiled
def _ticks(sense: Program, estimate: Program, steps: int, count: int):
    """A belief after each `steps` measurements; with no estimate to run, these alone."""
    for _ in range(count):
        for _ in range(steps):
            run(sense)
        run(estimate)


def least(call, count: int) -> float:
    """Seconds of each of `count` calls within `call()`, the least of the passes."""
    times = []
    for _ in range(PASSES + 1):  # the first compiles
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times[1:]) / count


def calls(level: str) -> tuple[float, float]:
    """Seconds of the layer in a physics step, and of the belief in a tick, after a push."""
    env = ResidualBalanceEnv(load_robot(), controller=CONTROLLER, pushes=None, realism=level)
    env.reset(seed=0, options={"push": {"impulse": IMPULSE, "direction": 0.0, "start": 0.1}})
    for _ in range(20):
        env.step_without_info(np.zeros(env.action_space.shape))
    source = env.state_source
    assert isinstance(source, EstimatedState)
    steps = round(env.controller.period / env.robot.model.opt.timestep)
    nothing = Program.of([])
    layer = least(lambda: _layer(source.drive, source.sense, CALLS), CALLS)
    with_belief = least(lambda: _ticks(source.sense, source.estimate, steps, CALLS), CALLS)
    without = least(lambda: _ticks(source.sense, nothing, steps, CALLS), CALLS)
    return layer, with_belief - without


def trial(agent: Agent, number: int) -> float:
    """Seconds a policy step of a trial, its reset among them."""
    body = push_bodies(agent.env.robot)[0]
    push = Push(body, 0.5, 0.1, IMPULSE, 360.0 * number / TRIALS)
    start = time.perf_counter()
    run_trial(agent, Trial(number, number, (push,)))
    return (time.perf_counter() - start) / agent.env.steps


def main() -> None:
    levels = sys.argv[1:] or ["lab", "field"]
    agents = {
        level: load_agent(CONTROLLER, load_robot(), realism=level, duration=6.0)
        for level in ["ideal", *levels]
    }
    for agent in agents.values():
        trial(agent, 0)  # compiled
    times: dict[str, list[float]] = {level: [] for level in agents}
    for k in range(TRIALS):
        for level, agent in agents.items():
            times[level].append(trial(agent, k))
    print("| level | layer, a physics step | belief, a tick | a trial over that at `ideal` |")
    print("| --- | --- | --- | --- |")
    for level in levels:
        layer, belief = calls(level)
        ratio = np.median(np.array(times[level]) / np.array(times["ideal"]))
        print(f"| `{level}` | {1e6 * layer:.2f} µs | {1e6 * belief:.1f} µs | {ratio:.2f} |")


if __name__ == "__main__":
    main()
