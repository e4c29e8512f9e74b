"""What happens in one performance of a motion, from policy step to policy step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.tempo import Tempo
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.balance.base import BalanceEnv
from poise.training.motion.tracking.record import FeetRecord, tracking_errors
from poise.training.motion.tracking.reference import ReferenceBodies, SolePlaces


@dataclass(frozen=True, eq=False)
class Trace:
    """A performance in n steps.

    Attributes:
        time, motion_time: (n,) that of the trial and that of the motion [s].
        tempo: (n,) rate of the motion's time.
        beta: (n,) β = exp(−(|c − c_ref|/d)²), d of the tempo, whether the motion waits or not.
        joints: (n,) root mean square of the joints' errors [rad].
        bodies, com: (n,) mean distance of the bodies, and that of the CoM, from the motion [m].
        cop: (n, 2) the measured centre of pressure, in the heading frame of the soles from their
            middle [m]; of a motion with steps from where that is at its begin.
        pushes: (start, duration) of each push [s].
        fallen: whether the robot fell.
    """

    time: np.ndarray
    motion_time: np.ndarray
    tempo: np.ndarray
    beta: np.ndarray
    joints: np.ndarray
    bodies: np.ndarray
    com: np.ndarray
    cop: np.ndarray
    pushes: tuple[tuple[float, float], ...]
    fallen: bool


class Tracer:
    """Remembers a trial; `watch` is called after the reset and after every step."""

    def __init__(self, pushes: Sequence[tuple[float, float]] = ()):
        self._pushes = tuple(pushes)
        self._rows: list[np.ndarray] = []
        self._reference: ReferenceBodies | None = None

    def watch(self, env: BalanceEnv) -> None:
        """One row of the trace."""
        assert isinstance(env, ResidualBalanceEnv)  # which performs motions
        state = env.simulation.state
        if self._reference is None:
            self._reference = ReferenceBodies(env.motion, env.robot)
            self._footing = FeetRecord(state)
        self._footing.update(state)
        self._fallen = bool(env.fallen)
        steps = env.motion.footing
        stance = self._footing.stance if steps is None else SolePlaces.of(state)
        joints, bodies, _, com = tracking_errors(env, self._reference, stance)
        away = state.com - self._reference.com
        tempo = env.tempo if env.tempo.waits else Tempo()
        scale = tempo.distance * env.robot.height_com
        beta = np.exp(-float(away[:2] @ away[:2]) / scale**2)
        point = (state.cop - self._reference.origin[:2]) @ self._reference.turn[:2, :2]
        if steps is not None:
            point = point - steps.sample(0.0).places[:, 0, :2].mean(axis=0)
        now = [env.simulation.time, env.motion_time, beta, np.sqrt(joints), bodies, com, *point]
        self._rows.append(np.array(now))

    def trace(self) -> Trace:
        """Return the trace so far."""
        rows = np.array(self._rows)
        time, motion_time = rows[:, 0], rows[:, 1]
        steps = np.maximum(np.diff(time, prepend=time[0] - 1.0), 1e-9)
        tempo = np.diff(motion_time, prepend=motion_time[0] - 1.0) / steps
        tempo[0] = tempo[1] if len(tempo) > 1 else 1.0
        beta, joints, bodies, com = rows[:, 2:6].T
        return Trace(time, motion_time, tempo, beta, joints, bodies, com, rows[:, 6:8],
                     self._pushes, self._fallen)  # fmt: skip
