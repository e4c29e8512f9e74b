"""Walking at a commanded velocity, and standing as `capture-step` does where none is asked for."""

from dataclasses import replace

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.stepping.blocks import CaptureTick, Search
from poise.baselines.stepping.capture_step import CaptureStep
from poise.baselines.warmup import prepare
from poise.envs.compiled.calls import Kernel, address_of
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.maths.pendulum import Units
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .blocks import Gait, WalkTick
from .command import GaitCommand
from .config import GaitConfig, WalkConfig
from .tick import walk_tick


def allocate_gait(config: GaitConfig, units: Units) -> Gait:
    """The gait of `config` for a robot with these units, at rest."""
    c, h, omega = config, units.height, units.omega
    whole = np.int64
    return Gait(
        step_time=c.step_time / omega,
        transfer_time=c.transfer_time / omega,
        width=c.width * h,
        height=c.height * h,
        acceleration=c.acceleration * h * omega**2,
        turn_acceleration=c.turn_acceleration * omega**2,
        correction=float(c.correction),
        correction_limit=c.correction_limit * h * omega,
        time_price=c.time_price * h * omega,
        transfer_gain=float(c.transfer_gain),
        start_radius=c.start_radius * h,
        start_time=c.start_time / omega,
        speed_margin=c.speed_margin * h * omega,
        command=guarded_zeros(3),
        velocity=guarded_zeros(3),
        error=guarded_zeros(2),
        planned=guarded_zeros(2),
        yaw=guarded_zeros(1),
        walking=guarded_zeros(1, whole),
        starting=guarded_zeros(1, whole),
        clock=guarded_zeros(1),
        cop=guarded_zeros(2),
        middle=guarded_zeros(2),
        step_clock=guarded_zeros(1),
    )


class Walk(CaptureStep):
    """Walks at a commanded velocity by footholds that lead the capture point [Englsberger11].

    Without a command it is `capture-step` with the same gains, bit for bit. With one it shifts its
    weight and walks: each foothold puts the capture point where the gait has it at lift-off
    (`dcm.py`), so that a push moves the foothold and the walk goes on. When the command is zero
    again it walks until both soles hold the capture point, and stands. Raises ConfigError as
    `CaptureStep` does.
    """

    def __init__(self, robot: Robot, config: WalkConfig | None = None):
        config = config or WalkConfig()
        prepare("contacts", "planner", "walking")
        self.gait = allocate_gait(config.gait, robot.units)
        self._walk_tick: WalkTick | None = None
        super().__init__(robot, config)

    @property
    def walking(self) -> bool:
        """True from the first shift of weight until the walk has stopped."""
        return bool(self.gait.walking[0])

    @property
    def command(self) -> GaitCommand:
        """The velocity and turn that are asked for; may be set at any time."""
        return GaitCommand(*self.gait.command.tolist())

    @command.setter
    def command(self, command: GaitCommand) -> None:
        self.gait.command[:] = command.array()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial, its command too."""
        super().reset(state)
        for member in self.gait.members():
            if isinstance(member, np.ndarray):
                member[...] = 0

    def walk_tick(self, state: RobotState, targets: Targets) -> WalkTick:
        """The block that the kernel `walk_tick` works on."""
        return self.around(self.tick(state, targets))

    def around(self, capture: CaptureTick) -> WalkTick:
        """The same around the block of `capture_tick`."""
        known = self._walk_tick
        if known is None or known.capture is not capture:
            search = self._limited(capture.search)
            pair = guarded_zeros(2)
            known = WalkTick(capture, self.gait, search, pair, guarded_zeros(2))
            self._walk_tick = known
        return known

    def _limited(self, search: Search) -> Search:
        """The search with the limits of the gait."""
        assert isinstance(self.config, WalkConfig)
        limits, h, omega = self.config.gait.limits, self.robot.height_com, self.robot.omega
        return replace(
            search,
            ahead=limits.ahead * h,
            behind=limits.behind * h,
            width_min=limits.width_min * h,
            width_max=limits.width_max * h,
            speed=limits.speed * h * omega,
            side_speed=limits.side_speed * h * omega,
            time_min=limits.time_min / omega,
            time_max=limits.time_max / omega,
        )

    def compiled_tick(
        self, state: RobotState, targets: Targets
    ) -> tuple[Kernel[WalkTick], WalkTick]:
        """Return the kernel that compiled code calls instead of `torques`, and its block."""
        tick = self.walk_tick(state, targets)
        return address_of(walk_tick, tick), tick

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        tick = self.walk_tick(state, targets)
        walk_tick(tick)
        if tick.capture.to_python[0]:
            return self.qp.torques(state, targets)
        return self.tau[self._motors]
