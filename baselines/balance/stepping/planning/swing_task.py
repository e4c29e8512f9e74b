"""The task of the QP that moves a swing foot, and the ticks of a controller that have it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.baselines.whole_body.contact_sets import ContactSets
from poise.baselines.whole_body.parts.part import Bound
from poise.baselines.whole_body.tasks.sole_pose import SolePose, SolePoseBlock, SolePoseGains
from poise.baselines.whole_body.tasks.task import Task
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .config import SwingTask

# ticks of `CaptureTick`: the soles in contact, and those in swing
SUPPORTS = (("on_first", (0,), (1,)), ("on_second", (1,), (0,)), ("on_both", (0, 1), ()))


def swing_gains(robot: RobotArrays, task: SwingTask) -> SolePoseGains:
    """The gains of `task` for one robot."""
    g, rate2 = robot.gravity, robot.gravity / robot.height_com
    k = task.stiffness * rate2
    d = 2.0 * task.damping_ratio * np.sqrt(k)
    turn = task.turn_weight / rate2**2
    return SolePoseGains.allocate(
        stiffness=float(k), damping=float(d), weight=float(task.weight / g**2),
        turn_weight=float(turn), yaw_weight=float(task.yaw_fraction * turn),
    )  # fmt: skip


def swing_task(
    sole: int, reference: np.ndarray, axes: np.ndarray, gains: SolePoseGains
) -> Bound[Task]:
    """The task of the QP that moves a sole along `reference` (3, 3), its `axes` (3, 3) fixed."""
    return Bound(SolePose(), SolePoseBlock(sole, reference, axes, gains))


def bind_swings(
    sets: ContactSets,
    state: StateArrays,
    targets: TargetArrays,
    task: SwingTask,
    way: np.ndarray,
    axes: np.ndarray,
    legs: Sequence[Bound[Task]] = (),
) -> dict[str, Any]:
    """The ticks of `CaptureTick` on the first sole, on the second one and on both.

    In its swing the other sole follows `way` (3, 3) with its `axes` (3, 3). `legs`: further tasks
    of each stance leg.
    """
    gains = swing_gains(sets.arrays, task)
    ticks = {}
    for name, soles, swinging in SUPPORTS:
        tasks = [swing_task(foot, way, axes, gains) for foot in swinging]
        tasks += [legs[leg] for leg in soles] if legs else []
        ticks[name] = sets.bind(soles, state, targets, tasks)
    return ticks
