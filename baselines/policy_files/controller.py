"""A learned policy as a controller: its actions are joint targets that PD control reaches for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.baselines.controller import CompiledController, Outputs, ServoOutputs, Targets
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.numbers import whole_steps
from poise.envs.balance.servos import pd_torque
from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import Callback, CallbackAddress, call_back
from poise.envs.compiled.calls import Kernel, address_of
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .config import PolicyFileConfig
from .joints import joint_servos
from .networks import load_network
from .observations import Observer, Seen


@dataclass(frozen=True, eq=False)
class Servos(Block):
    """PD control of all joints (nj)."""

    stiffness: np.ndarray  # (nj,) [N·m/rad]
    damping: np.ndarray  # (nj,) [N·m·s/rad]
    limit: np.ndarray  # (nj,) [N·m]
    target: np.ndarray  # (nj,) [rad]
    tau: np.ndarray  # (nj,) [N·m]
    ticks: np.ndarray  # (1,) int, since the reset
    every: int  # ticks of a policy step


@dataclass(frozen=True, eq=False)
class PolicyTick(Block):
    """All that a control tick works on."""

    state: StateArrays
    servos: Servos
    ask: CallbackAddress  # asks the policy for new targets


@compiled
def policy_tick(t: PolicyTick):
    """τ = K (q* − q) − D q̇ within the limits; q* is new at the first tick of a policy step.

    q and q̇ are what the motors' own encoders read: they are not late where the state is.
    """
    servos, s = t.servos, t.state
    if servos.ticks[0] % servos.every == 0:
        call_back(t.ask)
    servos.ticks[0] += 1
    for a in range(servos.tau.shape[0]):
        servos.tau[a] = pd_torque(
            servos.stiffness[a], servos.damping[a], servos.limit[a],
            servos.target[a] - s.motor_q[a], s.motor_dq[a],
        )  # fmt: skip


class PolicyFile(CompiledController):
    """Plays a policy from its files: the network every `policy_period`, PD in every physics step.

    What it is asked to reach (`targets`) it does not know: its command is that of `config`.

    Raises ConfigError where policy and robot do not fit: the period is no whole number of physics
    steps, joints that the robot lacks, lists of other sizes than the joints, terms that do not add
    up to what the network takes. A policy whose action is not finite raises PoiseError.
    """

    raw_measurements = True

    def __init__(self, robot: Robot, config: PolicyFileConfig):
        self.robot, self.config = robot, config
        self.arrays = robot_arrays(robot)
        self.period = self.arrays.timestep
        every = whole_steps(config.policy_period, self.period, "policy_period", config.described_in)
        self.joints = joint_servos(robot, config)
        moved = len(self.joints.moved)
        self.observer = Observer(config, len(self.joints.index), moved, config.described_in)
        self.action = np.zeros(moved)
        self.network = load_network(Path(config.policy))
        self._check_sizes()
        nj = len(self.joints.target)
        limit = np.zeros(nj)
        limit[self.arrays.motor_dofs - 6] = self.arrays.torque_limit
        self._servos = Servos(
            self.joints.stiffness, self.joints.damping, limit, self.joints.target.copy(),
            guarded_zeros(nj), guarded_zeros(1, dtype=np.int64), every,
        )  # fmt: skip
        self._failures, self._no_wrench = guarded_zeros(1, dtype=np.int64), guarded_zeros(6)
        self._callback = Callback(self._ask)
        self._state: RobotState | None = None
        self._tick: PolicyTick | None = None

    def __getstate__(self) -> dict[str, object]:
        return {**super().__getstate__(), "_tick": None}  # it holds an address

    def _check_sizes(self) -> None:
        """Ask the network once, with zeros."""
        observation = np.zeros(self.observer.size, dtype=np.float32)
        name, source = Path(self.config.policy).name, self.config.described_in
        try:
            action = self.network.act(observation)
        except Exception as error:  # of onnxruntime or torch
            raise ConfigError(
                f"{name} does not take {len(observation)} numbers ({self.observer.parts}): {error}",
                source=source,
                field="observations",
            ) from None
        if len(action) != len(self.action):
            raise ConfigError(
                f"{name} gives {len(action)} actions for {len(self.action)} joints",
                source=source,
                field="joints",
            )
        self.network.reset()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial: action zero, no history."""
        self.network.reset()
        self.observer.forget()
        self.action[:] = 0.0
        self._servos.target[:] = self.joints.target
        self._servos.tau[:] = 0.0
        self._servos.ticks[0] = 0
        self._callback.error = None

    def _ask(self) -> None:
        """New targets from the policy."""
        assert self._state is not None
        now = self._servos.ticks[0] * self.period
        index, state = self.joints.index, self._state
        seen = Seen(
            state, state.q[index], state.qvel[6:][index], self.joints.default, self.action,
            np.array(self.config.command), 2.0 * np.pi * (now / self.config.phase % 1.0),
        )  # fmt: skip
        observation = self.observer.observe(seen)
        if not np.all(np.isfinite(observation)):
            return  # the simulation diverged, which is a fall
        action = self.network.act(observation)
        if not np.all(np.isfinite(action)):
            lost = np.count_nonzero(~np.isfinite(action))
            raise PoiseError(f"{self.config.policy}: action: {lost} of {len(action)} numbers are "
                             f"not finite at {now:.2f} s")  # fmt: skip
        self.action[:] = action
        self._servos.target[self.joints.moved] = self.joints.targets(action)

    def tick(self, state: RobotState) -> PolicyTick:
        """The block that `policy_tick` works on, for `state`."""
        self._state = state
        known = self._tick
        if known is None or known.state is not state.arrays:
            known = self._tick = PolicyTick(state.arrays, self._servos, self._callback.address)
        return known

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next physics step."""
        policy_tick(self.tick(state))
        self.check()
        return self._servos.tau[self.arrays.motor_dofs - 6]

    def check(self) -> None:
        """Raise what went wrong in asking the policy."""
        self._callback.check()

    def compiled_tick(
        self, state: RobotState, targets: Targets
    ) -> tuple[Kernel[PolicyTick], PolicyTick]:
        """See `CompiledController`."""
        tick = self.tick(state)
        return address_of(policy_tick, tick), tick

    def outputs(self) -> Outputs:
        """See `Outputs`."""
        s = self._servos
        servos = ServoOutputs(s.target, s.stiffness, s.damping)
        return Outputs(s.tau, self._no_wrench, self._failures, False, servos=servos)

    def gains(self) -> Servos:
        """See `CompiledController`; raises what went wrong in the step before."""
        self.check()
        return self._servos
