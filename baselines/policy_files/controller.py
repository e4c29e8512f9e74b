"""A learned policy as a controller: its actions are joint targets that PD control reaches for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.baselines.controller import (
    COMMAND_ENTRIES,
    CompiledController,
    Outputs,
    Targets,
)
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.numbers import whole_steps
from poise.envs.balance.servos import pd_torque
from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import Callback, CallbackAddress, call_back
from poise.envs.compiled.calls import Kernel, address_of
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .clip_network import network_clip
from .config import PolicyFileConfig
from .joints import JointServos, joint_servos
from .motion.clips import read_clip, standing_clip
from .motion.config import NETWORK, MotionConfig
from .motion.track import MotionTrack
from .networks import load_network
from .observations import Observer, follows_commands, tracks_motion
from .terms import Seen, roll_pitch


@dataclass(eq=False)
class PolicyServos(Block):
    """PD control of all joints (nj)."""

    stiffness: np.ndarray  # (nj,) [N·m/rad]
    damping: np.ndarray  # (nj,) [N·m·s/rad]
    limit: np.ndarray  # (nj,) [N·m]
    target: np.ndarray  # (nj,) [rad]
    tau: np.ndarray  # (nj,) [N·m]
    ticks: Mutable[int]  # since the reset
    every: int  # ticks of a policy step


@dataclass(frozen=True, eq=False)
class PolicyTick(Block):
    """All that a control tick works on."""

    state: StateArrays
    servos: PolicyServos
    ask: CallbackAddress  # calls the policy for new targets


@compiled
def network_tick(t: PolicyTick):
    """τ = K (q* − q) − D q̇ within the limits; q* is new at the first tick of a policy step.

    q and q̇ are what the motors' own encoders read: they are not late where the state is.
    """
    servos, s = t.servos, t.state
    if servos.ticks % servos.every == 0:
        call_back(t.ask)
    servos.ticks += 1
    for a in range(servos.tau.shape[0]):
        servos.tau[a] = pd_torque(
            servos.stiffness[a], servos.damping[a], servos.limit[a],
            servos.target[a] - s.motor_q[a], s.motor_dq[a],
        )  # fmt: skip


def observer_of(
    robot: Robot, config: PolicyFileConfig, joints: JointServos | None = None
) -> Observer:
    """The observations of a policy on a robot; raises ConfigError as `joint_servos`, `Observer`."""
    joints = joint_servos(robot, config) if joints is None else joints
    known, moved = ([robot.joint_names[i] for i in each] for each in (joints.index, joints.moved))
    return Observer(config, known, moved, config.described_in)


class PolicyFile(CompiledController):
    """Run a policy from its files: the network every `policy_period`, PD in every physics step.

    It ignores `targets`. Its command is that of `config`, or what is written into `orders`; None
    without an observation of a command.

    Raises ConfigError where policy and robot do not fit: the period is no whole number of physics
    steps, joints that the robot lacks, lists of other sizes than the joints, terms that do not add
    up to what the network takes. A policy whose action is not finite raises PoiseError.
    """

    raw_measurements = True

    def __init__(self, robot: Robot, config: PolicyFileConfig):
        self.robot, self.config = robot, config
        self.arrays = robot_arrays(robot)
        self.period = self.arrays.timestep
        copies, source = config.copies, config.described_in
        steps = whole_steps(config.policy_period, self.period, "policy_period", source)
        if steps % copies:
            raise ConfigError(f"{copies} do not divide the {steps} physics steps of a policy step",
                              source=source, field="copies")  # fmt: skip
        self.joints = joint_servos(robot, config)
        #: one for each copy, with its last action
        self._copies = [
            (observer_of(robot, config, self.joints), np.zeros(len(self.joints.moved)))
            for _ in range(copies)
        ]
        self.observer, self.action = self._copies[0]
        self._legs = 2.0 * np.pi * np.array(config.phase_offsets)
        self.orders = guarded_zeros(COMMAND_ENTRIES) if follows_commands(config) else None
        self._clock_start: float | None = None  # [s]; None: it stands
        self.network = load_network(Path(config.policy), config)
        self._check_sizes()
        self.motion = self._motion(source)
        if copies > 1 and (self.motion is not None or self.network.memories()):
            raise ConfigError("a policy that remembers or follows a motion has one copy",
                              source=source, field="copies")  # fmt: skip
        nj = len(self.joints.target)
        limit = np.zeros(nj)
        limit[self.arrays.motor_dofs - 6] = self.arrays.torque_limit
        self._servos = PolicyServos(
            self.joints.stiffness.copy(), self.joints.damping.copy(), limit,
            self.joints.target.copy(), guarded_zeros(nj), 0, steps // copies,
        )  # fmt: skip
        self._no_wrench = guarded_zeros(6)
        self._callback = Callback(self._ask)
        self._state: RobotState | None = None
        self._tick: PolicyTick | None = None

    def __getstate__(self) -> dict[str, object]:
        return {**super().__getstate__(), "_tick": None}  # it holds an address

    def _motion(self, source: str) -> MotionTrack | None:
        """The motion that the terms show, if any does."""
        config, robot, joints = self.config, self.robot, self.joints
        if not tracks_motion(config):
            return None
        motion, period = config.motion or MotionConfig(), config.policy_period
        names = [robot.joint_names[i] for i in joints.index]
        if motion.clip == NETWORK:
            clip = network_clip(self.network, robot, names, motion.anchor, period, source)
        elif motion.clip:
            clip = read_clip(motion.clip, robot, names, period, motion.rate)
        else:
            qpos = robot.standing_qpos.copy()
            qpos[7 + joints.index] = joints.default
            clip = standing_clip(robot, period, qpos)
        return MotionTrack(robot, motion, clip, joints.index, joints.default, source)

    def _check_sizes(self) -> None:
        """Ask the network once, with zeros."""
        config, robot = self.config, self.robot
        name, source, said = Path(config.policy).name, config.described_in, ""
        if not (config.joints or config.motors):
            said = (f"; without joints or motors they are the first {len(self.joints.index)} of "
                    f"{robot.name!r}")  # fmt: skip
        try:
            answer = self.network.act(
                {n: np.zeros(size) for n, size in self.observer.sizes.items()}
            )
        except Exception as error:  # of onnxruntime or torch
            raise ConfigError(f"{name} does not take {self.observer}: {error}{said}", source=source,
                              field="observations") from None  # fmt: skip
        for role, values in answer.items():
            if len(values) != len(self.action):
                what = f"{len(values)} {'actions' if role == 'action' else role}"
                raise ConfigError(f"{name} gives {what} for {len(self.action)} joints{said}",
                                  source=source, field="joints")  # fmt: skip
        self.network.reset()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial: action zero, no history."""
        self.network.reset()
        for observer, action in self._copies:
            observer.forget()
            action[:] = 0.0
        if self.orders is not None:
            self.orders[:] = 0.0
            self.orders[:3] = self.config.command
        self._clock_start = None
        if self.motion is not None and state is not None:
            self.motion.begin(state)
        for name in ("stiffness", "damping", "target"):
            getattr(self._servos, name)[:] = getattr(self.joints, name)
        self._servos.tau[:] = 0.0
        self._servos.ticks = 0
        self._callback.error = None

    def _ask(self) -> None:
        """New targets from the policy."""
        assert self._state is not None
        now, step = self._servos.ticks * self.period, self._servos.ticks // self._servos.every
        self.observer, self.action = self._copies[step % len(self._copies)]
        index, state = self.joints.index, self._state
        command = np.array(self.config.command) if self.orders is None else self.orders[:3]
        phase = self._phase(now, bool(np.any(command)))
        seen = Seen(
            state, state.q[index], state.qvel[6:][index], self.joints.default, self.action,
            command, phase, phase + self._legs, self.motion,
        )  # fmt: skip
        if self.motion is not None:
            self.motion.update(state, step)
        observations = self.observer.observe(seen)
        if not all(np.all(np.isfinite(each)) for each in observations.values()):
            return  # the simulation diverged, which is a fall
        if self._servos.ticks == 0:
            self.warm_up(observations)
        answer = self.network.act(observations)
        for role, values in answer.items():
            if lost := np.count_nonzero(~np.isfinite(values)):
                raise PoiseError(f"{self.config.policy}: {role}: {lost} of {len(values)} numbers "
                                 f"are not finite at {now:.2f} s")  # fmt: skip
        self.action[:] = action = answer.pop("action")
        roll, pitch = roll_pitch(state)
        turn_roll, turn_pitch = state.qvel[3:5]
        attitude = np.array([pitch, turn_pitch, roll, turn_roll])
        self._servos.target[self.joints.moved] = self.joints.targets(action, attitude)
        for gain, values in answer.items():
            getattr(self._servos, gain)[self.joints.moved] = np.maximum(values, 0.0)

    def warm_up(self, observations: dict[str, np.ndarray]) -> None:
        """Let the network remember what it is asked, before its first action counts."""
        if self.config.warm_up_with == "zeros":
            observations = {name: np.zeros_like(each) for name, each in observations.items()}
        for _ in range(self.config.warm_up):
            self.network.act(observations)

    def _phase(self, now: float, walks: bool) -> float:
        """Of the clock [rad]; where it runs for a walk alone, it is 0 at rest and at its begin."""
        if self.config.phase_runs == "always":
            self._clock_start = 0.0
        elif not walks:
            self._clock_start = None
        elif self._clock_start is None:
            self._clock_start = now
        since = 0.0 if self._clock_start is None else now - self._clock_start
        return 2.0 * np.pi * (since / self.config.phase % 1.0)

    def tick(self, state: RobotState) -> PolicyTick:
        """The block that `network_tick` works on, for `state`."""
        self._state = state
        known = self._tick
        if known is None or known.state is not state.arrays:
            known = self._tick = PolicyTick(state.arrays, self._servos, self._callback.address)
        return known

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next physics step."""
        network_tick(self.tick(state))
        self.check()
        return self._servos.tau[self.arrays.motor_dofs - 6]

    def check(self) -> None:
        """Raise what went wrong in asking the policy."""
        self._callback.check()

    def compiled_tick(
        self, state: RobotState, targets: Targets
    ) -> tuple[Kernel[PolicyTick], PolicyTick]:
        tick = self.tick(state)
        return address_of(network_tick, tick), tick

    def outputs(self) -> Outputs:
        s = self._servos
        servos = {"target": s.target, "stiffness": s.stiffness, "damping": s.damping}
        return Outputs(s.tau, self._no_wrench, 0, False, **servos)

    def gains(self) -> PolicyServos:
        """See `CompiledController`; raises what went wrong in the step before."""
        self.check()
        return self._servos
