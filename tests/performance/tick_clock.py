"""The control tick timed inside compiled code, as the environments run it."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import mujoco
import numba
import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.momentum_qp import MomentumQP, momentum_tick
from poise.envs.compiled.mujoco_calls import mj_step1
from poise.envs.physics.arrays import sim_views
from poise.envs.physics.kinematics import allocate_state, update_state
from poise.envs.physics.state import RobotState
from tests.performance.recoveries import Tick

_clock = ctypes.CDLL(None).clock_gettime
_clock.argtypes, _clock.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_int
MONOTONIC = 1


class TickTimes(NamedTuple):
    """Seconds of the parts of one tick."""

    kinematics: float  # MuJoCo's position and velocity stages, contacts included (`mj_step1`)
    state: float  # `update_state`
    control: float  # `momentum_tick`: assembly, solution, torques

    @property
    def total(self) -> float:
        """From positions and velocities to torques."""
        return sum(self)


@numba.njit(nogil=True)
def _now(buffer):
    _clock(MONOTONIC, buffer.ctypes.data)
    return buffer[0] + 1e-9 * buffer[1]


@numba.njit(nogil=True)
def _timed_tick(robot, views, s, tick, buffer, times):
    start = _now(buffer)
    mj_step1(views.model_address, views.data_address)
    kinematics = _now(buffer)
    update_state(robot, views, s)
    state = _now(buffer)
    momentum_tick(tick)  # with the ground's forces, which are recorded
    times[0], times[1] = kinematics - start, state - kinematics
    times[2] = _now(buffer) - state


class TickClock:
    """Runs a controller's ticks on recorded states; its memory goes from tick to tick.

    State and targets of all ticks lie in the same arrays, as in an environment. Arrays of their own
    would need a block for each tick, and the Python code that makes one just before the tick slows
    it, by cold caches probably: 0.1 ms of it made a tick of 28 µs one of 38, 0.4 ms one of 45 µs.
    """

    def __init__(self, controller: MomentumQP):
        self.controller = controller
        self.model = controller.robot.model
        self.data = mujoco.MjData(self.model)
        self.views = sim_views(self.model, self.data)
        self.state = allocate_state(self.model.nv, len(controller.robot.soles), self.model.nbody)
        self._met: tuple[RobotState, Targets] | None = None
        self._buffer = np.zeros(2, dtype=np.int64)

    def time(self, tick: Tick) -> TickTimes:
        """One tick from the recorded positions and velocities."""
        controller, times = self.controller, np.zeros(3)
        self.data.qpos[:] = tick.state.qpos
        self.data.qvel[:] = tick.state.qvel
        _timed_tick(
            controller.arrays, self.views, self.state,
            controller.tick(*self._copied(tick)), self._buffer, times,
        )  # fmt: skip
        return TickTimes(*times.tolist())

    def _copied(self, tick: Tick) -> tuple[RobotState, Targets]:
        """What the controller met, in the arrays of the first tick's copy."""
        if self._met is None:
            self._met = tick.state.copy(), Targets.standing(self.controller.robot, tick.state)
        state, targets = self._met
        pairs = zip(state.arrays.members(), tick.state.arrays.members(), strict=True)
        for own, recorded in pairs:
            own[...] = recorded
        targets.take(tick.targets)
        return self._met
