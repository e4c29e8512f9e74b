"""Weights changed by hand, as in [Moskalev24]: `python -m tests.performance.weights [PICTURE]`.

`moskalev24` performs the squat and is pushed by half of J50, with one of the four weights of
[Moskalev24] (2.1) changed at a time. With PICTURE, what that does to the reference, the CoM and the
root's wrench.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from poise.baselines.registry import momentum_qp_config
from poise.envs.balance.base import BalanceEnv
from poise.training.motion.following.follow import follow
from poise.training.pictures.figures.style import legend_below, look, saved_figure

BASE, MOTION, SEED, STARTS, SHARE = "moskalev24", "squat", 21, 4, 0.5
FACTORS = (0.01, 0.1, 1.0, 10.0, 100.0)
#: the thesis' name → section of the file, "" for its top, and the fields that are the weight
WEIGHTS = {
    "w_t, the reference": ("posture", ("leg_weight", "trunk_weight", "free_weight", "root_weight")),
    "w_c, the CoM": ("com", ("weight", "height_weight")),
    "w_p, the CoP": ("cop", ("weight", "yaw_weight")),
    "w, the root": ("", ("root_weight",)),
}
COLUMNS = {
    "joints": "joints, RMS [°]",
    "com": "CoM off [mm]",
    "root": "root force, largest [N]",
}


def changed(name: str, factor: float) -> dict[str, Any]:
    """A controller's file: `moskalev24` with one weight times a factor."""
    section, fields = WEIGHTS[name]
    config = momentum_qp_config(BASE)
    owner = getattr(config, section) if section else config
    values = {field: factor * float(getattr(owner, field)) for field in fields}
    return {"base": BASE, **({section: values} if section else values)}


def play(file: Path) -> dict[str, float]:
    """Falls, and means over the trials of what the columns say."""
    forces = [0.0]

    def watch(env: BalanceEnv) -> None:
        forces[0] = max(forces[0], float(env.episode.metrics.root_force))

    trials = follow(MOTION, str(file), starts=STARTS, share=SHARE, directions=STARTS, seed=SEED,
                    watch=lambda _: watch)  # fmt: skip
    return {
        "falls": sum(trial.fallen for trial in trials),
        "joints": float(np.degrees(np.mean([trial.joint_rms for trial in trials]))),
        "com": 1e3 * float(np.mean([trial.com_error for trial in trials])),
        "root": forces[0],
    }


def main() -> None:
    rows: dict[tuple[str, float], dict[str, float]] = {}
    print(f"| weight | times | falls of {STARTS} | {' | '.join(COLUMNS.values())} |")
    print("| --- " * (3 + len(COLUMNS)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for name in WEIGHTS:
            for factor in FACTORS:
                file = Path(folder) / "changed.yaml"
                file.write_text(yaml.safe_dump(changed(name, factor)))
                same = [row for (_, other), row in rows.items() if factor == other == 1.0]
                row = rows[name, factor] = same[0] if same else play(file)
                print(f"| {name} | {factor:g} | {row['falls']:.0f} | {row['joints']:.1f} | "
                      f"{row['com']:.1f} | {row['root']:.0f} |", flush=True)  # fmt: skip
    if len(sys.argv) > 1:
        picture(sys.argv[1], rows)


def picture(path: str, rows: dict[tuple[str, float], dict[str, float]]) -> None:
    """Each column over the factor, a line for each weight."""
    with saved_figure(path, 7.6, 6.4) as figure:
        axes = figure.subplots(len(COLUMNS), sharex=True)
        for ax, (key, label) in zip(axes, COLUMNS.items(), strict=True):
            for k, name in enumerate(WEIGHTS):
                style = look(k)
                values = [rows[name, factor][key] for factor in FACTORS]
                ax.plot(FACTORS, values, marker="o", label=name, color=style.colour, ls=style.line)
            ax.set(xscale="log", ylabel=label)
            ax.set_xticks(FACTORS, [f"{factor:g}" for factor in FACTORS])
            ax.minorticks_off()
        axes[0].set_title(f"{MOTION}, pushed by {SHARE:g} of J50, one weight changed")
        axes[-1].set_xlabel("times its own value")
        legend_below(figure, axes[0])


if __name__ == "__main__":
    main()
