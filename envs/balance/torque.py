"""`poise/TorqueBalance-v0`: the action is the joints' torques."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.compiled.jit import compiled
from poise.envs.physics.arrays import Plant, RobotArrays
from poise.envs.physics.kinematics import StateArrays, update_state
from poise.envs.physics.simulation import advance
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot

from .base import BalanceEnv, EnvConfig
from .episode import EpisodeArrays, Judge, judge_step, record_tick
from .observation import Scales, observe


@dataclass(frozen=True, eq=False)
class TorqueStep(Block):
    """All that a policy step works on."""

    robot: RobotArrays
    plant: Plant
    state: StateArrays
    clock: np.ndarray  # (1,) int
    scales: Scales
    judge: Judge
    substeps: int
    still: np.ndarray  # (nj,) zeros: velocities of the reference
    pushes: np.ndarray  # see `apply_pushes`
    episode: EpisodeArrays


@compiled
def torque_step(step: TorqueStep):
    """One policy step: torques are held for `substeps` physics steps."""
    robot, plant, s, clock, e = step.robot, step.plant, step.state, step.clock, step.episode
    for i in range(plant.ctrl.shape[0]):
        plant.ctrl[i] = e.action[i] * robot.torque_limit[i]
    record_tick(robot, s, plant.ctrl, step.substeps * robot.timestep, e)
    for _ in range(step.substeps):
        advance(robot, plant, step.pushes, clock)
    update_state(robot, plant, s)
    now = clock[0] * robot.timestep
    judge_step(robot, plant, s, step.scales, step.judge, robot.q_standing, plant.ctrl, now, e)
    observe(robot, s, step.scales, robot.q_standing, step.still, e.action, e.observation)


class TorqueBalanceEnv(BalanceEnv):
    """Keep a pushed robot on its feet by joint torques.

    Tables are for the default robot; another one has its own motors, joints and feet.

    Action: Box(−1, 1, (nu,)): the torque of each motor over its limit, held for one policy step
    (`policy_period`, 20 ms).

    | index | motor | limit [N·m] |
    | --- | --- | --- |
    | 0 | abdomen_z | 40 |
    | 1 | abdomen_y | 40 |
    | 2 | abdomen_x | 40 |
    | 3 | right_hip_x | 40 |
    | 4 | right_hip_z | 40 |
    | 5 | right_hip_y | 120 |
    | 6 | right_knee | 80 |
    | 7 | right_ankle_y | 20 |
    | 8 | right_ankle_x | 20 |
    | 9 | left_hip_x | 40 |
    | 10 | left_hip_z | 40 |
    | 11 | left_hip_y | 120 |
    | 12 | left_knee | 80 |
    | 13 | left_ankle_y | 20 |
    | 14 | left_ankle_x | 20 |
    | 15 | right_shoulder1 | 10 |
    | 16 | right_shoulder2 | 10 |
    | 17 | right_elbow | 10 |
    | 18 | left_shoulder1 | 10 |
    | 19 | left_shoulder2 | 10 |
    | 20 | left_elbow | 10 |

    Observation: Box(−10, 10), in the heading frame (origin at the middle of the soles, x forward, y
    left); h is the standing height of the CoM, ω = √(g/h). It does not know the push.

    | index | term | entry | unit | meaning |
    | --- | --- | --- | --- | --- |
    | 0 | com | x | half support | CoM from the middle of the soles |
    | 1 | com | y | half support | CoM from the middle of the soles |
    | 2 | com_height | z | 0.1 h | CoM height minus its standing value |
    | 3 | capture_point | x | half support | ξ from the middle of the soles |
    | 4 | capture_point | y | half support | ξ from the middle of the soles |
    | 5 | cop | x | half support | CoP from the middle of the soles |
    | 6 | cop | y | half support | CoP from the middle of the soles |
    | 7 | com_vel | x | 0.2 ω h | CoM velocity |
    | 8 | com_vel | y | 0.2 ω h | CoM velocity |
    | 9 | com_vel | z | 0.2 ω h | CoM velocity |
    | 10 | angular_momentum | x | 0.1 m h² ω | angular momentum about the CoM |
    | 11 | angular_momentum | y | 0.1 m h² ω | angular momentum about the CoM |
    | 12 | angular_momentum | z | 0.1 m h² ω | angular momentum about the CoM |
    | 13 | gravity | x | 1 | direction of gravity, root axes |
    | 14 | gravity | y | 1 | direction of gravity, root axes |
    | 15 | gravity | z | 1 | direction of gravity, root axes |
    | 16 | root_rate | x | ω | angular velocity of the root, root axes |
    | 17 | root_rate | y | ω | angular velocity of the root, root axes |
    | 18 | root_rate | z | ω | angular velocity of the root, root axes |
    | 19 | load | z | m g | vertical force of the ground minus the weight |
    | 20 | joint_pos | abdomen_z | rad | joint position minus the reference |
    | 21 | joint_pos | abdomen_y | rad | joint position minus the reference |
    | 22 | joint_pos | abdomen_x | rad | joint position minus the reference |
    | 23 | joint_pos | right_hip_x | rad | joint position minus the reference |
    | 24 | joint_pos | right_hip_z | rad | joint position minus the reference |
    | 25 | joint_pos | right_hip_y | rad | joint position minus the reference |
    | 26 | joint_pos | right_knee | rad | joint position minus the reference |
    | 27 | joint_pos | right_ankle_y | rad | joint position minus the reference |
    | 28 | joint_pos | right_ankle_x | rad | joint position minus the reference |
    | 29 | joint_pos | left_hip_x | rad | joint position minus the reference |
    | 30 | joint_pos | left_hip_z | rad | joint position minus the reference |
    | 31 | joint_pos | left_hip_y | rad | joint position minus the reference |
    | 32 | joint_pos | left_knee | rad | joint position minus the reference |
    | 33 | joint_pos | left_ankle_y | rad | joint position minus the reference |
    | 34 | joint_pos | left_ankle_x | rad | joint position minus the reference |
    | 35 | joint_pos | right_shoulder1 | rad | joint position minus the reference |
    | 36 | joint_pos | right_shoulder2 | rad | joint position minus the reference |
    | 37 | joint_pos | right_elbow | rad | joint position minus the reference |
    | 38 | joint_pos | left_shoulder1 | rad | joint position minus the reference |
    | 39 | joint_pos | left_shoulder2 | rad | joint position minus the reference |
    | 40 | joint_pos | left_elbow | rad | joint position minus the reference |
    | 41 | joint_vel | abdomen_z | 3 ω | joint velocity minus the reference's |
    | 42 | joint_vel | abdomen_y | 3 ω | joint velocity minus the reference's |
    | 43 | joint_vel | abdomen_x | 3 ω | joint velocity minus the reference's |
    | 44 | joint_vel | right_hip_x | 3 ω | joint velocity minus the reference's |
    | 45 | joint_vel | right_hip_z | 3 ω | joint velocity minus the reference's |
    | 46 | joint_vel | right_hip_y | 3 ω | joint velocity minus the reference's |
    | 47 | joint_vel | right_knee | 3 ω | joint velocity minus the reference's |
    | 48 | joint_vel | right_ankle_y | 3 ω | joint velocity minus the reference's |
    | 49 | joint_vel | right_ankle_x | 3 ω | joint velocity minus the reference's |
    | 50 | joint_vel | left_hip_x | 3 ω | joint velocity minus the reference's |
    | 51 | joint_vel | left_hip_z | 3 ω | joint velocity minus the reference's |
    | 52 | joint_vel | left_hip_y | 3 ω | joint velocity minus the reference's |
    | 53 | joint_vel | left_knee | 3 ω | joint velocity minus the reference's |
    | 54 | joint_vel | left_ankle_y | 3 ω | joint velocity minus the reference's |
    | 55 | joint_vel | left_ankle_x | 3 ω | joint velocity minus the reference's |
    | 56 | joint_vel | right_shoulder1 | 3 ω | joint velocity minus the reference's |
    | 57 | joint_vel | right_shoulder2 | 3 ω | joint velocity minus the reference's |
    | 58 | joint_vel | right_elbow | 3 ω | joint velocity minus the reference's |
    | 59 | joint_vel | left_shoulder1 | 3 ω | joint velocity minus the reference's |
    | 60 | joint_vel | left_shoulder2 | 3 ω | joint velocity minus the reference's |
    | 61 | joint_vel | left_elbow | 3 ω | joint velocity minus the reference's |
    | 62 | contacts | left | 1 | 1 where the foot touches the ground, else 0 |
    | 63 | contacts | right | 1 | 1 where the foot touches the ground, else 0 |
    | 64 | last_action | abdomen_z | 1 | action of the step before |
    | 65 | last_action | abdomen_y | 1 | action of the step before |
    | 66 | last_action | abdomen_x | 1 | action of the step before |
    | 67 | last_action | right_hip_x | 1 | action of the step before |
    | 68 | last_action | right_hip_z | 1 | action of the step before |
    | 69 | last_action | right_hip_y | 1 | action of the step before |
    | 70 | last_action | right_knee | 1 | action of the step before |
    | 71 | last_action | right_ankle_y | 1 | action of the step before |
    | 72 | last_action | right_ankle_x | 1 | action of the step before |
    | 73 | last_action | left_hip_x | 1 | action of the step before |
    | 74 | last_action | left_hip_z | 1 | action of the step before |
    | 75 | last_action | left_hip_y | 1 | action of the step before |
    | 76 | last_action | left_knee | 1 | action of the step before |
    | 77 | last_action | left_ankle_y | 1 | action of the step before |
    | 78 | last_action | left_ankle_x | 1 | action of the step before |
    | 79 | last_action | right_shoulder1 | 1 | action of the step before |
    | 80 | last_action | right_shoulder2 | 1 | action of the step before |
    | 81 | last_action | right_elbow | 1 | action of the step before |
    | 82 | last_action | left_shoulder1 | 1 | action of the step before |
    | 83 | last_action | left_shoulder2 | 1 | action of the step before |
    | 84 | last_action | left_elbow | 1 | action of the step before |

    Rewards: the sum of these terms, each times its weight (`reward`, see `RewardWeights`). The
    first six are 0 in the step of a fall. "Half support" is half the size of the standing support
    polygon.

    | term | weight | value |
    | --- | --- | --- |
    | alive | 0.5 | 1 |
    | com | 0.2 | exp(−4 e²), e the CoM's distance from the middle of the soles [half support] |
    | capture | 0.2 | exp(−2 e²), e the capture point's [half support] |
    | upright | 0.1 | max(cos φ, 0)⁴, φ the tilt of the root from standing |
    | quiet | 0.1 | exp(−(|ċ| / quiet_speed)² / 4) |
    | posture | 0.1 | exp(−Σ (q − q_ref)²) |
    | effort | 0.02 | −mean (τ / τ_max)² |
    | action | 0.1 | −mean a² |
    | action_rate | 0.05 | −mean (a − a_before)² / 4 |
    | fall | 5.0 | −1 in the step of a fall |

    Start: the standing posture with uniform noise on joint positions, joint velocities and the
    root's horizontal velocity (`noise`), the lowest sole on the ground; then pushes drawn from
    `pushes` by the environment's generator. `reset(options=...)` takes

    - "push": exactly these pushes: a mapping such as {"impulse": 12.0, "direction": 90.0,
      "duration": 0.1, "start": 0.5, "body": "torso"} (N·s; degrees counter-clockwise from forward,
      heading frame; seconds), a list of them, [] for none; other units: `parse_pushes`
    - "noise": factor on the start noise, 0 for the exact standing posture
    - "qpos" (nq,), "qvel" (nv,): the start itself, MuJoCo's conventions

    End: `terminated` by a fall: CoM below `fall.height` of its standing height, root tilted by more
    than `fall.tilt`, anything but the feet on the ground (`fall.ground_contact`), or a simulation
    that diverged. `truncated` after `duration` seconds. `step` then needs a `reset`.

    Info: "reward_terms" (name → weighted value; their sum is the reward), "push" (a list: start,
    force [N], duration [s], body, direction [deg], impulse J [N·s], specific_impulse J/m [N·s/kg]),
    "is_success" (tilt below `fall.quiet_tilt`, CoM slower than `fall.quiet_speed`
    and over the soles for the last `fall.quiet_time`),
    "solver_failures" (ticks of the episode), "torque_saturation" (mean share of motors at their
    limit), "root_wrench" (6,) (force [N] and moment [N·m] of a soft root in the last tick).

    Arguments: `robot` (a name, a .yaml file or a `Robot`), `config` (an `EnvConfig`, a .yaml file
    or a mapping), `render_mode` (None,
    "rgb_array" or "human"), `width` and `height` of a frame [pixels], `camera` (None for Poise's
    own, a `Camera`, or the name or id of one of the model's), and the fields of `EnvConfig` by
    name: policy_period, duration, pushes, noise, fall, reward. Fields may be plain mappings. Raises
    ConfigError naming what is wrong.

    Version history: v0, first release.
    """

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        render_mode: str | None = None,
        **overrides: Any,
    ):
        super().__init__(robot, config, render_mode=render_mode, **overrides)
        self._still = np.zeros(len(self.robot.joint_names))

    def _action_names(self) -> tuple[str, ...]:
        model = self.robot.model
        return tuple(model.actuator(i).name for i in range(model.nu))

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        return parts["motors"]

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self.arrays.q_standing, self._still

    def advance(self) -> None:
        self._bound().play()

    def compiled_step(self) -> CompiledStep | None:
        """See `BalanceEnv`."""
        return self._bound()

    def _bound(self) -> CompiledStep:
        sim, e, known = self.simulation, self.episode, self._step
        block: Any = known and known.block
        if known is None or block.episode is not e or block.pushes is not sim.push_table:
            block = TorqueStep(
                self.arrays, sim.plant, sim.state_arrays, sim.clock, self.scales, self.judge,
                self.substeps, self._still, sim.push_table, e,
            )  # fmt: skip
            known = self._step = CompiledStep(address_of(torque_step, block), block)
        return known
