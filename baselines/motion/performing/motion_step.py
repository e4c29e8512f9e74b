"""`feedback-step` that performs motions whose feet leave the ground."""

import numpy as np

from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.tempo import Pace
from poise.baselines.balance.stepping.capture_step import CaptureStep, check_qps
from poise.baselines.balance.stepping.planning.blocks import CaptureTick
from poise.baselines.balance.stepping.planning.swing_task import bind_swings
from poise.baselines.controller import Targets
from poise.baselines.warmup import prepare
from poise.baselines.whole_body.contact_sets import ContactSets
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel, address_of
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.warmup import fill_cache
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .blocks import Performance, PerformTick, allocate_performance
from .config import MotionStepConfig
from .tick import perform_tick

KERNELS = "poise.baselines.motion.kernels"


def warm_up() -> None:
    """Fill the cache of compiled kernels of this controller if it is cold, see `prepare`."""
    prepare("contacts", "planner")
    fill_cache(KERNELS, {"performing": "motions with steps"}, ("performing",))


class MotionStep(CaptureStep):
    """Performs motions with steps, and catches falls as `capture-step` does with the same gains.

    A motion whose soles stay planted is followed by `CaptureStep`, bit for bit. With a `Footing`
    the soles in contact are those of its schedule: see `tick.py`. Where the capture point leaves
    what the soles reach, steps are planned; when the robot stands again as the motion has its feet,
    the motion goes on there. Raises ConfigError as `CaptureStep` does.
    """

    def __init__(self, robot: Robot, config: MotionStepConfig | None = None):
        config = config or MotionStepConfig()
        warm_up()
        check_qps(config, {"perform.qp": config.perform.qp})
        self.perform_sets = ContactSets(
            robot, config.perform.qp, config.perform.torque_rate_limit
        )  # fmt: skip
        self.performance: Performance | None = None  #: of the motion, if its feet leave the ground
        self._perform_config = config.perform
        self._perform_tick: PerformTick | None = None
        self._legs = PlantedLegs(robot).legs.astype(np.int64)
        self._axes = guarded_zeros((3, 3))
        self._resting: Targets | None = None
        super().__init__(robot, config)

    def perform(self, motion: ReferenceMotion, pace: Pace) -> None:
        """Take the motion whose targets it is going to be given, and the pace of its time."""
        self._perform_tick = self.performance = None
        if motion.footing is not None:
            self.performance = allocate_performance(
                motion.footing, pace, self._perform_config, self.robot.units
            )  # fmt: skip

    @property
    def failures(self) -> int:
        """See `CaptureStep`; those of the performance count, too."""
        return super().failures + self.perform_sets.failures

    def reset(self, state: RobotState | None = None) -> None:
        super().reset(state)
        self.perform_sets.reset()
        if self.performance is not None:
            self.performance.clear()

    def perform_tick(self, state: RobotState, targets: Targets) -> PerformTick:
        """The block that the kernel `perform_tick` works on; there must be a `performance`."""
        return self.around(self.tick(state, self.resting(state)), targets)

    def resting(self, state: RobotState) -> Targets:
        """What it asks of itself while it catches a fall; the same object always."""
        if self._resting is None:
            self._resting = Targets.standing(self.robot, state)
        return self._resting

    def around(self, capture: CaptureTick, targets: Targets) -> PerformTick:
        """The same around the block of `capture_tick`."""
        known, given = self._perform_tick, targets.arrays()
        if known is None or known.capture is not capture or known.given is not given:
            assert self.performance is not None and self._resting is not None
            known = self._perform_tick = PerformTick(
                capture=capture, own=self._of_performance(capture), performance=self.performance,
                given=given, resting=self._resting.arrays(), legs=self._legs,
                com_offset=float(self.com_offset), axes=self._axes,
            )  # fmt: skip
        return known

    def _of_performance(self, capture: CaptureTick) -> CaptureTick:
        """A block with the same memory, and the QPs of the performance."""
        c, omega = self._perform_config, self.robot.units.omega
        ticks = bind_swings(
            self.perform_sets, capture.state, capture.reference_out, c.swing,
            self._swing.reference, self._axes,
        )  # fmt: skip
        gains = capture.gains.replace(
            root_accel=c.root_accel * omega**2,
            swing_accel=c.swing_accel * omega**2,
            joint_accel=c.joint_accel * omega**2,
        )
        return capture.replace(gains=gains, **ticks)

    def compiled_tick(self, state: RobotState, targets: Targets) -> tuple[Kernel, Block]:
        if self.performance is None:
            return super().compiled_tick(state, targets)
        tick = self.perform_tick(state, targets)
        return address_of(perform_tick, tick), tick

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        if self.performance is None:
            return super().torques(state, targets)
        perform_tick(self.perform_tick(state, targets))
        return self.tau[self._motors]


#: what ``kind: motion-step`` makes, by the entry point in pyproject.toml
KIND = (MotionStepConfig, MotionStep)
