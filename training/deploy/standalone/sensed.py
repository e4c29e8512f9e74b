"""A controller or a policy from what a robot's sensors measure, by the benchmark's estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, PoiseError
from poise.envs.compiled.calls import Program, run
from poise.envs.physics.state import RobotState
from poise.envs.sensing.drawn import DrawnRobot
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.measurement import RING
from poise.envs.sensing.realism import PARTS, Realism
from poise.training.benchmarking.trials.agents import Agent

from .outside import OutsideController
from .readings import Measurement, Readings


class MotorCommand(NamedTuple):
    """What the motors are asked for: τ = `torque` + `stiffness` (`target` − q) − `damping` q̇.

    Each is (nu,), in N·m, N·m/rad, rad and N·m·s/rad. A controller of torques has no stiffness and
    no damping. A motor runs the servo on its own encoder, and keeps to its limit.
    """

    torque: np.ndarray
    target: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def targets(
        self, q: np.ndarray, dq: np.ndarray, stiffness: np.ndarray, damping: np.ndarray
    ) -> MotorCommand:
        """Return the same command for motors that take targets and no torques.

        Gains K', D' take the place of none, and the target q' that of the torque:
        K' (q' − q) − D' q̇ = τ at the readings q, q̇ of the motors; when these have moved on, the
        servo's torque has too, by −K' Δq − D' Δq̇. A command that has gains keeps them.

        Args:
            q, dq: (nu,) positions [rad] and velocities [rad/s] of the motors, the latest ones.
            stiffness, damping: (nu,) K' [N·m/rad] and D' [N·m·s/rad] of motors without gains.

        Raises ConfigError for a stiffness of them that is not above 0.
        """
        free = (self.stiffness == 0.0) & (self.damping == 0.0)
        if not np.all(np.asarray(stiffness)[free] > 0.0):
            raise ConfigError("must be above 0", source="targets", field="stiffness")
        gain = np.where(free, stiffness, self.stiffness)
        brake = np.where(free, damping, self.damping)
        if not np.all(gain > 0.0):
            raise ConfigError("has motors with damping alone, which targets cannot express",
                              source="targets", field="command")  # fmt: skip
        torque = self.torque + self.stiffness * (self.target - q) - self.damping * dq
        return MotorCommand(np.zeros_like(torque), q + (torque + brake * dq) / gain, gain, brake)


class MeasuredState(EstimatedState):
    """Estimated state of a robot whose measurements are passed in, not simulated.

    Attributes:
        start: measurements before the episode, the last one at its start.
    """

    start: Sequence[Measurement] = ()

    @classmethod
    def instead_of(cls, source: EstimatedState) -> MeasuredState:
        """Return the same of the plant and the estimator of `source`."""
        config = source.config
        if config.kind == "exact":
            reason = "exact is the true state, which no sensor measures"
            raise ConfigError(reason, field="estimator.kind", choices=("auto", "odometry", "inekf"))
        if config.kind == "auto":
            config = replace(config, kind="odometry")
        state = cls(source.plant, source.plant.robot, config)
        state.believing = state.estimate
        state.estimate, state.sense = Program.of(()), Program.of(())
        return state

    believing: Program  #: of the estimator

    def begin(self, drawn: DrawnRobot, holding: np.ndarray) -> None:
        """As of `EstimatedState`, from the measurements of `start`."""
        super().begin(drawn, holding)
        rings = self.sensors.rings
        rings.next = 0
        for i in range(-RING, 0):
            self.measure(self.start[max(len(self.start) + i, 0)])
        rings.count = 1
        self._begin_estimate()

    def measure(self, m: Measurement) -> None:
        """Take the measurement of the next physics step."""
        rings, bus = self.sensors.rings, self.bus
        k, robot = rings.next, self.plant.robot
        m.write(rings, k, robot)
        bus.q[:], bus.dq[:] = rings.q[k], rings.dq[k]
        rings.next = (k + 1) % RING
        rings.count += 1

    def update(self) -> None:
        """Estimate the state from what has been measured."""
        run(self.believing)


class SensedController(OutsideController):
    """Motor commands from measurements: bit-identical to the benchmark's at that level.

    The estimator and the predictor are those of the benchmark. The realism level defines what is
    known of the robot: sensing delay, command delay, motor lag and sensor
    noise; of a range the middle is used.

    Call `reset` once, and then `command` every `period` seconds with what was measured since.

    Attributes (and those of `OutsideController`):
        sensor_period: seconds between two measurements.
        measurements: that `command` takes, `period` over `sensor_period`.
    """

    def __init__(self, agent: Agent, level: Realism):
        super().__init__(agent)
        env = self._env
        if level.ideal:
            raise ConfigError("is ideal: its state needs no estimate; leave realism out",
                              source=agent.name, field="realism", choices=PARTS)  # fmt: skip
        env.realism = typical(level)
        assert isinstance(env.state_source, EstimatedState)  # the level is not ideal
        self._state = MeasuredState.instead_of(env.state_source)
        env.state_source = self._state
        self.measurements, self.sensor_period = self._substeps, env.arrays.timestep
        self.period = self.measurements * self.sensor_period
        self._running = False

    @property
    def state(self) -> RobotState:
        """The estimated state as of the last `reset` or `command`."""
        return self._state.state

    def reset(self, start: Readings, measured: Measurement | Sequence[Measurement]) -> None:
        """Forget everything; the robot stands as `start` tells, and has measured `measured`.

        Args:
            start: the pose from which the estimate sets out; its velocities are those of the start.
            measured: at rest, the last one now; at most the last 64 count. Their mean tells the
                joints, so that more of them tell it better.

        Raises ConfigError naming what is missing, or no number.
        """
        self._state.start = [measured] if isinstance(measured, Measurement) else list(measured)
        if not self._state.start:
            raise ConfigError("must be at least one", source="reset", field="measured")
        for each in self._state.start:
            each.check(self.robot)
        self._begin(start)
        self._running, self._first = True, True

    def command(self, measured: Measurement | Sequence[Measurement] = ()) -> MotorCommand:
        """What the motors are asked for during the next `period`.

        Args:
            measured: since the last call, oldest first, one each `sensor_period`; none in the first
                call after a reset, which had them.

        Raises ConfigError for another number of them, or naming what is no number; PoiseError
        before a `reset`.
        """
        if not self._running:
            raise PoiseError("command() before reset(): tell the controller where it starts")
        new = [measured] if isinstance(measured, Measurement) else list(measured)
        expected = 0 if self._first else self.measurements
        if len(new) != expected:
            raise ConfigError(f"must be {expected} measurements, not {len(new)}", source="command",
                              field="measured")  # fmt: skip
        for each in new:
            each.check(self.robot)
        for each in new:
            self._state.measure(each)
        if not self._first:
            self._state.update()
        self._first = False
        return self._tick()

    def _tick(self) -> MotorCommand:
        """Run a control tick of the environment; the rest of its simulation is not used."""
        self._act()
        env, motors = self._env, self._state.motors
        estimated, views = self._state.state_arrays, env.simulation.views
        views.qpos[:], views.qvel[:] = estimated.qpos, estimated.qvel
        env.tick()
        row = (motors.written - 1) % RING
        return MotorCommand(*(each[row].copy() for each in motors.asked.members()))


def typical(level: Realism) -> Realism:
    """Return the level with the middle of each range in its place."""
    parts = {}
    for name in PARTS[1:]:
        part = getattr(level, name)
        values = {item.name: getattr(part, item.name) for item in fields(part)}
        middle = {k: sum(v) / 2.0 for k, v in values.items() if isinstance(v, tuple)}
        parts[name] = replace(part, **middle)
    return replace(level, **parts)
