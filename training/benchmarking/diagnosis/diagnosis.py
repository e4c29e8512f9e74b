"""Why a trial was lost: the criterion, and what went wrong before it, each with its time."""

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.termination import has_diverged, uprightness
from poise.envs.compiled.maths.runs import runs_of
from poise.envs.robots.models.tree import lineage
from poise.envs.robots.robot import Robot

from .record import TrialCourse

SATURATED = 0.999  # of a motor's limit
SATURATED_STEPS = 2  # consecutive policy steps at the limit from which a motor counts
SLIPPED = 0.03  # [m] that a sole moves while it stands
MISSED = 0.05  # [m] from touchdown to the planned foothold


@dataclass(frozen=True)
class Diagnosis:
    """Why a trial was lost; times in s after the reset, None where it does not apply."""

    #: which criterion it failed: "height" (the CoM too low), "tilt" (the root too far), "contact"
    #: (more than the feet on the ground), "diverged" (numbers too large), "not quiet" (on its feet,
    #: but not upright and at rest at the end), "off command" (a walk that did not go on as
    #: commanded), "motion" (a fall from a motion), "down" (it did not get up), "error"
    loss: str | None = None
    loss_body: str | None = None  #: that touched the ground, where that is the criterion
    #: motor between root and soles that was first at its torque limit after the first push, for 2
    #: policy steps or more in a row. Arms are swung as hard as they can be: no reason to fall
    saturated_motor: str | None = None
    saturated_from: float | None = None  #: when that began
    saturated_time: float | None = None  #: how long it lasted then
    capture_left: float | None = None  #: when the capture point left the support for the last time
    capture_outside: float | None = None  #: how far outside it came at most from then on [m]
    #: "slipped" (a sole moved by 3 cm while it stood) or "missed" (a foot landed 5 cm or more from
    #: where it was to land), whichever came first
    foothold: str | None = None
    foothold_time: float | None = None  #: when
    foothold_error: float | None = None  #: how far [m]
    failures_from: float | None = None  #: when the controller's solver first failed
    #: effects of imperfect sensors or motors under a suite's conditions, in words
    hardware: str | None = None


COLUMNS = tuple(Diagnosis.__dataclass_fields__)


def diagnose(env: BalanceEnv, course: TrialCourse, start: float, loss: str) -> Diagnosis:
    """Return why the trial that has just ended in `env` was lost.

    Args:
        env: as it is after the trial.
        course: of the trial.
        start: of the first push or kick; 0 without one [s].
        loss: the criterion of a trial that did not end by a fall.
    """
    failed = np.flatnonzero(course.failures > 0)
    return replace(
        _fall(env, loss) if env.fallen else Diagnosis(loss),
        **_saturated(env, course, start),
        **_capture(course),
        **_foothold(course, start),
        failures_from=_time(course, failed[0]) if len(failed) else None,
    )


def _fall(env: BalanceEnv, loss: str) -> Diagnosis:
    """Return the first criterion of `has_fallen` that is met, in its order."""
    s, arrays = env.simulation.state_arrays, env.simulation.arrays
    if has_diverged(env.simulation.views):
        return Diagnosis("diverged")
    if s.com[2] - s.origin[2] < env.limits.height:
        return Diagnosis("height")
    if uprightness(arrays, s) < env.limits.cos_tilt:
        return Diagnosis("tilt")
    if env.limits.ground_contact and s.other_contacts > 0.5:
        return Diagnosis("contact", loss_body=touching_body(env))
    return Diagnosis(loss)


def touching_body(env: BalanceEnv) -> str | None:
    """Return the first body other than a foot that touches the ground."""
    model, data = env.model, env.data
    feet = {sole.body_id for sole in env.robot.soles}
    for contact in data.contact[: data.ncon]:
        bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
        others = [body for body in bodies if model.body_weldid[body] != 0]
        if len(others) == 1 and others[0] not in feet:
            return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, others[0])
    return None


