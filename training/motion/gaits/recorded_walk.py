"""The packaged clip of walks, for motion matching: `python -m` this file, [FILE], makes it again.

It is what a controller walks in the simulation at commands that change.
"""

import sys
from pathlib import Path

import numpy as np

from poise.baselines.motion.clips.bvh import write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.walking.schedule import TimedCommand
from poise.configs.files import packaged_folder
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.agents import load_agent

from ..recording import clip_of

NAME, CONTROLLER = "humanoid_gaits", "walk-fast"
RATE = 1.0 / 30.0  # [s]
#: from a time [s] on: ahead [m/s], left [m/s], turn [rad/s]
SCHEDULE = (
    (0.0, 0.0, 0.0, 0.0),
    (0.6, 0.3, 0.0, 0.0),
    (5.0, 0.5, 0.0, 0.0),
    (9.0, 0.9, 0.0, 0.0),
    (12.0, 1.3, 0.0, 0.0),
    (18.0, 0.7, 0.0, 0.4),
    (22.0, 0.7, 0.0, -0.4),
    (26.0, 0.0, 0.0, 0.0),
)
DURATION = 29.0  # [s]


def record_walk() -> Clip:
    """Return the clip: the same bits on one machine, nearly the same on others.

    Raises RuntimeError if the robot falls.
    """
    robot = load_robot("humanoid")
    agent = load_agent(CONTROLLER, robot, duration=DURATION, pushes=None)
    env = agent.env
    commands = [TimedCommand(ahead, left, turn, start=start)
                for start, ahead, left, turn in SCHEDULE]  # fmt: skip
    observation, _ = env.reset(seed=0, options={"push": [], "command": commands, "noise": 0.0})
    postures = [env.simulation.data.qpos.copy()]
    while env.simulation.time < DURATION - 0.5 * env.config.policy_period:
        observation = env.step(agent.act(observation))[0]
        postures.append(env.simulation.data.qpos.copy())
        if env.fallen:
            raise RuntimeError(f"{CONTROLLER} fell after {env.simulation.time:.1f} s")
    clip = clip_of(robot, np.array(postures), env.config.policy_period, NAME)
    return clip.resampled(RATE)


def main(file: str | Path | None = None) -> None:
    """Write the clip to `file`; in the place of the packaged one if not given."""
    out = packaged_folder("clips") / "walks" / f"{NAME}.bvh" if file is None else Path(file)
    write_bvh(record_walk(), out)
    print(out)


if __name__ == "__main__":
    main(*sys.argv[1:2])
