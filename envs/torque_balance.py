"""`poise/TorqueBalance-v0`: the action is the joints' torques."""

from typing import Any

import numpy as np

from .arrays import Plant, RobotArrays
from .balance import BalanceEnv
from .episode import EpisodeArrays, Judge, judge_step, record_tick
from .jit import compiled
from .kinematics import StateArrays, update_state
from .observation import Scales, observation_table, observation_terms
from .simulation import advance


@compiled
def torque_step(
    robot: RobotArrays,
    plant: Plant,
    s: StateArrays,
    pushes: np.ndarray,
    clock: np.ndarray,
    scale: Scales,
    j: Judge,
    substeps: int,
    e: EpisodeArrays,
) -> float:
    """One policy step: torques are held for `substeps` physics steps; returns the reward."""
    for i in range(plant.ctrl.shape[0]):
        plant.ctrl[i] = e.action[i] * robot.torque_limit[i]
    record_tick(robot, s, plant.ctrl, substeps * robot.timestep, e)
    for _ in range(substeps):
        advance(robot, plant, pushes, clock)
    update_state(robot, plant, s)
    return judge_step(
        robot, s, scale, j, robot.q_standing, plant.ctrl, clock[0] * robot.timestep, e
    )


class TorqueBalanceEnv(BalanceEnv):
    """Keep a pushed robot on its feet by joint torques.

    Action: Box(−1, 1, (nu,)), the torque of each motor over its limit, held for one policy step.
    """

    def __init__(self, robot: Any = "humanoid", config: Any = None, **overrides: Any):
        super().__init__(robot, config, **overrides)
        self._still = np.zeros(len(self.robot.joint_names))

    def _action_names(self) -> tuple[str, ...]:
        model = self.robot.model
        return tuple(model.actuator(i).name for i in range(model.nu))

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self.arrays.q_standing, self._still

    def _advance(self) -> float:
        sim = self.simulation
        return torque_step(
            self.arrays, sim.plant, sim.state_arrays, sim.push_table, sim.clock,
            self.scales, self.judge, self.substeps, self.episode,
        )  # fmt: skip
