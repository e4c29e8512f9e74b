"""Torques from the robot's own dynamics: state.M, state.h, state.J, and nothing guessed.

    python examples/own_torques.py
    poise evaluate examples/own_torques.py:InverseDynamics --trials 20 --out out/own-torques

With feet that stay on the ground, M v̇ + h = Sᵀτ + Jᵀw. Three linear problems give τ:

1. v̇: as near as can be to what posture and CoM ask for, with soles at rest, J v̇ = −J̇v − d J v;
2. w: the smallest wrenches of the ground that give the six rows of the root, which no motor drives;
3. τ = M v̇ + h − Jᵀw at `robot.motor_dofs`: Sᵀ puts motor i there, whatever joints lack a motor.

Nothing keeps w within friction and soles: that is what the QP of `momentum-qp` adds.
"""

import numpy as np

from poise.baselines import Targets
from poise.envs import Robot, RobotState, Simulation, load_robot, parse_pushes

ROOT = slice(6)  # rows of the floating base in v = q̇: linear, then angular
STIFFNESS, DAMPING = 60.0, 16.0  # [1/s²], [1/s] of every joint, and of the root's lean
COM_STIFFNESS, COM_DAMPING = 14.0, 7.0  # the same of the CoM
SOLE_DAMPING = 20.0  # [1/s] of what speed a sole has


class InverseDynamics:
    """A `poise.baselines.Controller`: `period`, `reset(state)`, `torques(state, targets)`."""

    def __init__(self, robot: Robot):
        self.robot, self.period = robot, 0.004  # [s]

    def reset(self, state: RobotState) -> None:
        """Nothing is kept from tick to tick."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m], within the motors' limits."""
        vdot = self.acceleration(state, targets)
        generalised = state.M @ vdot + state.h
        w = np.linalg.lstsq(state.J[:, ROOT].T, generalised[ROOT], rcond=None)[0]
        tau = (generalised - state.J.T @ w)[self.robot.motor_dofs]
        return np.clip(tau, -self.robot.torque_limit, self.robot.torque_limit)

    def acceleration(self, state: RobotState, targets: Targets) -> np.ndarray:
        """v̇ (nv,): least squares of all that is wanted, among those with soles at rest."""
        wanted = np.zeros(len(state.qvel))
        error = self.robot.standing_qpos[7:] - state.qpos[7:]  # of hinges and slides alike
        wanted[6:] = STIFFNESS * error - DAMPING * state.qvel[6:]
        lean = np.cross(state.root_axes[:, 2], [0.0, 0.0, 1.0])  # in world axes
        wanted[3:6] = state.root_axes.T @ (STIFFNESS * lean) - DAMPING * state.qvel[3:6]
        com = COM_STIFFNESS * (targets.com - state.com) - COM_DAMPING * state.com_vel
        rows = [np.eye(len(wanted)), 10.0 * state.A[:3] / state.mass]  # ċ = A v / m
        values = [wanted, 10.0 * (com - (state.A_bias[:3] - self._weight(state)) / state.mass)]
        sole = -state.Jdot_v - SOLE_DAMPING * state.J_v
        return constrained(np.vstack(rows), np.concatenate(values), state.J, sole)

    def _weight(self, state: RobotState) -> np.ndarray:
        """−m g: `A_bias` has the ground's wrench, which carries the weight too."""
        return -state.mass * self.robot.model.opt.gravity


def constrained(A: np.ndarray, b: np.ndarray, C: np.ndarray, d: np.ndarray) -> np.ndarray:
    """x of the least ‖A x − b‖ with C x = d."""
    particular = np.linalg.lstsq(C, d, rcond=None)[0]
    _, values, rows = np.linalg.svd(C)
    free = rows[int(np.sum(values > 1e-9 * values[0])) :].T  # C free = 0
    return particular + free @ np.linalg.lstsq(A @ free, b - A @ particular, rcond=None)[0]


def stands(robot: Robot, impulse: float = 5.0, seconds: float = 3.0) -> bool:
    """Return whether a robot that is pushed forward stands afterwards."""
    simulation, controller = Simulation(robot), InverseDynamics(robot)
    state = simulation.state
    push = {"impulse": impulse, "direction": 0.0, "duration": 0.1, "start": 0.5, "body": "torso"}
    simulation.set_pushes(parse_pushes(push, robot, state.support_margin))
    substeps = round(controller.period / simulation.arrays.timestep)
    while simulation.time < seconds and not state.other_contact:
        torques = controller.torques(state, Targets.standing(robot, state))
        state = simulation.step(torques, substeps)
    return not state.other_contact and float(np.linalg.norm(state.com_vel)) < 0.1


if __name__ == "__main__":
    for impulse in (0.0, 5.0):
        end = "stands" if stands(load_robot("humanoid"), impulse) else "fell"
        print(f"pushed by {impulse:g} N·s: {end}")
