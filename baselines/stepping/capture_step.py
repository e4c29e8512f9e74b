"""Feet in place as long as that holds; then steps to where the capture point can be stopped."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from poise.baselines.controller import CompiledController, Outputs, Targets
from poise.baselines.warmup import prepare
from poise.baselines.whole_body.contact_sets import ContactSets, contact_tick
from poise.baselines.whole_body.momentum_qp import (
    COMPILED_SOLVER,
    AroundQP,
    MomentumQPConfig,
    momentum_tick,
)
from poise.baselines.whole_body.parameters import QPParameters
from poise.configs.errors import ConfigError
from poise.envs.compiled.calls import address_of
from poise.envs.compiled.memory import apart
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .controller import SteppingController
from .feedback import FallFeedback, StepFeedback
from .offsets import STANDING, Stepping
from .planner import Foothold, StepLimits, StepPlanner
from .reach import Reach, ReachArrays
from .recentring import StepHome, home_arrays, leave_home
from .swing import Swing, SwingTask, swing_gains, swing_task
from .tick import CaptureTick, StepGains, StepMemory, capture_tick


@dataclass(frozen=True)
class CaptureStepConfig:
    """`qp` holds the feet in place, `step_qp` and `swing` move them; lengths in h, times in 1/ω.

    `trigger`, `again`: how far ξ leaves the reach of both soles before the first step and before
    further ones; to the first `spin` · ω L/(m g) is added, L the angular momentum in the sense of
    the fall: hips that turn the trunk already have given what they can. `gain` k of
    p = ξ + k (ξ − ξ_ref); `hips`: how far beyond its reach p may be asked for, which costs angular
    momentum. `share` of the reach that counts. `stretch`: length of the legs at touchdown, which
    sets the CoM's height, `sink` lower in a swing. `unload`, `ramp`: time in which a foot gives its
    load away, and takes it up; `pause` between two steps.
    `jump`: largest change of a torque from tick to tick, share of its limit. `root_accel` (in a
    swing `swing_accel`), `joint_accel`: most that the posture asks for [ω²]. `feedback`: what lean
    and turn of the body add to a step, `falls` besides in falls along some directions, see
    `feedback.py`. `home`: steps back to the stance of
    standing, see `recentring.py`.
    """

    kind: Literal["capture-step"] = "capture-step"
    trigger: float = 0.0
    spin: float = field(default=0.0, metadata={"min": 0.0})
    again: float = 0.01
    gain: float = field(default=1.0, metadata={"above": 0.0})
    hips: float = field(default=0.0, metadata={"min": 0.0})
    share: float = field(default=0.95, metadata={"above": 0.0, "max": 1.0})
    stretch: float = field(default=0.96, metadata={"above": 0.0})
    sink: float = field(default=0.0, metadata={"min": 0.0})
    ramp: float = field(default=0.1, metadata={"min": 0.0})
    unload: float = field(default=0.04, metadata={"min": 0.0})
    pause: float = field(default=0.15, metadata={"min": 0.0})
    jump: float = field(default=0.6, metadata={"above": 0.0})
    root_accel: float = field(default=100.0, metadata={"above": 0.0})
    swing_accel: float = field(default=100.0, metadata={"above": 0.0})
    joint_accel: float = field(default=100.0, metadata={"above": 0.0})
    limits: StepLimits = field(default_factory=StepLimits)
    foothold: Foothold = field(default_factory=Foothold)
    feedback: StepFeedback = field(default_factory=StepFeedback)
    falls: dict[str, FallFeedback] = field(default_factory=dict)
    home: StepHome = field(default_factory=StepHome)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)
    step_qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)

    def __post_init__(self) -> None:
        if len({fall.angle for fall in self.falls.values()}) < len(self.falls):
            raise ValueError("falls: angles must differ")


def check_qps(config: CaptureStepConfig) -> None:
    """Raises ConfigError for what the QPs of a controller that steps cannot be."""
    for name, qp in (("qp", config.qp), ("step_qp", config.step_qp)):
        if qp.root != "hard":
            raise ConfigError(f"must be 'hard', not {qp.root!r}", field=f"{name}.root")
    if config.step_qp.solver != COMPILED_SOLVER:
        raise ConfigError(
            f"must be {COMPILED_SOLVER!r}, not {config.step_qp.solver!r}", field="step_qp.solver"
        )
    if config.step_qp.period != config.qp.period:
        raise ConfigError(
            f"must be that of qp, {config.qp.period}, not {config.step_qp.period}",
            field="step_qp.period",
        )


def step_gains(robot: Robot, config: CaptureStepConfig, period: float) -> StepGains:
    """`config` in m and s, for one robot."""
    c, units = config, robot.units
    h, rate = units.height, units.omega
    return StepGains(
        trigger=c.trigger * h, spin=c.spin * rate / units.force,
        again=c.again * h, gain=float(c.gain), hips=c.hips * h, leg=c.stretch * h, sink=c.sink * h,
        ramp=c.ramp / rate, unload=c.unload / rate, pause=c.pause / rate,
        root_accel=c.root_accel * rate**2, swing_accel=c.swing_accel * rate**2,
        joint_accel=c.joint_accel * rate**2, period=period,
    )  # fmt: skip


def allocate_step_memory(reach: ReachArrays) -> StepMemory:
    """No step yet."""
    corners, whole = reach.sums.shape[0] * reach.sums.shape[1], np.int64
    return StepMemory(
        steps=apart(1, whole), again=apart(1, whole), foot=apart(1, whole),
        swinging=apart(1, whole), level=apart((3, 3)), clock=apart(1), load=apart(1), left=apart(1),
        region=apart((2 * corners + 1, 2)), corners=apart(1, whole),
    )  # fmt: skip


class CaptureStep(AroundQP, CompiledController, SteppingController):
    """The momentum QP with feet in place, and steps by capturability where those cannot hold.

    Stands by `qp`, bit for bit, until the capture point ξ leaves what the CoP can reach; then
    steps until it is inside again, and stays where it came to rest. In a step the CoM follows
    c̈ = ω² (c − p), p = ξ + k (ξ − ξ_ref) at most at the edge of the soles in contact [Koolen12,
    Englsberger11], and the foothold follows ξ. The ticks are those of `tick.py`; they are
    bound to `config` and `planner` when they are made. Raises ConfigError unless there are two
    soles, and both QPs have a hard root and one period.
    """

    def __init__(self, robot: Robot, config: CaptureStepConfig | None = None):
        if len(robot.soles) != 2:
            raise ConfigError(
                f"needs two feet, {robot.name!r} has {len(robot.soles)}", field="controller"
            )
        prepare("contacts", "planner")
        self.config = config or CaptureStepConfig()
        check_qps(self.config)
        super().__init__(robot, self.config.qp)
        self.sets = ContactSets(robot, self.config.step_qp, self.config.jump)
        self.reach = Reach(robot, self.config.share)
        self.planner = self._planner(self.reach)
        self.h, self.rate = self.planner.h, self.planner.rate
        self.shift = self.planner.shift  #: what a policy adds
        self._swing = Swing(np.zeros(3), 0.0, self.config.swing, robot.units)
        self.home = home_arrays(robot, self.config.home)
        self.memory = allocate_step_memory(self.reach.arrays)
        self.tau = apart(len(self.qp.parameters.torque_limit))  #: (nv−6,) of the last tick [N·m]
        self._failures = apart(1, dtype=np.int64)
        self._motors = self.qp.arrays.motor_dofs - 6
        self._guided: Targets | None = None
        self._tick: CaptureTick | None = None
        self.reset()

    def _planner(self, reach: Reach) -> StepPlanner:
        c = self.config
        return StepPlanner(self.robot, reach, c.limits, c.foothold, c.feedback, c.falls)

    @property
    def failures(self) -> int:
        """Ticks since the reset at which a QP was not solved."""
        return self.qp.failures + self.sets.failures

    @property
    def solver(self) -> Any:
        """Of the QP with feet in place, where it is not the compiled one."""
        return self.qp.solver

    @property
    def parameters(self) -> QPParameters:
        """Of the QP with feet in place."""
        return self.qp.parameters

    @property
    def step_limits(self) -> StepLimits:
        """See `SteppingController`."""
        return self.planner.limits

    @property
    def compiled(self) -> bool:
        """See `CompiledController`; other solvers are called from Python."""
        return super().compiled and self.qp.compiled

    def gains(self) -> Any:
        """See `CompiledController`."""
        return self.qp.parameters

    def outputs(self) -> Outputs:
        """See `Outputs`."""
        qp = self.qp
        return Outputs(self.tau, qp.workspace.root_wrench, self._failures, qp.parameters.soft_root)

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        super().reset(state)
        self.sets.reset()
        self.shift.clear()
        for array in self.memory.members():
            array[...] = 0
        self.memory.foot[0] = -1
        leave_home(self.home)
        self.memory.level[:] = np.eye(3)
        self._failures[0] = 0

    @property
    def steps(self) -> int:
        """Begun since the reset."""
        return int(self.memory.steps[0])

    @property
    def stepped(self) -> bool:
        """Whether a step has begun since the reset."""
        return self.steps > 0

    @property
    def foot(self) -> int:
        """That stepped last; −1: none."""
        return int(self.memory.foot[0])

    @property
    def swing(self) -> Swing | None:
        """Of the running step."""
        return self._swing if self.memory.swinging[0] else None

    def stepping(self) -> Stepping:
        """Where it is in its steps."""
        swing = self.swing
        if swing is None:
            return STANDING._replace(steps=self.steps, since=float(self.memory.clock[0]))
        point, foothold = swing.reference[0].copy(), swing.foothold.copy()
        phase = swing.time / swing.duration
        return Stepping(self.steps, self.foot, point, foothold, phase, swing.remaining, 0.0)

    def tick(self, state: RobotState, targets: Targets) -> CaptureTick:
        """What `capture_tick` works on."""
        s, given = state.arrays, targets.arrays()
        known = self._tick
        if (
            known is None or known.state is not s or known.given is not given
            or known.place.problem.parameters is not self.qp.parameters
        ):  # fmt: skip
            blocks = self.blocks(state, targets)
            place = address_of(momentum_tick, blocks.place) if self.qp.compiled else 0
            contacts = address_of(contact_tick, blocks.both)
            known = self._tick = replace(blocks, place_kernel=place, contact_kernel=contacts)
        return known

    def blocks(self, state: RobotState, targets: Targets) -> CaptureTick:
        """`tick`, but for the addresses of the kernels that it calls."""
        if self._guided is None:
            self._guided = Targets.standing(self.robot, state)
        s, guided, sets, reach = state.arrays, self._guided.arrays(), self.sets, self.reach.arrays
        gains = swing_gains(self.qp.arrays, self.config.swing)
        reference, axes = self._swing.reference, self.memory.level
        one, two, both = (
            sets.sets[soles].bind(
                s, guided, sets, [swing_task(foot, reference, axes, gains) for foot in swinging]
            )
            for soles, swinging in (((0,), (1,)), ((1,), (0,)), ((0, 1), ()))
        )
        return CaptureTick(
            self.qp.arrays, s, targets.arrays(), guided,
            step_gains(self.robot, self.config, self.period),
            self.planner.search(state), self._swing.arrays, self.memory, self.home,
            self.shift.values, one, two, both, self.qp.tick(state, targets), self.tau,
            self._failures, apart(1, dtype=np.int64), apart(reach.alone.shape[1:]),
            apart((len(self.memory.region) // 2, 2)), apart(2), apart(3), 0, 0,
        )  # fmt: skip

    def compiled_tick(self, state: RobotState, targets: Targets) -> tuple[int, CaptureTick]:
        """What compiled code calls instead of `torques`: `call(address, block)`, then `tau`."""
        tick = self.tick(state, targets)
        return address_of(capture_tick, tick), tick

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        tick = self.tick(state, targets)
        capture_tick(tick)
        if tick.to_python[0]:
            return self.qp.torques(state, targets)
        return self.tau[self._motors]
