"""A robot on servos that is simulated window by window from any state."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.in_place.pd import PDGains, joint_gains
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.whole_body.tasks.posture import joint_kinds
from poise.configs.numbers import whole_steps
from poise.envs.compiled.copies import Copyable
from poise.envs.physics.arrays import robot_arrays
from poise.envs.robots.robot import Robot

WINDOW = 0.1  # [s] for which an offset of the targets is held
EVERY = 5  # physics steps between looks at the error
LOW = 0.6  # of the motion's CoM height: lower is a fall
FALLEN = 10.0  # error of a robot that has fallen
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Played(NamedTuple):
    """What became of a window.

    Attributes:
        state: of the simulation after it.
        error: sum over its looks of what `Plant.error` is, times their distance in time [s].
        upright: how long the robot did not fall in it [s].
    """

    state: np.ndarray
    error: float
    upright: float


class Plant(Copyable):
    """PD servos at the gains of `pd`, without feed-forward, whose targets follow a motion.

    τ = K (q_ref(t) + δ_k − q) + D (v_ref(t) − v), clipped to the motors' limits, with an offset δ_k
    [rad] of the joints of legs and trunk in window k. No offset depends on the state.

    Attributes:
        windows: how many the motion lasts.
        size: m, the number of joints that have offsets.
        simulated: time that was simulated by now [s].
    """

    def __init__(self, robot: Robot, motion: ReferenceMotion, window: float = WINDOW):
        self.robot, self.motion, self.model = robot, motion, robot.model
        self.data, arrays = mujoco.MjData(robot.model), robot_arrays(robot)
        self.dt = float(robot.model.opt.timestep)
        self.steps = whole_steps(window, self.dt, "window")
        self.windows = int(np.ceil(motion.duration / window - 1e-9))
        self.moved = np.flatnonzero(joint_kinds(arrays) > 0)
        self.size, self.simulated = len(self.moved), 0.0
        self.stiffness, self.damping = joint_gains(arrays, PDGains())
        self.motors = robot.motor_dofs - 6
        samples = [motion.sample(k * self.dt) for k in range(self.windows * self.steps + 1)]
        self.q_ref = np.array([sample.q_ref for sample in samples])
        self.v_ref = np.array([sample.v_ref for sample in samples])
        ahead = np.array([robot.com_ahead, 0.0, 0.0])
        self.com = np.array([sample.com_offset + ahead for sample in samples])
        self.com_vel = np.array([sample.com_vel for sample in samples])
        standing = Rotation.from_quat(np.roll(robot.standing_qpos[3:7], -1))
        turns = Rotation.from_rotvec([sample.root for sample in samples]) * standing
        self.root = turns.as_matrix()

    def start(self, velocity: float = 0.0) -> np.ndarray:
        """The state of the robot standing, all of it at a velocity [m/s] forward."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.robot.standing_qpos
        self.data.qvel[0] = velocity
        mujoco.mj_forward(self.model, self.data)
        return self._state()

    def play(self, state: np.ndarray, window: int, offset: np.ndarray) -> Played:
        """Simulate one window from a state with an offset (m,) [rad]."""
        model, data = self.model, self.data
        mujoco.mj_setState(model, data, state, STATE)
        shift = np.zeros(len(self.stiffness))
        shift[self.moved] = offset
        error, upright = 0.0, 0.0
        for step in range(window * self.steps, (window + 1) * self.steps):
            self._act(step, shift)
            mujoco.mj_step(model, data)
            self.simulated += self.dt
            if (step + 1) % EVERY:
                continue
            if self._fell(step + 1):
                left = (window + 1) * self.steps - step
                return Played(self._state(), error + FALLEN * self.dt * left, upright)
            error += self.error(step + 1) * EVERY * self.dt
            upright += EVERY * self.dt
        return Played(self._state(), error, upright)

    def error(self, step: int) -> float:
        """mean (q − q_ref)² + ‖Log(R_refᵀ R)‖² + 10 ‖ξ − ξ_ref‖²/m², ξ = c + ċ/ω in the plane."""
        model, data, root = self.model, self.data, self.robot.root_body_id
        mujoco.mj_subtreeVel(model, data)
        axes = data.xmat[root].reshape(3, 3)
        turn = Rotation.from_matrix(self.root[step].T @ axes).as_rotvec()
        moved = data.subtree_com[root] - self.com[step]
        moved = moved + (data.subtree_linvel[root] - self.com_vel[step]) / self.robot.omega
        joints = data.qpos[7:] - self.q_ref[step]
        return float((joints @ joints) / len(joints) + turn @ turn + 10.0 * moved[:2] @ moved[:2])

    def _act(self, step: int, shift: np.ndarray) -> None:
        tau = self.stiffness * (self.q_ref[step] + shift - self.data.qpos[7:])
        tau += self.damping * (self.v_ref[step] - self.data.qvel[6:])
        limit = self.robot.torque_limit
        self.data.ctrl[:] = np.clip(tau[self.motors], -limit, limit)

    def _fell(self, step: int) -> bool:
        height = float(self.data.subtree_com[self.robot.root_body_id, 2])
        return not height >= LOW * float(self.com[step, 2])  # NaN is a fall

    def _state(self) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state
