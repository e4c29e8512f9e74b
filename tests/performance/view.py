"""`poise view` against the wall clock: `python -m tests.performance.view [--seconds 20]`.

The share of real time with one controller, with one that performs a motion beside the ghost of it,
and with three side by side, and the time from the moment at which a push is asked for to the moment
at which its first picture has been sent. No page is open: a browser on the same machine takes
processor time of its own.
"""

from __future__ import annotations

import argparse
import threading
import time

import numpy as np

from poise.baselines.balance.references.motion import load_motion
from poise.envs.robots.robot import load_robot
from poise.training.pictures.sessions.live import Live
from poise.training.pictures.sessions.session import load_session
from poise.training.pictures.view.browser import BrowserView
from poise.training.pictures.view.server import serving

NAMES = ("feedback-step", "momentum-qp", "capture-step")
PUSH = {"impulse": 6.0, "direction": 90.0, "duration": 0.1, "body": "torso"}


def measure(
    names: tuple[str, ...], seconds: float, motion: str | None = None
) -> tuple[float, list[float]]:
    """Share of real time, and the delays [s] of a push a second."""
    robot = load_robot("humanoid")
    reference = None if motion is None else load_motion(motion, robot)
    live = Live(load_session(names, robot, motion=reference))
    delays: list[float] = []
    with serving("127.0.0.1", 0) as server:
        view = BrowserView(server, live, lambda spec: live)
        show = view.stage.show

        def shown(frames) -> None:
            show(frames)
            if asked and frames[0].values["push"] > 0.0:
                delays.append(time.monotonic() - asked.pop())

        asked: list[float] = []
        view.stage.show = shown

        def push() -> None:
            for _ in range(int(seconds) - 1):
                time.sleep(1.0 + 0.01 * np.random.default_rng().uniform())
                asked.append(time.monotonic())
                view.ask(view.push, dict(PUSH))

        threading.Thread(target=push, daemon=True).start()
        view.run(seconds)
        return view.pace.total, delays


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    seconds = parser.parse_args().seconds
    for names, motion in ((NAMES[:1], None), (NAMES[:1], "squat"), (NAMES, None)):
        share, delays = measure(names, seconds, motion)
        middle, most = 1e3 * np.median(delays), 1e3 * np.max(delays)
        print(f"{len(names)} controllers, motion {motion or 'standing'}: {share:.3f} × real time")
        print(f"  a push is sent as a picture after {middle:.0f} ms (median of {len(delays)}), "
              f"at most {most:.0f} ms")  # fmt: skip


if __name__ == "__main__":
    main()
