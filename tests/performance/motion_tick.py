"""The control tick with a motion over that without: `python -m tests.performance.motion_tick`.

All in one process and in turns, so that what else the machine does falls on all alike: blocks of
policy steps of each environment, the order drawn anew in each round; the tenth part of the rounds
that was fastest counts, since others on the machine only ever add time. Each controller is compared
with itself standing. Motions with steps have one row more for each: their ticks are others.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.splines import piecewise, rest_spline
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.robots.robot import load_robot

STEPS, ROUNDS = 50, 60
STEP: dict[str, object] = {"controller": "motion-step"}
KINDS: dict[str, dict[str, object]] = {
    "standing": {},
    "keyframes (squat)": {"motion": "squat"},
    "keyframes, waits": {"motion": "squat", "tempo": {"waits": True}},
    "captured (200 knots)": {"motion": "dense"},
    "captured, waits": {"motion": "dense", "tempo": {"waits": True}},
    "motion-step, standing": STEP,
    "motion-step, keyframes (squat)": {"motion": "squat", **STEP},
    "motion-step, kick": {"motion": "kick", **STEP},
    "motion-step, step_in_place": {"motion": "step_in_place", **STEP},
}


def main() -> None:
    envs = {name: _environment(**given) for name, given in KINDS.items()}
    rng, times = np.random.default_rng(0), {name: np.zeros(ROUNDS) for name in envs}
    for k in range(ROUNDS):
        for name in rng.permutation(list(envs)):
            times[name][k] = _block(envs[name])
    print("| motion | tick and its physics | over standing |")
    print("| --- | --- | --- |")
    for name, found in times.items():
        stands = "motion-step, standing" if "controller" in KINDS[name] else "standing"
        first, best = np.percentile(times[stands], 10.0), np.percentile(found, 10.0)
        print(f"| {name} | {1e6 * best:.1f} µs | {best / first:.3f} |")


def _environment(motion: str = "standing", **given: object) -> ResidualBalanceEnv:
    robot = load_robot()
    chosen = "squat" if motion == "dense" else motion
    env = ResidualBalanceEnv(robot, motion=chosen, pushes=None, duration=1e5, **given)
    if motion == "dense":
        env.motion = _dense(env)
    env.reset(seed=0)
    _block(env)
    return env


def _dense(env: ResidualBalanceEnv) -> ReferenceMotion:
    """The motion with as many knots as a captured one of 7 s has, the same curve otherwise."""
    motion = env.motion
    times = np.linspace(0.0, motion.duration, 200)
    rows = [motion.sample(t) for t in times]
    columns = np.array([np.concatenate([r.q_ref, r.com_offset, r.root]) for r in rows])
    knots, coeffs = piecewise([rest_spline(times, columns)])
    return replace(motion, knots=knots, coeffs=coeffs)


def _block(env: ResidualBalanceEnv) -> float:
    """Seconds of processor time per control tick, over some policy steps."""
    if env.simulation.time > 8.0:
        env.reset(seed=0)
    action = np.zeros(len(env.action_names))
    start = time.process_time()
    for _ in range(STEPS):
        env.step_without_info(action)
    return (time.process_time() - start) / (STEPS * env.ticks)


if __name__ == "__main__":
    main()