def _saturated(env: BalanceEnv, course: TrialCourse, start: float) -> dict[str, Any]:
    """Return the first saturated motor, from when and for how long."""
    full = (course.load > SATURATED) & (course.time > start)[:, None] & bearing(env.robot)
    lasting = [
        (first, last, motor)
        for motor in range(full.shape[1])
        for first, last in runs_of(full[:, motor]).tolist()
        if last - first >= SATURATED_STEPS
    ]
    if not lasting:
        return {}
    # of those that begin together the longest
    first, last, motor = min(lasting, key=lambda run: (run[0], -run[1]))
    return {
        "saturated_motor": env.robot.motor_names[motor],
        "saturated_from": _time(course, first),
        "saturated_time": round((last - first) * env.config.policy_period, 6),
    }


def bearing(robot: Robot) -> np.ndarray:
    """(nu,) whether a motor is between the root and a sole."""
    model = robot.model
    limbs = {body for sole in robot.soles for body in lineage(model, sole.body_id)}
    between = limbs - {*lineage(model, robot.root_body_id)}
    bodies = model.dof_bodyid[np.array(robot.motor_dofs)]
    return np.isin(bodies, list(between))


def _capture(course: TrialCourse) -> dict[str, Any]:
    """When the capture point left the support for the last time, and how far it came."""
    pairs = zip(course.supports, course.capture_point, strict=True)
    outside = np.array([distance_outside_polygon(polygon, point) for polygon, point in pairs])
    inside = np.flatnonzero(outside <= 0.0)
    row = int(inside[-1]) + 1 if len(inside) else 0
    beyond = outside[row:]
    beyond = beyond[np.isfinite(beyond)]
    if not len(beyond):
        return {}
    return {"capture_left": _time(course, row), "capture_outside": round(float(beyond.max()), 6)}


def distance_outside_polygon(polygon: np.ndarray, point: np.ndarray) -> float:
    """How far a point is outside a convex polygon (k, 2) [m]: 0 within, NaN of no polygon."""
    if len(polygon) < 3:  # no foot touches the ground, or one with an edge
        ways = np.linalg.norm(polygon - point, axis=1)
        return float(ways.min()) if len(ways) else float("nan")
    edges = np.roll(polygon, -1, axis=0) - polygon
    away = point - polygon
    side = edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0]
    if np.all(side >= 0.0) or np.all(side <= 0.0):
        return 0.0
    length = np.maximum(np.sum(edges**2, axis=1), 1e-18)
    along = np.clip(np.sum(edges * away, axis=1) / length, 0.0, 1.0)
    return float(np.linalg.norm(away - along[:, None] * edges, axis=1).min())


def _foothold(course: TrialCourse, start: float) -> dict[str, Any]:
    """Return the first slip or missed foothold after the first push."""
    for row in range(1, len(course.time)):
        if course.time[row] <= start:
            continue
        for foot in range(course.soles.shape[1]):
            name, error = _step_fault(course, row, foot)
            if name:
                return {"foothold": name, "foothold_time": _time(course, row),
                        "foothold_error": round(error, 6)}  # fmt: skip
    return {}


def _step_fault(course: TrialCourse, row: int, foot: int) -> tuple[str, float]:
    """What is wrong with a foot at a row, and by how much; empty if nothing is."""
    if not course.contacts[row, foot]:
        return "", 0.0
    if not course.contacts[row - 1, foot]:
        planned = course.swinging[row - 1] == foot
        error = float(np.linalg.norm(course.soles[row, foot] - course.foothold[row - 1]))
        return ("missed", error) if planned and error > MISSED else ("", 0.0)
    since = row
    while since > 0 and course.contacts[since - 1, foot]:
        since -= 1
    moved = float(np.linalg.norm(course.soles[row, foot] - course.soles[since, foot]))
    return ("slipped", moved) if moved > SLIPPED else ("", 0.0)


def _time(course: TrialCourse, row: int) -> float:
    return round(float(course.time[row]), 6)
