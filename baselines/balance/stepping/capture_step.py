"""Balance with feet fixed while this suffices; then steps to where the capture point can stop."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from poise.baselines.balance.references.targets import no_offsets
from poise.baselines.controller import CompiledController, Outputs, Targets
from poise.baselines.warmup import prepare
from poise.baselines.whole_body.contact_sets import ContactSets
from poise.baselines.whole_body.gains import COMPILED_SOLVER, MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import AroundQP, momentum_tick
from poise.baselines.whole_body.parameters import QPParameters
from poise.baselines.whole_body.tick import contact_tick
from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import NO_KERNEL, Kernel, address_of
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .controller import STANDING, Stepping, SteppingController
from .planning.blocks import LEG_NUMBERS, CaptureTick, Search, StepGains, StepMemory
from .planning.config import CaptureStepConfig, StepLimits
from .planning.cop_region import CopRegion, cop_region, rest_ahead
from .planning.feedback import feedback_arrays
from .planning.recentring import recentring_arrays, stop_recentring
from .planning.search import capture_foothold, make_search
from .planning.swing import Swing, swing_at, time_left
from .planning.swing_speed import possible_limits
from .planning.swing_task import bind_swings
from .planning.units import in_si
from .tick import capture_tick


def check_qps(
    config: CaptureStepConfig, further: Mapping[str, MomentumQPConfig] | None = None
) -> None:
    """Raises ConfigError for what the QPs of a controller that steps, and `further` ones by the
    name of their field, cannot be."""
    for name, qp in {"qp": config.qp, "step_qp": config.step_qp, **(further or {})}.items():
        if qp.root != "hard":
            raise ConfigError(f"must be 'hard', not {qp.root!r}", field=f"{name}.root")
        if qp.solver != COMPILED_SOLVER:
            raise ConfigError(
                f"must be {COMPILED_SOLVER!r}, not {qp.solver!r}", field=f"{name}.solver"
            )
        if name != "qp" and qp.compensation is not None:
            raise ConfigError("belongs to qp, and holds in steps too", field=f"{name}.compensation")
        if qp.solver_options:
            raise ConfigError("must be empty", field=f"{name}.solver_options")
        if qp.period != config.qp.period:
            raise ConfigError(
                f"must be that of qp, {config.qp.period}, not {qp.period}", field=f"{name}.period"
            )
        for task, gains in qp.tasks.items():
            if gains.kernel is None:
                raise ConfigError(
                    "has no kernel, without which a controller cannot step",
                    field=f"{name}.tasks.{task}",
                )


def allocate_step_memory(region: CopRegion) -> StepMemory:
    """The memory of a controller that has not stepped."""
    corners = region.sums.shape[0] * region.sums.shape[1]
    return StepMemory.allocate({"n": corners})


class CaptureStep(AroundQP, CompiledController, SteppingController):
    """The momentum QP with feet fixed; capturability-based steps where the ankles do not suffice.

    Stands by `qp`, bit for bit, until the capture point ξ leaves what the CoP can reach; then
    steps until it is inside again, and stays where it came to rest. In a step the CoM follows
    c̈ = ω² (c − p), p = ξ + k (ξ − ξ_ref) at most at the edge of the soles in contact [Koolen12,
    Englsberger11], and the foothold follows ξ. Steps stay within what the legs' motors can do; a
    robot whose feet could not be down again in time never steps. The ticks are those of `tick.py`;
    they are bound to `config` when they are made. Raises ConfigError unless there are two soles,
    and all QPs have a hard root, one period, the compiled solver and kernels for all tasks.
    """

    kernel: Callable[[Any], None] = staticmethod(capture_tick)  #: that a tick of steps runs
    #: finds the foothold of a foot and time
    foothold_rule: Callable[[Search], None] = staticmethod(capture_foothold)
    _arc = 0.0  # that `foothold_rule` may use

    def __init__(self, robot: Robot, config: CaptureStepConfig | None = None):
        if len(robot.soles) != 2:
            raise ConfigError(
                f"needs two feet, {robot.name!r} has {len(robot.soles)}", field="controller"
            )
        prepare("contacts", "planner")
        self.config = config or CaptureStepConfig()
        check_qps(self.config)
        super().__init__(robot, self.config.qp)
        self.qp.observes_force = False  # its ticks do, also while it steps
        self.sets = ContactSets(robot, self.config.step_qp, self.config.torque_rate_limit)
        self.region = cop_region(robot, self.config.region_fraction)
        c = self.config
        self._step_limits = possible_limits(robot, c.limits, c.swing, c.step_qp.torque.share)
        self.offsets = no_offsets()  #: what a policy adds
        self.feedback = feedback_arrays(robot, c.feedback, c.falls, c.pivot)
        self._swing = swing_at(np.zeros(3), 0.0, self.config.swing, robot.units)
        self.recentring = recentring_arrays(robot, self.config.recentring)
        self.memory = allocate_step_memory(self.region)
        #: (nv−6,) of the last tick [N·m]
        self.tau = guarded_zeros(len(self.qp.parameters.torque_limit))
        self._vdot = guarded_zeros(robot.model.nv)
        self._failures: Any = guarded_zeros(1, dtype=np.int64)  # of the tick and of the outputs
        self._motors = self.qp.arrays.motor_dofs - 6
        self._reference_out: Targets | None = None
        self._tick: CaptureTick | None = None
        self.reset()

    @property
    def failures(self) -> int:
        """The ticks since the reset at which a QP was not solved."""
        return self.qp.failures + self.sets.failures

    @property
    def vdot(self) -> np.ndarray:
        """(nv,) accelerations that the last torques are to bring."""
        return self._vdot.copy()

    @property
    def step_limits(self) -> StepLimits | None:
        """See `SteppingController`; None where the legs are too slow for any step."""
        return self._step_limits

    def gains(self) -> QPParameters:
        """See `CompiledController`."""
        return self.qp.parameters

    def outputs(self) -> Outputs:
        """See `Outputs`."""
        qp = self.qp
        wrench, soft = qp.workspace.root_wrench, qp.parameters.soft_root
        return Outputs(self.tau, wrench, self._failures, soft, self._vdot)

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        super().reset(state)
        self.sets.reset()
        self.offsets.clear()
        self.memory.clear()
        self.memory.foot = -1
        stop_recentring(self.recentring)
        self.memory.level_frame[:] = np.eye(3)
        self._failures[0] = 0

    @property
    def steps(self) -> int:
        """The number of steps begun since the reset."""
        return self.memory.steps

    @property
    def foot(self) -> int:
        """The foot that stepped last; −1: none."""
        return self.memory.foot

    @property
    def swing(self) -> Swing | None:
        """The swing in progress, or None when both feet are down; ticks write into it."""
        return self._swing if self.memory.swinging else None

    def stepping(self) -> Stepping:
        """The step in progress, see `Stepping`."""
        swing = self.swing
        if swing is None:
            return STANDING._replace(steps=self.steps, since=self.memory.clock)
        point, foothold = swing.reference[0].copy(), swing.foothold.copy()
        phase = swing.time / swing.duration
        return Stepping(self.steps, self.foot, point, foothold, phase, time_left(swing), 0.0)

    def tick(self, state: RobotState, targets: Targets) -> CaptureTick:
        """The block that `capture_tick` works on."""
        s, given = state.arrays, targets.arrays()
        known = self._tick
        if (
            known is None or known.state is not s or known.reference_in is not given
            or known.standing.problem.parameters is not self.qp.parameters
        ):  # fmt: skip
            blocks = self.blocks(state, targets)
            standing = address_of(momentum_tick, blocks.standing)
            contacts = address_of(contact_tick, blocks.on_both)
            known = self._tick = blocks.replace(standing_kernel=standing, contact_kernel=contacts)
        return known

    def blocks(self, state: RobotState, targets: Targets) -> CaptureTick:
        """`tick`, but for the addresses of the kernels that it calls."""
        if self._reference_out is None:
            self._reference_out = Targets.standing(self.robot, state)
        s, asked, region = state.arrays, self._reference_out.arrays(), self.region
        numbers = in_si(
            self.config, self.robot.units, *LEG_NUMBERS, "step_margin", "momentum_gain",
            "turn_limit", "crouch_margin", "restep_margin", "gain", "cop_overreach",
            "swing_com_drop", "load_time", "unload_time", "double_support_time",
        )  # fmt: skip
        if self._step_limits is None:
            numbers["step_margin"] = np.inf  # no fall is a reason for a step
        ticks = bind_swings(
            self.sets, s, asked, self.config.swing, self._swing.reference, self.memory.level_frame
        )
        return CaptureTick.allocate(
            {"k": region.alone.shape[1], "n": len(self.memory.region) // 2},
            robot=self.qp.arrays,
            state=s,
            reference_in=targets.arrays(),
            reference_out=asked,
            gains=StepGains(
                **numbers, rest_ahead=rest_ahead(self.robot, region), period=self.period
            ),
            search=self._search(s),
            swing=self._swing,
            memory=self.memory,
            recentring=self.recentring,
            offsets=self.offsets,
            **ticks,
            standing=self.qp.tick(state, targets),
            tau=self.tau,
            vdot=self._vdot,
            failures=self._failures,
            standing_kernel=NO_KERNEL,
            contact_kernel=NO_KERNEL,
        )

    def _search(self, s: StateArrays) -> Search:
        """The search for steps from a state, the same one as long as the state is."""
        known, c = self._tick, self.config
        if known is not None and known.state is s:
            return known.search
        return make_search(
            self.robot, s, self.region, self._step_limits or c.limits, c.foothold, self.feedback,
            self.offsets, self.foothold_rule, self._arc,
        )  # fmt: skip

    def block(self, state: RobotState, targets: Targets) -> Block:
        """The block that `kernel` works on."""
        return self.tick(state, targets)

    def compiled_tick(self, state: RobotState, targets: Targets) -> tuple[Kernel, Block]:
        """Return the kernel that compiled code calls instead of `torques`, and its block."""
        block = self.block(state, targets)
        return address_of(self.kernel, block), block

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        self.kernel(self.block(state, targets))
        return self.tau[self._motors]
