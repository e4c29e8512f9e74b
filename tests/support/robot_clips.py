"""A robot's clips for tests: packaged motions and motions of the centre of mass, as frames."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np

from poise.baselines.balance.references.foot_steps import FootStep, Waypoint, plan_steps
from poise.baselines.balance.references.footing import Footing
from poise.baselines.balance.references.footwork import perform_plan
from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import About, RobotClip
from poise.baselines.motion.feasibility.trajectory import PlantedRobot
from poise.envs.robots.robot import Robot

RATE = 1.0 / 30.0  # [s]


def swings(footing: Footing) -> list[tuple[int, float, float]]:
    """Foot, lift-off and touchdown [s] of every step, in order."""
    found, times = [], footing.switches
    for foot in range(2):
        down = footing.planted[:, foot]
        begins = np.flatnonzero((down[:-1] == 1) & (down[1:] == 0))
        ends = np.flatnonzero((down[:-1] == 0) & (down[1:] == 1))
        found += [(foot, float(times[a]), float(times[b]))
                  for a, b in zip(begins, ends, strict=True)]  # fmt: skip
    return sorted(found, key=lambda swing: swing[1])


def packaged_clip(robot: Robot, name: str, dt: float = RATE) -> RobotClip:
    """A packaged motion as frames on the robot's soles."""
    motion, planted = load_motion(name, robot), PlantedRobot(robot)
    times = np.arange(0.0, motion.duration + 1e-9, dt)
    qpos = np.array([planted.placed(motion.sample(time).q_ref) for time in times])
    return RobotClip(About(robot.name, robot.fingerprint, name), dt, qpos)


def com_clip(
    robot: Robot, offset: Callable[[float], np.ndarray], duration: float, dt: float = RATE
) -> RobotClip:
    """Standing with the CoM moved by `offset(t)` (3,) [m]; the trunk upright, the arms at rest."""
    legs, standing = PlantedLegs(robot), load_motion("standing", robot).sample(0.0)
    q, frames = robot.standing_qpos[7:], []
    for time in np.arange(0.0, duration + 1e-9, dt):
        com = standing.com_offset + offset(time)
        qpos, error = legs.reach(com, standing.root, standing.q_ref[legs.others], q)
        assert error < 1e-6
        frames.append(qpos)
        q = qpos[7:]
    return RobotClip(About(robot.name, robot.fingerprint, "moved"), dt, np.array(frames))


def steps_clip(robot: Robot, name: str, steps: Sequence[FootStep], duration: float) -> RobotClip:
    """Standing but for some steps, the arms at rest."""
    frames = round(duration / RATE) + 1
    joints = np.tile(robot.standing_qpos[7:], (frames, 1))
    plan = plan_steps(steps, joints, np.zeros((frames, 3)), robot, name)
    about = About(robot.name, robot.fingerprint, name)
    return RobotClip(about, RATE, perform_plan(robot, plan, name), plan.planted)


@functools.cache
def ahead_clip(robot: Robot, length: float = 0.1) -> RobotClip:
    """A step ahead with the left foot, in h, and the right foot beside it."""
    ways = [(Waypoint(lift + 0.3, length / 2.0, up=0.05),) for lift in (1.3, 2.3)]
    steps = [FootStep("left", 1.3, 1.9, ways[0], ahead=length),
             FootStep("right", 2.3, 2.9, ways[1], ahead=length)]  # fmt: skip
    return steps_clip(robot, "ahead", steps, 4.3)
