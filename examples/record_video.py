"""Gymnasium's RecordVideo: python examples/record_video.py [FOLDER]

Needs MoviePy: pip install -e ".[video]" in a checkout; without a display MUJOCO_GL=egl or osmesa.
"""

import sys

import gymnasium
from gymnasium.wrappers import RecordVideo

import poise  # noqa: F401  (registers the environments)

folder = sys.argv[1] if len(sys.argv) > 1 else "videos"
env = gymnasium.make("poise/ResidualBalance-v0", render_mode="rgb_array", duration=1.0)
env = RecordVideo(env, folder, episode_trigger=lambda episode: True)
for seed in range(2):
    env.reset(seed=seed)
    done, frames = False, 1
    while not done:
        _, _, fell, ended, _ = env.step([0.0, 0.0, 0.0, 0.0])
        done, frames = fell or ended, frames + 1
    print(f"{folder}/rl-video-episode-{seed}.mp4: {frames} frames")
env.close()
