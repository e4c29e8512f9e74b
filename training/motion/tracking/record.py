"""The record of a performed motion: errors over its time, falls relative to it, its end."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.balance.mdp.termination import FallLimits
from poise.envs.physics.state import RobotState

from .reference import ReferenceBodies, SolePlaces
from .steps import NONE, StepErrors, StepFigures

LAST = 1.0  # [s] at the end of a trial whose error is reported separately
COUNTED = 0.5  # [s] after the motion's end until which errors count
AFTER = 3.0  # [s] that a trial goes on after the motion's end: a fall takes its time
SETTLING = 6.0  # [s] that it goes on after a push at least: steps home take as long
LIFTED = 5  # policy steps off the ground after which a sole counts as landing again: 0.1 s
LANDING = 25  # policy steps after which feet of a disturbed start have landed


@dataclass(frozen=True)
class TrackingFigures(StepFigures):
    """How near a trial stayed to the motion; NaN where it fell at once."""

    joint_rms: float  #: root mean square of joint errors [rad], of a walk of trunk and arms alone
    #: mean distance of the bodies from where the motion has them, on the soles as they stand [m]
    #: (MPKPE)
    body_error: float
    body_error_root: float  #: the same, relative to the root body [m]
    body_error_last: float  #: `body_error` of the trial's last second [m]
    com_error: float  #: mean distance of the CoM from the motion's [m]
    #: largest distance of a sole from where it last landed [m]
    sole_slide: float
    motion_delay: float  #: by how much the motion is late at the end [s]; 0 unless it waits


class Tracking:
    """How near a robot is to the motion of its environment, which has just been reset.

    Errors count until half a second after the motion's end, or a fall. The trial goes on for 3 s
    after the motion's end, and 6 s after the last push.

    Args:
        env: with the motion.
        pushes: starts of the trial's pushes [s].
    """

    def __init__(self, env: ResidualBalanceEnv, pushes: Sequence[float] = ()):
        self.fallen = False  #: so far
        self._env, self._reference = env, ReferenceBodies(env.motion, env.robot)
        self._footing = FeetRecord(env.simulation.state)
        self._end = max([0.0, *(start + SETTLING for start in pushes)])
        self._errors: list[tuple[float, float, float, float]] = []
        self._counted = 0  # of them
        footing = env.motion.footing
        self._steps = None if footing is None else StepErrors(env, footing)

    @property
    def ended(self) -> bool:
        """True after a fall, or once the trial has gone on long enough."""
        env, half = self._env, 0.5 * self._env.config.policy_period
        over = env.motion_time > env.motion.duration + AFTER - half
        return self.fallen or (over and env.simulation.time > self._end - half)

    def update(self) -> None:
        """Call it after every policy step."""
        env = self._env
        self._footing.update(env.simulation.state)
        self.fallen = bool(env.fallen) or lies(env)
        if not self.fallen:
            stance = self._footing.stance
            if self._steps is not None:
                stance = SolePlaces.of(env.simulation.state)
                self._steps.update()
            self._errors.append(tracking_errors(env, self._reference, stance))
            self._counted += env.motion_time < env.motion.duration + COUNTED

    def figures(self) -> TrackingFigures:
        """Return the figures so far."""
        period = self._env.config.policy_period
        table = np.array(self._errors).reshape(-1, 4)
        last = table[-round(LAST / period) :]
        table = table[: self._counted]
        if not len(table):
            table = last = np.full((1, 4), np.nan)
        joints, bodies, root, com = (float(value) for value in table.mean(axis=0))
        steps = NONE if self._steps is None else self._steps.figures()
        return TrackingFigures(
            **asdict(steps),
            joint_rms=float(np.sqrt(joints)),
            body_error=bodies,
            body_error_root=root,
            body_error_last=float(last[:, 1].mean()),
            com_error=com,
            sole_slide=self._footing.slide,
            motion_delay=self._env.simulation.time - self._env.motion_time,
        )


class FeetRecord:
    """The stance of a robot's feet, and how far they have moved.

    Attributes:
        stance: of the soles now, or when both were last on the ground.
        slide: largest distance of a sole from where it last landed [m].

    A sole that has been off the ground for 0.1 s (`LIFTED` policy steps) lands again where
    it touches the ground; one that loses contact for a shorter time keeps sliding.
    """

    def __init__(self, state: RobotState):
        self.stance, self.slide = SolePlaces.of(state), 0.0
        self._landed: np.ndarray | None = None
        self._off = np.zeros(2, int)  # policy steps since a sole touched the ground
        self._steps = 0

    def update(self, state: RobotState) -> None:
        """Call it after every policy step."""
        self._steps += 1
        if np.all(state.contacts > 0.0):
            self.stance = SolePlaces.of(state)
        if self._landed is None and self._steps >= LANDING:
            self._landed = state.sole_points.copy()
        if self._landed is not None:
            down = np.asarray(state.contacts) > 0.0
            landing = down & (self._off >= LIFTED)
            self._landed[landing] = state.sole_points[landing]
            self._off = np.where(down, 0, self._off + 1)
            ways = np.linalg.norm((state.sole_points - self._landed)[:, :2], axis=1)
            self.slide = max(self.slide, float(ways[down].max(initial=0.0)))


def lies(env: ResidualBalanceEnv) -> bool:
    """Return True if the CoM is too low or the root leans too far for the motion at this time."""
    state, limits = env.simulation.state, FallLimits()
    sample = env.motion.sample(env.motion_time)
    low = state.com[2] - state.origin[2] < limits.height * sample.com_offset[2]
    robot = env.simulation.arrays
    wanted = Rotation.from_rotvec(sample.root).as_matrix() @ robot.root_standing
    # the vertical as the root sees it, and as it is to see it: whatever the yaw
    leaning = state.root_axes[2] @ wanted[2] < np.cos(np.radians(limits.tilt))
    return bool(low or leaning)


def tracking_errors(
    env: ResidualBalanceEnv, reference: ReferenceBodies, stance: SolePlaces
) -> tuple[float, float, float, float]:
    """Mean square of the joints, mean distance of the bodies, the same relative to the root, and
    the distance of the CoM."""
    sim = env.simulation
    joints, places = reference.at(env.motion_time, stance)
    root = int(np.searchsorted(reference.bodies, reference.robot.root_body_id))
    gap = sim.data.xpos[reference.bodies] - places
    return (
        float(np.mean((sim.data.qpos[7:] - joints)[reference.led] ** 2)),
        float(np.linalg.norm(gap, axis=1).mean()),
        float(np.linalg.norm(gap - gap[root], axis=1).mean()),
        float(np.linalg.norm(sim.state.com - reference.com)),
    )
