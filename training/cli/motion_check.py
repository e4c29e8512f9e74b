"""`poise motion check`: whether a robot can do a motion, and what makes it possible."""

from pathlib import Path
from typing import Annotated

import tyro

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from poise.training.running.terminal import terminal

from .arguments import Switch


def check(
    motion: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MOTION")],
    /,
    *,
    robot: str = "humanoid",
    qp: Switch = False,
    controller: str = "momentum-qp",
    fit: Switch = False,
    out: Path | None = None,
) -> int:
    """Say whether a robot can do a motion: ground, motors and joints, 100 times a second.

    Args:
        motion: a .npz of poise motion import, a packaged motion, or a .yaml of one.
        robot: a packaged robot (see poise list) or a .yaml description.
        qp: also ask the momentum QP what it makes of the motion, at every sample.
        controller: a momentum QP, whose gains the QP has.
        fit: change a .npz until the robot can do it: slower, or with its centre of mass moved.
        out: the .npz file to write what was fitted to.

    Returns:
        0 if the robot can do it, 1 if it cannot.
    """
    from poise.baselines.feasibility.check import check_motion
    from poise.baselines.feasibility.fit import fit_motion
    from poise.baselines.feasibility.gap import with_gap
    from poise.baselines.motions.motion import load_motion
    from poise.baselines.motions.robot_clip import (
        read_robot_clip,
        reference_from,
        write_robot_clip,
    )
    from poise.baselines.registry import momentum_qp_config
    from poise.training.following.tables import print_feasibility

    if (out is None) == fit:
        raise ConfigError("--fit and --out go together", field="out")
    body, console = load_robot(robot), terminal()
    reference = load_motion(motion, body)
    judged = check_motion(reference, body)
    config = momentum_qp_config(controller) if qp else None
    if fit:
        if Path(motion).suffix != ".npz":
            raise ConfigError("only a .npz of poise motion import can be fitted", source=motion,
                              field="fit")  # fmt: skip
        fitted = fit_motion(read_robot_clip(motion), body)
        reference = reference_from(fitted.clip, body, motion)
        judged = fitted.feasibility
        print(f"tempo {fitted.tempo:g}, centre of mass moved by {100 * fitted.moved:.1f} cm")
    if config is not None:
        judged = with_gap(judged, reference, body, config)
    print_feasibility(judged, f"{Path(motion).stem} on {body.name}", console)
    if out is not None:
        write_robot_clip(fitted.clip, out)
        print(out)
    return 0 if judged.feasible else 1
