"""How cost grows: `python -m tests.performance.scaling [--out docs/images]` writes scaling.png.

The control tick (state known → torques) against degrees of freedom and against soles, on robots of
`scaling_robots`, and the environment's step against the number of environments; each beside the
physics alone (`mj_step`). The clock is the processor's time of this process, so other jobs on the
machine do not count. The call from Python is taken off the tick: it is the time of `accept`, which
takes the same arguments and does next to nothing.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.whole_body.momentum_qp import MomentumQP, accept, momentum_tick
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.physics.kinematics import allocate_state, update_state
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot
from poise.training.pictures.figures.palette import BLUE, GREEN, GREY, ORANGE
from poise.training.pictures.figures.style import saved_figure
from tests.performance.scaling_robots import make_robot, with_soles

SIZES = ((3, 0), (6, 0), (6, 6), (6, 12), (6, 18), (6, 24), (6, 30), (6, 36), (6, 42))
TICKS, SUBSTEPS = 120, 2
ENVS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
ENV_STEPS = 256  # at least, for each number of environments
clock = time.process_time


class Cost(NamedTuple):
    """Median times [µs] and the medians of what the solver met."""

    n: int  # unknowns
    tick: float
    p99: float
    state: float
    step: float  # mj_step
    active: float
    unsolved: int


class Rig:
    """A controller with a state of its own, fed from a simulation."""

    def __init__(self, robot: Robot, simulation: Simulation):
        self.controller = MomentumQP(robot)
        self.views = simulation.views
        self.s = allocate_state(robot.model.nv, len(robot.soles), robot.model.nbody)
        self.state = RobotState(self.controller.arrays, self.s)
        self.update()
        self.targets = Targets.standing(robot, self.state)
        self.times: dict[str, list[float]] = {"tick": [], "state": [], "active": []}

    def update(self) -> None:
        update_state(self.controller.arrays, self.views, self.s)

    def tick(self) -> np.ndarray:
        """Torques of every motor; what it took is remembered."""
        c, ws = self.controller, self.controller.workspace
        tick = c.tick(self.state, self.targets)
        spent = _timed(lambda: momentum_tick(tick))
        torques = ws.tau[c.arrays.motor_dofs - 6].copy()
        ws.status = 1
        call = _timed(lambda: accept(self.s, c.parameters, ws, c.memory))
        c.memory.failures -= 1
        c.memory.streak -= 1
        self.times["tick"].append(spent - call)
        self.times["state"].append(_timed(self.update))
        self.times["active"].append(float(ws.iscratch[1]))
        return torques

    def cost(self, step: float) -> Cost:
        tick, state, active = (1e6 * np.array(t[10:]) for t in self.times.values())
        return Cost(
            len(self.controller.workspace.g), float(np.median(tick)),
            float(np.percentile(tick, 99)), float(np.median(state)), step,
            float(np.median(active)) / 1e6, self.controller.failures,
        )  # fmt: skip


def _timed(call: Callable[[], object]) -> float:
    start = time.thread_time()
    call()
    return time.thread_time() - start


def ticks(robot: Robot, variants: Sequence[Robot]) -> list[Cost]:
    """Costs of controllers on the way back from a push; the last one of them acts."""
    model, simulation = robot.model, Simulation(robot)
    body = model.body(robot.root_body_id).name
    simulation.reset(pushes=[Push(body, 0.02, 0.1, 0.15 * robot.mass, 0.0)])
    rigs = [Rig(variant, simulation) for variant in variants]
    shadow, steps = mujoco.MjData(model), []
    for _ in range(TICKS):
        for rig in rigs:
            rig.update()
            torques = rig.tick()
        data = simulation.data
        shadow.qpos[:], shadow.qvel[:], shadow.ctrl[:] = data.qpos, data.qvel, torques
        shadow.qacc_warmstart[:] = data.qacc_warmstart
        for _ in range(SUBSTEPS):
            steps.append(_timed(lambda: mujoco.mj_step(model, shadow)))
        simulation.step(torques, SUBSTEPS)
    step = 1e6 * float(np.median(steps))
    return [rig.cost(step) for rig in rigs]


def by_size() -> dict[int, Cost]:
    costs = {}
    for leg_joints, arm_joints in SIZES:
        with tempfile.TemporaryDirectory() as room:
            robot = make_robot(Path(room), arm_joints, leg_joints)
        costs[robot.model.nv] = ticks(robot, [robot])[0]
    return costs


def by_soles() -> dict[int, Cost]:
    """One four-legged robot of 36 degrees of freedom, controlled as if on its first 1 to 4 soles.

    It stands on all four, so with fewer the controller's picture is wrong, but not its cost.
    """
    with tempfile.TemporaryDirectory() as room:
        robot = make_robot(Path(room), 6, 6, legs=4)
    counts = (1, 2, 3, 4)
    return dict(zip(counts, ticks(robot, [with_soles(robot, n) for n in counts]), strict=True))


def by_environments(counts: Sequence[int], threads: int) -> dict[int, tuple[float, float]]:
    """Processor time [µs] of one environment's step, and of its `mj_step` calls alone."""
    first = ResidualBalanceEnv()
    envs = [first] + [ResidualBalanceEnv(first.robot) for _ in range(max(counts) - 1)]
    found = {}
    for n in counts:
        batch = EnvBatch(envs[:n], threads)
        batch.reset(list(range(n)))
        actions, repeats = np.zeros((n, *first.action_space.shape)), -(-ENV_STEPS // n)
        spent, floor = [], []
        for _ in range(repeats):
            start = clock()
            batch.step(actions)
            spent.append((clock() - start) / n)
            states = [(env.simulation.data.qpos.copy(), env.simulation.data.qvel.copy())
                      for env in batch.envs]  # fmt: skip
            if len(floor) * n < 64:  # what follows disturbs the environments: on copies of states
                floor.append(_physics(batch.envs, first.substeps) / n)
                for env, (qpos, qvel) in zip(batch.envs, states, strict=True):
                    env.simulation.data.qpos[:], env.simulation.data.qvel[:] = qpos, qvel
                    mujoco.mj_forward(env.robot.model, env.simulation.data)
        found[n] = 1e6 * float(np.median(spent)), 1e6 * float(np.median(floor))
        batch.close()
    return found


def _physics(envs: Sequence[ResidualBalanceEnv], substeps: int) -> float:
    start = clock()
    for env in envs:
        mujoco.mj_step(env.robot.model, env.simulation.data, nstep=substeps)
    return clock() - start


def draw(
    path: Path,
    sizes: dict[int, Cost],
    soles: dict[int, Cost],
    envs: dict[int, tuple[float, float]],
) -> None:
    with saved_figure(path, 10.5, 3.4) as figure:
        left, middle, right = figure.subplots(1, 3)
        for axes, costs, label in (
            (left, sizes, "degrees of freedom"), (middle, soles, "soles (36 degrees of freedom)"),
        ):  # fmt: skip
            x = list(costs)
            axes.plot(x, [c.tick for c in costs.values()], "o-", color=BLUE, label="tick")
            axes.plot(x, [c.state for c in costs.values()], "s-", color=GREEN, label="state")
            axes.plot(x, [c.step for c in costs.values()], "--", color=GREY, label="mj_step")
            axes.set(xlabel=label, ylabel="time [µs]", ylim=(0, None))
        middle.set_xticks(list(soles))
        left.legend()
        x = list(envs)
        right.plot(x, [1e6 / step for step, _ in envs.values()], "o-", color=ORANGE, label="env")
        right.plot(x, [1e6 / f for _, f in envs.values()], "--", color=GREY, label="10 mj_step")
        right.set_xscale("log", base=2)
        right.set_xticks(x[::2], [str(n) for n in x[::2]])
        right.minorticks_off()
        right.set(xlabel="environments", ylabel="steps per second of a core", ylim=(0, None))
        right.legend()


def main(args: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--envs", type=int, nargs="*", default=ENVS)
    options = parser.parse_args(sys.argv[1:] if args is None else args)
    sizes, soles = by_size(), by_soles()
    for name, costs in (("degrees of freedom", sizes), ("soles", soles)):
        print(f"\n| {name} | unknowns | tick | p99 | state | mj_step | active rows | unsolved |")
        print("| --- |" + " --- |" * 7)
        for x, c in costs.items():
            print(f"| {x} | {c.n} | {c.tick:.0f} µs | {c.p99:.0f} µs | {c.state:.0f} µs | "
                  f"{c.step:.0f} µs | {c.active:.0f} | {c.unsolved} |", flush=True)  # fmt: skip
    envs = by_environments(options.envs, options.threads)
    print("\n| environments | step | 10 × mj_step | ratio | steps per second of a core |")
    print("| --- |" + " --- |" * 4)
    for n, (step, floor) in envs.items():
        print(f"| {n} | {step:.0f} µs | {floor:.0f} µs | {step / floor:.2f} | {1e6 / step:.0f} |")
    draw(options.out / "scaling.png", sizes, soles, envs)


if __name__ == "__main__":
    main()
