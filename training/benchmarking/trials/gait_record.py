"""The record of a walk, from which its figures are computed when the trial is over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.episode import ENERGY, POSITIVE_WORK
from poise.envs.physics.legs import find_legs


class Row(NamedTuple):
    """A robot that walks, at the end of a policy step."""

    time: float  # [s]
    com: np.ndarray  # (2,) [m]
    yaw: float  # of the heading [rad]
    down: np.ndarray  # (2,) whether a foot touches the ground
    feet: np.ndarray  # (2, 2) soles along the ground [m]
    heights: np.ndarray  # (2,) of the soles [m]
    spin: float  # angular momentum about the vertical through the CoM [N·m·s]
    knees: np.ndarray  # (2,) |τ|/m of each leg's knee [N·m/kg]; NaN where none is known
    energy: float  # ∫ Σ |τ q̇| dt [J]
    work: float  # ∫ Σ max(τ q̇, 0) dt [J]


@dataclass(frozen=True)
class WalkArrays:
    """The rows of a walk as arrays, first axis time; see `Row`. `yaw` is continuous."""

    time: np.ndarray
    com: np.ndarray
    yaw: np.ndarray
    down: np.ndarray
    feet: np.ndarray
    heights: np.ndarray
    spin: np.ndarray
    knees: np.ndarray
    energy: np.ndarray
    work: np.ndarray


class WalkRecord:
    """Keeps what a walk's figures need; hand it to `run_trial`."""

    def __init__(self) -> None:
        self._rows: list[Row] = []
        self._knees: list[int | None] = []  # the motor of each leg's knee

    def __call__(self, env: BalanceEnv) -> None:
        if not self._rows:
            self._knees = knee_motors(env)
        state, metrics = env.simulation.state, env.episode.metrics
        torque = np.abs(env.simulation.views.ctrl) / env.robot.mass
        knees = [np.nan if motor is None else torque[motor] for motor in self._knees]
        self._rows.append(
            Row(
                env.simulation.time, state.com[:2].copy(), state.heading_yaw,
                state.contacts > 0.5, state.sole_points[:, :2].copy(),
                state.sole_points[:, 2].copy(), float(state.angular_momentum[2]), np.array(knees),
                float(metrics[ENERGY]), float(metrics[POSITIVE_WORK]),
            )
        )  # fmt: skip

    def arrays(self) -> WalkArrays:
        """What was kept."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        arrays = dict(zip(Row._fields, columns, strict=True))
        return WalkArrays(**{**arrays, "yaw": np.unwrap(arrays["yaw"])})


def knee_motors(env: BalanceEnv) -> list[int | None]:
    """The motor of each leg's knee, in the order of the soles; None where there is no knee."""
    dofs = env.simulation.arrays.motor_dofs.tolist()
    knees = [leg.knee for leg in find_legs(env.robot)]
    known = [None if knee is None else env.model.joint(knee).dofadr[0] for knee in knees]
    return [dofs.index(dof) if dof in dofs else None for dof in known]
