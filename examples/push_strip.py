"""The picture of the README: the baseline under a push of 16 N·s from behind.

python examples/push_strip.py docs/images/push_strip.png
"""

import sys

from poise.envs import choose_gl_backend

choose_gl_backend()  # before anything loads MuJoCo

import numpy as np  # noqa: E402

from poise.baselines import ResidualBalanceEnv  # noqa: E402
from poise.envs import SceneRenderer  # noqa: E402
from poise.training import frame_strip  # noqa: E402

PUSH = {"impulse": 16.0, "direction": 0.0, "duration": 0.1, "start": 0.5, "body": "torso"}
STEPS = (25, 30, 40, 48, 60, 80, 110, 150)  # policy steps of 20 ms


def main(path: str) -> None:
    """Write the frames at `STEPS` to one PNG."""
    env = ResidualBalanceEnv(pushes=None)
    env.reset(seed=0, options={"push": PUSH})
    renderer = SceneRenderer(env.simulation, human=False, width=300, height=300)
    frames, times = [], []
    for step in range(1, max(STEPS) + 1):
        env.step(np.zeros(4))
        if step in STEPS:
            frames.append(renderer.render())
            times.append(env.simulation.time)
    renderer.close()
    frame_strip(path, frames, times, columns=4)


if __name__ == "__main__":
    main(sys.argv[1])
