"""Why others fall where the momentum QP does not: `python -m tests.performance.order [PICTURE]`.

One push of 16 N·s backward on the torso, the same start for all. For each controller: how far the
capture point ξ is behind the heels, the largest angular momentum in the sense of the fall, when it
is given back, and how long a motor is at its limit. With PICTURE, their course in time.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.training.pictures.figures.palette import AMBER
from poise.training.pictures.figures.style import legend_below, look, saved_figure

NAMES = ("momentum-qp", "macchietto09", "lqr-lip", "capture-point", "lip-mpc")
PUSH = {"impulse": 16.0, "direction": 180.0, "duration": 0.1, "start": 0.5, "body": "torso"}
SEED, SECONDS = 1, 2.0  # the start; how much of the trial is shown

Course = Mapping[str, np.ndarray]


def play(name: str) -> tuple[Course, bool]:
    """What happened at every policy step, and whether it recovered."""
    env = ResidualBalanceEnv(controller=name, pushes=None, duration=6.0)
    env.reset(seed=SEED, options={"push": PUSH})
    idle = np.zeros(env.action_space.shape or ())
    rows, over = [], False
    while not over:
        *_, fell, ended, _ = env.step(idle)
        over = fell or ended
        s = env.simulation.state
        heel = float(s.support_polygon[:, 0].min()) if len(s.support_polygon) else np.nan
        torque = np.abs(env.simulation.views.ctrl) / env.robot.torque_limit
        rows.append(
            (s.time, heel - s.capture_point[0], s.cop[0] - heel, s.angular_momentum[1],
             torque.max())
        )  # fmt: skip
    columns = ("time", "capture", "cop", "momentum", "torque")
    return dict(zip(columns, np.array(rows).T, strict=True)), env.recovered


def picture(path: str, courses: Mapping[str, tuple[Course, bool]]) -> None:
    """ξ and p from the heels, and the angular momentum, in time."""
    panels = {
        "capture": "ξ behind\nthe heels [cm]",
        "cop": "CoP before\nthe heels [cm]",
        "momentum": "L about the\nleft axis [N·m·s]",
    }
    with saved_figure(path, 7.6, 6.4) as figure:
        axes = figure.subplots(len(panels), sharex=True)
        for ax, (key, label) in zip(axes, panels.items(), strict=True):
            for k, (name, (course, recovered)) in enumerate(courses.items()):
                seen = course["time"] <= SECONDS
                values = course[key][seen] * (1.0 if key == "momentum" else 100.0)
                title, style = name if recovered else f"{name} (falls)", look(k)
                ax.plot(
                    course["time"][seen], values, label=title, color=style.colour, ls=style.line
                )
            ax.axvspan(0.5, 0.6, color=AMBER, alpha=0.35, lw=0)
            ax.set_ylabel(label)
        axes[0].set_ylim(-12, 12)
        axes[1].set_ylim(-2, 25)
        axes[-1].set_xlim(0.4, SECONDS)
        axes[-1].set_xlabel("time [s]")
        axes[0].set_title("16 N·s backward on the torso")
        legend_below(figure, axes[0])


def main() -> None:
    courses = {name: play(name) for name in NAMES}
    print("| controller | recovered | ξ behind the heels [cm] at 0.6, 0.7, 0.8, 1.0 s | "
          "least L [N·m·s] | at | back to 0 | a motor at its limit [s] |")  # fmt: skip
    print("| --- " * 7 + "|")
    for name, (c, recovered) in courses.items():
        at = ", ".join(f"{100 * np.interp(t, c['time'], c['capture']):.1f}"
                       for t in (0.6, 0.7, 0.8, 1.0))  # fmt: skip
        low = int(np.argmin(c["momentum"][c["time"] < SECONDS]))
        after = np.flatnonzero(c["momentum"][low:] >= 0.0)
        back = f"{c['time'][low + after[0]]:.2f} s" if len(after) else "–"
        full = np.mean(c["torque"][c["time"] < SECONDS] > 0.999) * SECONDS
        print(f"| {name} | {'yes' if recovered else 'no'} | {at} | {c['momentum'][low]:.1f} | "
              f"{c['time'][low]:.2f} s | {back} | {full:.2f} |")  # fmt: skip
    if len(sys.argv) > 1:
        picture(sys.argv[1], courses)


if __name__ == "__main__":
    main()
