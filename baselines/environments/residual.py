"""`poise/ResidualBalance-v0`: the action moves the targets of a momentum QP."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allowing, named
from poise.baselines.controller import CompiledController, Controller, Targets, told_by
from poise.baselines.motions.motion import ReferenceMotion, load_motion
from poise.baselines.motions.offsets import MOMENTUM_X, MOMENTUM_Y, TARGETS
from poise.baselines.motions.targets import Motion
from poise.baselines.registry import load_controller
from poise.baselines.warmup import prepare
from poise.baselines.whole_body.momentum_qp import MomentumQPConfig
from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.balance.base import BalanceEnv, EnvConfig
from poise.envs.balance.episode import FAILURES, ROOT_FORCE, ROOT_MOMENT, judge_step
from poise.envs.balance.observation import Term, mirror_terms
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Erased, address_of
from poise.envs.compiled.memory import apart
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot
from poise.envs.vector.vector_env import make_vector_env

from .policy_step import (
    Aim,
    Record,
    Residual,
    ResidualStep,
    aim,
    record,
    residual_tick,
    set_offsets,
    soft_root_force,
)


@dataclass(frozen=True)
class ResidualScales:
    """What an action of 1 adds to each target, heading frame; a scale of 0 takes it away."""

    com: float = field(default=0.2, metadata={"min": 0.0})  # Δc_ref x, y [m]
    cop: float = field(default=0.15, metadata={"min": 0.0})  # Δp_ref x, y [m]
    height: float = field(default=0.0, metadata={"min": 0.0})  # Δc_ref z [m]
    lean: float = field(default=0.0, metadata={"min": 0.0})  # of the root, about x and y [rad]
    momentum: float = field(default=0.0, metadata={"min": 0.0})  # L_ref x, y [m h² ω]

    def entries(self) -> dict[str, float]:
        """The scale of each target that can be moved, in the order of `motions/offsets.py`."""
        scales = (
            self.com, self.com, self.cop, self.cop, self.height,
            self.lean, self.lean, self.momentum, self.momentum,
        )  # fmt: skip
        return dict(zip(TARGETS, scales, strict=True))


@dataclass(frozen=True)
class _Lag:
    """How the targets follow the action."""

    smoothing: float = field(metadata={"min": 0.0})  # τ [s]
    gate: float = field(metadata={"min": 0.0})  # d₀ [m]


def _action_term(name: str) -> Term:
    """What the action `name` is to a mirror."""
    if name[-2:] not in ("_x", "_y", "_z"):
        return Term(name, (name,), "1", "", "number")
    turns = name.startswith(("lean", "momentum"))
    return Term(name, (name,), "1", "", "turn" if turns else "vector")


class ResidualBalanceEnv(BalanceEnv):
    """Keep a pushed robot on its feet by moving the targets of the momentum QP.

    Tables are for the default robot; another one has its own joints and feet.

    Action: Box(−1, 1, (4,)), in the heading frame (origin at the middle of the soles, x forward, y
    left), held for one policy step (`policy_period`, 20 ms) while the QP runs at its own period.
    Zero is the controller alone, bit for bit.

    | index | name | 1 adds | to |
    | --- | --- | --- | --- |
    | 0 | com_x | `residual.com`, 0.2 m | CoM target, forward |
    | 1 | com_y | `residual.com`, 0.2 m | CoM target, left |
    | 2 | cop_x | `residual.cop`, 0.15 m | CoP target, forward |
    | 3 | cop_y | `residual.cop`, 0.15 m | CoP target, left |

    Scales above 0 for `residual.height` [m] and `residual.lean` [rad] append `com_z` (the CoM's
    height) and `lean_x`, `lean_y` (a rotation of the root's target about the axes x and y); one for
    `residual.momentum` [m h² ω] appends `momentum_x` and `momentum_y`, angular momentum that the
    posture is to carry. With `smoothing` τ > 0 [s] the targets follow the action as a first-order
    lag, a ← a + (1 − e^(−T/τ)) (action − a) per policy step T; a then is what the observation and
    the rewards call the action. With `gate` d₀ > 0 [m] the residual is scaled by
    1 − exp(−(d/d₀)²), d the distance of the capture point from the reference's: at rest the
    controller is alone.

    Observation: Box(−10, 10), in the heading frame; h is the standing height of the CoM and
    ω = √(g/h). It does not know the push. The reference is that of `motion`.

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
    | 64 | last_action | com_x | 1 | action of the step before |
    | 65 | last_action | com_y | 1 | action of the step before |
    | 66 | last_action | cop_x | 1 | action of the step before |
    | 67 | last_action | cop_y | 1 | action of the step before |

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
    or a mapping), `controller` (a name, a .yaml file, a mapping or a `Controller`),
    `motion` (a name, a .yaml file or a `ReferenceMotion`), `residual` (what an action of 1 adds, a
    `ResidualScales`), `smoothing` (time constant of the action [s]), `gate` (distance from rest at
    which the residual opens [m]), `render_mode` (None,
    "rgb_array" or "human"), `width` and `height` of a frame [pixels], `camera` (None for Poise's
    own, a `Camera`, or the name or id of one of the model's), and the fields of `EnvConfig` by
    name: policy_period, duration, pushes, noise, fall, reward. Fields may be plain mappings. Raises
    ConfigError naming what is wrong.

    Version history: v0, first release.
    """

    scales_class: type[ResidualScales] = ResidualScales  #: whose fields `residual` has

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: str | Path | Mapping | MomentumQPConfig | Controller = "momentum-qp",
        motion: str | Path | ReferenceMotion = "standing",
        residual: ResidualScales | Mapping | None = None,
        smoothing: float = 0.0,
        gate: float = 0.0,
        render_mode: str | None = None,
        **overrides: Any,
    ):
        prepare()
        given = {} if residual is None else to_dict(residual)
        self.residual = build(self.scales_class, given, "residual")
        scale = np.array(list(self.residual.entries().values()))
        self._moved = np.flatnonzero(scale)
        if len(self._moved) == 0:
            raise ConfigError("at least one scale must be above 0", field="residual")
        super().__init__(robot, config, render_mode=render_mode, **overrides)
        lag = build(_Lag, to_dict({"smoothing": smoothing, "gate": gate}), "environment")
        self.smoothing, self.gate = lag.smoothing, lag.gate
        # share of the way that the residual goes to the action in one policy step
        period = self.config.policy_period
        share = 1.0 if lag.smoothing == 0.0 else -np.expm1(-period / lag.smoothing)
        scale[MOMENTUM_X : MOMENTUM_Y + 1] *= 10.0 * self.scales.momentum
        self._offsets = apart(len(scale))
        self._residual = Residual(
            self._moved, scale[self._moved], float(share), self.gate, self._offsets
        )
        with allowing(named(controller)):  # the user hands it over, not a file
            self.controller = load_controller(controller, self.robot)
        self.motion = (
            motion if isinstance(motion, ReferenceMotion) else load_motion(motion, self.robot)
        )
        if self.motion.coeffs.shape[2] != len(self.robot.joint_names) + 6:
            raise ConfigError(
                f"{self.motion.name!r} is not a motion of {self.robot.name!r}", field="motion"
            )
        self.targets = Targets.standing(self.robot, self.simulation.state)
        self._targets = self.targets.arrays()
        columns = self.motion.coeffs.shape[2]
        self._motion = Motion(
            self.motion.knots, self.motion.coeffs, self.motion.loop, apart((3, columns))
        )

    @property
    def controller(self) -> Any:
        """Whose targets the action moves; may be replaced between episodes.

        Raises ConfigError for one of another robot, or with a period that does not fit.
        """
        return self._controller

    @controller.setter
    def controller(self, controller: Any) -> None:
        told = told_by(controller, self.robot)
        made_for = told.robot
        if made_for.fingerprint != self.robot.fingerprint:  # compiled code trusts array sizes
            raise ConfigError(
                f"is for the robot {made_for.name!r}, not {self.robot.name!r}", field="controller"
            )
        period = told.period
        self.control_substeps = self._whole(period, self.arrays.timestep, "controller period")
        self.ticks = self._whole(self.config.policy_period, period, "policy_period")
        self._controller, self._told = controller, told
        # all others are called from Python, tick by tick
        self._compiled = isinstance(controller, CompiledController) and controller.compiled
        self._com_offset = float(told.com_offset)
        self._step = None
        self._bound: tuple[ResidualStep, Any]  # what `_step` works on, the gains when it was made
        self._aim: Aim | None = None
        self._record: Record | None = None

    def arguments(self) -> dict[str, Any]:
        """What makes another environment like this one; robot and motion are shared.

        Raises ConfigError for a controller that cannot be made anew: its memory cannot be shared.
        """
        return {
            **super().arguments(),
            "controller": self._told.another(),
            "motion": self.motion,
            "residual": self.residual,
            "smoothing": self.smoothing,
            "gate": self.gate,
        }

    def _action_names(self) -> tuple[str, ...]:
        names = list(self.residual.entries())
        return tuple(names[i] for i in self._moved)

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        return mirror_terms([_action_term(name) for name in self.action_names], {})

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self.targets.q_ref, self.targets.v_ref

    def _begin(self) -> None:
        self.controller.reset(self.simulation.state)
        self._offsets[:] = 0.0
        self._update_targets()

    def _update_targets(self) -> None:
        sim, known = self.simulation, self._aim
        if known is None or known.state is not sim.state_arrays:
            known = self._aim = Aim(
                self.arrays, sim.state_arrays, sim.clock, self._motion, self._com_offset,
                self._offsets, self._targets,
            )  # fmt: skip
        aim(known)

    def compiled_step(self) -> CompiledStep | None:
        """See `BalanceEnv`: controllers with a compiled tick and solver."""
        if not self._compiled:
            return None
        known, gains, pushes = self._step, self.controller.gains(), self.simulation.push_table
        if known is not None:
            bound, made_with = self._bound
            if bound.episode is self.episode and bound.pushes is pushes and made_with is gains:
                return known
        address, tick = self.controller.compiled_tick(self.simulation.state, self.targets)
        bound = self.bind(tick, address)
        self._bound, self._step = (bound, gains), self._whole_step(bound)
        return self._step

    def _whole_step(self, bound: ResidualStep) -> CompiledStep:
        return CompiledStep(address_of(residual_tick, bound), bound, bound.ticks)

    def bind(self, tick: Block, kernel: int) -> ResidualStep:
        """All that a step works on, with the controller's tick and the address of its kernel."""
        sim, found = self.simulation, self.controller.outputs()
        return ResidualStep(
            self.arrays, sim.plant, sim.state_arrays, sim.clock,
            kernel, Erased(tick), found.tau, found.root_wrench, found.failures, found.soft_root,
            self._targets, self._motion, self._com_offset, self._residual, sim.push_table,
            self.scales, self.judge, self.ticks, self.control_substeps, self.episode,
        )  # fmt: skip

    def advance(self) -> None:
        step = self.compiled_step()
        if step is not None:
            step.play()
        else:
            self._advance_in_python()

    def _set_offsets(self) -> None:
        s = self.simulation.state_arrays
        set_offsets(self._residual, s, self._motion, self._com_offset, self.episode)

    def _advance_in_python(self) -> None:
        """What `residual_tick` does, for any controller."""
        sim, e = self.simulation, self.episode
        s, ctrl, wrench = sim.state_arrays, sim.plant.ctrl, e.root_wrench
        self._set_offsets()
        accounts = self._accounts()
        for _ in range(self.ticks):
            self._update_targets()
            ctrl[:] = self.controller.torques(sim.state, self.targets)
            wrench[:] = self._told.root_wrench
            self._push_root(wrench)
            record(accounts)
            sim.step(ctrl, self.control_substeps)
        e.metrics[FAILURES] = self._told.failures
        judge_step(
            self.arrays, sim.plant, s, self.scales, self.judge, self.targets.q_ref,
            ctrl, sim.time, e,
        )  # fmt: skip
        self._observe()

    def _accounts(self) -> Record:
        sim, e, known = self.simulation, self.episode, self._record
        if known is None or known.plant is not sim.plant or known.episode is not e:
            period = self.controller.period
            known = self._record = Record(self.arrays, sim.state_arrays, sim.plant, period, e)
        return known

    def _push_root(self, wrench: np.ndarray) -> None:
        """Apply a soft root's wrench, and take away the last one."""
        qfrc_applied = self.simulation.plant.qfrc_applied
        if not (wrench.any() or qfrc_applied[:6].any()):
            return
        soft_root_force(self.simulation.state_arrays, wrench, qfrc_applied)
        metrics = self.episode.metrics
        for metric, part in ((ROOT_FORCE, wrench[:3]), (ROOT_MOMENT, wrench[3:])):
            metrics[metric] = max(metrics[metric], float(np.linalg.norm(part)))


vector_env = partial(make_vector_env, ResidualBalanceEnv)  # for gymnasium.make_vec
