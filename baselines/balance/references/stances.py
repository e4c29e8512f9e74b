"""Where the soles of a robot's postures stand: as in standing or not, moved, and put to rest."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.configs.errors import PoiseError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

from .footing import root_turns, sole_poses, stances_of
from .legs import PlantedLegs, nominal_feet

NEAR, NEARLY = 5e-3, 0.02  # [m, rad] by which soles that are home may be elsewhere
UNREACHED = 1e-4  # [m, rad] that a sole may be off


class Place(NamedTuple):
    """Where soles are over the ground: middle (2,) [m], and heading [rad] from that of standing."""

    middle: np.ndarray
    heading: float


def place_of(robot: Robot, qpos: np.ndarray) -> Place:
    """The place of a posture (nq,)."""
    _, places, turns = sole_poses(robot, qpos[None])
    return _place(places[0], turns[0])


def _place(places: np.ndarray, turns: np.ndarray) -> Place:
    ahead = Rotation.from_rotvec(turns).apply([1.0, 0.0, 0.0]).sum(axis=0)
    return Place(places[:, :2].mean(axis=0), float(np.arctan2(ahead[1], ahead[0])))


def home_place(robot: Robot) -> Place:
    """The place of the standing posture."""
    return Place(nominal_feet(robot)[:, :2].mean(axis=0), 0.0)


def carried(qpos: np.ndarray, start: Place, end: Place) -> np.ndarray:
    """Postures (F, nq) moved over the ground, and turned, as takes one place to another."""
    turn = Rotation.from_rotvec([0.0, 0.0, end.heading - start.heading])
    moved = qpos.copy()
    moved[:, :2] = turn.as_matrix()[:2, :2].dot((qpos[:, :2] - start.middle).T).T + end.middle
    whole = turn * Rotation.from_quat(np.roll(qpos[:, 3:7], -1, axis=1))
    moved[:, 3:7] = np.roll(whole.as_quat(), 1, axis=1)
    return moved


def away_from_home(robot: Robot, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F,) by how much the soles of postures (F, nq) stand elsewhere to each other than in standing
    [m], and by how much they are turned [rad]."""
    _, places, turns = sole_poses(robot, qpos)
    nominal = nominal_feet(robot)
    nominal = nominal - nominal.mean(axis=0)
    gaps, tilts = np.empty(len(qpos)), np.empty(len(qpos))
    for k in range(len(qpos)):
        middle = places[k].mean(axis=0) * [1.0, 1.0, 0.0]
        level = Rotation.from_rotvec([0.0, 0.0, -_place(places[k], turns[k]).heading])
        gaps[k] = np.linalg.norm(level.apply(places[k] - middle) - nominal, axis=1).max()
        tilts[k] = (level * Rotation.from_rotvec(turns[k])).magnitude().max()
    return gaps, tilts


def home_frames(robot: Robot, qpos: np.ndarray, planted: np.ndarray) -> np.ndarray:
    """(F,) bool: both soles are planted (F, 2), and as they stand to each other in standing."""
    gaps, tilts = away_from_home(robot, qpos)
    return np.asarray(planted.all(axis=1) & (gaps < NEAR) & (tilts < NEARLY))


def why_not_home(robot: Robot, qpos: np.ndarray, planted: np.ndarray) -> str:
    """Why a posture (nq,) with `planted` soles (2,) is not one of `home_frames`; empty if it is."""
    if not planted.all():
        return "a foot swings"
    gap, turned = (float(values[0]) for values in away_from_home(robot, qpos[None]))
    if gap < NEAR and turned < NEARLY:
        return ""
    return (f"the feet are {100.0 * gap:.1f} cm and {np.degrees(turned):.0f}° from how they stand "
            "in standing")  # fmt: skip


def at_rest(robot: Robot, qpos: np.ndarray, planted: np.ndarray) -> np.ndarray:
    """Postures (F, nq) whose soles rest while they are `planted` (F, 2), flat on the ground.

    A planted sole is at the mean of where it was. In between it is moved by what its rests are,
    from one to the next by α. CoM, root and joints that are no legs stay.

    Raises PoiseError where the legs cannot reach that.
    """
    legs = PlantedLegs(robot)
    com, places, turns = sole_poses(robot, qpos)
    ground = nominal_feet(robot)[:, 2].mean() * np.array([0.0, 0.0, 1.0])
    for foot in range(2):
        _rest(places[:, foot], planted[:, foot], np.array([1.0, 1.0, 0.0]))
        _rest(turns[:, foot], planted[:, foot], np.array([0.0, 0.0, 1.0]))
    axes = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(-1, 2, 3, 3)
    roots, made = root_turns(robot, qpos), np.empty_like(qpos)
    for k, own in enumerate(qpos):
        soles = [(places[k, i] + ground, axes[k, i] @ legs.standing_soles[i][1]) for i in range(2)]
        made[k], miss = legs.reach_soles(com[k] + ground, roots[k], own[7:][legs.others], own[7:],
                                         soles)  # fmt: skip
        if miss > UNREACHED:
            raise PoiseError(f"a sole cannot rest in frame {k}: {1000 * miss:.2g} mm lack")
    made[:, 7:] = np.clip(made[:, 7:], *robot.joint_range.T)
    return made


def _rest(values: np.ndarray, down: np.ndarray, kept: np.ndarray) -> None:
    """Let values (F, 3) rest while a sole is down, in place; of the rests only `kept` counts."""
    stances = stances_of(down)
    offsets = []
    for a, b in stances:
        own = values[a : b + 1]
        rest = own.mean(axis=0) * kept
        offsets.append((rest - own[0], rest - own[-1]))
        own[:] = rest
    for (_, first), (last, _), before, after in zip(stances[:-1], stances[1:], offsets[:-1],
                                                    offsets[1:], strict=True):  # fmt: skip
        u = ease(np.arange(1, last - first) / (last - first))[:, None]
        values[first + 1 : last] += (1.0 - u) * before[1] + u * after[0]
