"""A controller run in an environment: its ticks in a policy step, compiled or in Python."""

from collections.abc import Callable
from typing import Any

import numpy as np

from poise.baselines.controller import (
    BaseController,
    CompiledController,
    Controller,
    Targets,
    as_base_controller,
)
from poise.baselines.walking.schedule import follow_timetable
from poise.configs.errors import ConfigError
from poise.configs.numbers import whole_steps
from poise.envs.balance.episode import judge_step, record_tick
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Erased, Kernel, Program, address_of

from .commanded import CommandedEnv
from .policy_step import (
    PolicyStep,
    TargetInputs,
    add_torques,
    policy_tick,
    set_offsets,
    set_targets,
    soft_root_force,
)


class ControlledEnv(CommandedEnv):
    """Base of environments around a controller, whose targets and torques a residual moves.

    A policy step is `ticks` control ticks of `control_substeps` physics steps. They are one
    compiled program where the controller has a compiled tick, and else called from Python, with
    the same bits. A subclass has `targets`, and says by `_target_inputs` what they are made of.
    """

    targets: Targets  #: of the controller, in this tick

    @property
    def controller(self) -> Controller:
        """Whose targets the action moves; may be replaced between episodes.

        Raises ConfigError for one of another robot, or with a period that does not fit.
        """
        return self._controller

    @controller.setter
    def controller(self, controller: Controller) -> None:
        self._accept(controller, as_base_controller(controller, self.robot))

    def _accept(self, controller: Controller, base: BaseController) -> None:
        """Take the controller; raises ConfigError for one that this environment cannot play.

        `base` is the controller itself, or a wrapper of one that is no `BaseController`.
        """
        made_for = base.robot
        if made_for.fingerprint != self.robot.fingerprint:  # compiled code trusts array sizes
            raise ConfigError(
                f"is for the robot {made_for.name!r}, not {self.robot.name!r}", field="controller"
            )
        period = base.period
        step, source = self.arrays.timestep, "environment"
        self.control_substeps = whole_steps(period, step, "controller period", source)
        self.ticks = whole_steps(self.config.policy_period, period, "policy_period", source)
        self._controller, self._base = controller, base
        self._take_walker(base)
        # all others are called from Python, tick by tick
        self._compiled = isinstance(base, CompiledController) and base.compiled
        self._com_offset = float(base.com_offset)
        self.use_raw(base.raw_measurements)
        self._unbind()

    def _unbind(self) -> None:
        super()._unbind()
        self._bound: tuple[PolicyStep, Block]  # what `_step` works on, the gains when it was made
        self._inputs: TargetInputs | None = None

    def _target_inputs(self) -> TargetInputs:
        """The block for `set_targets`; the same object until something is replaced."""
        raise NotImplementedError

    def compiled_step(self) -> CompiledStep | None:
        """The compiled policy step, for a controller with a compiled tick and solver; else None."""
        controller = self._controller
        if not self._compiled or not isinstance(controller, CompiledController):
            return None
        known, gains, world = self._step, controller.gains(), self.simulation.world()
        if known is not None:
            bound, made_with = self._bound
            if bound.world is world and made_with is gains:
                return known
        kernel, tick = controller.compiled_tick(self.state_source.state, self.targets)
        bound = self.bind(tick, kernel)
        self._bound = bound, gains
        self._step = self._stepping(bound)
        return self._step

    def _stepping(self, bound: PolicyStep) -> CompiledStep:
        """The compiled policy step that works on `bound`."""
        return CompiledStep(address_of(policy_tick, bound), bound, bound.ticks)

    def bind(self, tick: Block, kernel: Kernel) -> PolicyStep:
        """All that a policy step works on, with the controller's `kernel` and its block `tick`."""
        controller = self._controller
        assert isinstance(controller, CompiledController)  # only they have ticks
        return PolicyStep(
            inputs=self._target_inputs(),
            kernel=kernel,
            tick=Erased(tick),
            outputs=controller.outputs(),
            promise=self.state_source.promise,
            world=self.simulation.world(),
            estimate=self.state_source.estimate,
            ticks=self.ticks,
            substeps=self.control_substeps,
            episode=self.episode,
            end=self.step_end().replace(report=Program.of(self._reports(tick))),
        )

    def _reports(self, tick: Any) -> list[tuple[Callable[..., None], Block]]:
        """The kernels that follow a judged policy step, before it is observed."""
        if self._orders is None:
            return []
        return [(follow_timetable, self._follower(self._orders))]

    def advance(self) -> None:
        step = self.compiled_step()
        if step is not None:
            step.play()
            self.check()
        else:
            self.episode.ticks = 0  # the controller may have raised in the middle of a step
            for _ in range(self.ticks):
                self._tick_in_python()

    def check(self) -> None:
        """See `BalanceEnv`; it may be the controller's, too."""
        super().check()
        self._base.check()

    def tick(self) -> None:
        if self.compiled_step() is None:
            self._tick_in_python()
        else:
            super().tick()

    def _tick_in_python(self) -> None:
        """Play the control tick of `policy_tick` with any controller."""
        sim, e, a = self.simulation, self.episode, self._target_inputs()
        ctrl, wrench = sim.views.ctrl, e.root_wrench
        if e.ticks == 0:
            set_offsets(a.residual, a.state, a.motion, a.com_offset, e)
        set_targets(a)
        source = self.state_source
        ctrl[:] = self.controller.torques(source.state, self.targets)
        if len(source.promise) and (promised := self._base.vdot) is not None:
            source.promise[:] = promised
        add_torques(a.residual, self.arrays.torque_limit, ctrl)
        sim.bus.servoed = 0
        wrench[:] = self._base.root_wrench
        self._push_root(wrench)
        record_tick(sim.arrays, sim.state_arrays.qvel, ctrl, float(self.controller.period), e)
        sim.step(ctrl, self.control_substeps)
        source.update()
        e.ticks += 1
        if e.ticks != self.ticks:
            return
        e.ticks = 0  # the end of the policy step, as of `end_tick`
        e.metrics.failures = self._base.failures
        judge_step(self.step_end().judge)
        if self._orders is not None:
            follow_timetable(self._follower(self._orders))
        self._observe()

    def _push_root(self, wrench: np.ndarray) -> None:
        """Apply a soft root's wrench, and take away the last one."""
        qfrc_applied = self.simulation.views.qfrc_applied
        if not (wrench.any() or qfrc_applied[:6].any()):
            return
        soft_root_force(self.simulation.state_arrays, wrench, qfrc_applied)
        m = self.episode.metrics
        m.root_force = max(m.root_force, float(np.linalg.norm(wrench[:3])))
        m.root_moment = max(m.root_moment, float(np.linalg.norm(wrench[3:])))
