"""Walking at a commanded velocity, and standing as `capture-step` does where none is asked for."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.stepping.capture_step import CaptureStep, check_qps
from poise.baselines.balance.stepping.planning.blocks import LEG_NUMBERS, SEARCHED, CaptureTick
from poise.baselines.balance.stepping.planning.config import StepLimits
from poise.baselines.balance.stepping.planning.swing_speed import possible_limits
from poise.baselines.balance.stepping.planning.swing_task import bind_swings
from poise.baselines.balance.stepping.planning.units import in_si
from poise.baselines.controller import Targets
from poise.baselines.warmup import prepare
from poise.baselines.whole_body.contact_sets import ContactSets
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.terrain import Surface, Terrain

from .config import GaitConfig, WalkConfig
from .controller import Commanded
from .given import allocate_treads, given_footholds
from .models.legs import leg_arrays, no_legs
from .models.reference import allocate_reference, leg_task
from .planner.arms import swinging_arms
from .planner.blocks import Gait, WalkTick
from .planner.command import ENTRIES, STEP_PARAMETERS, GaitCommand
from .planner.reach import Reach, check_command, reach_of
from .tick import walk_tick


def allocate_gait(
    config: GaitConfig, units: Units, limits: StepLimits | None, surfaces: Sequence[Surface] = ()
) -> Gait:
    """The gait of `config` for a robot with these units, at rest, on given `surfaces` or free.

    `limits` are what its legs can do of those of `config`; None: no step, no command is one then.
    """
    numbers = in_si(
        config, units, "step_time", "transfer_time", "width", "height", "acceleration",
        "turn_acceleration", "correction", "correction_limit", "time_price", "transfer_gain",
        "start_radius", "start_time", "speed_margin", "lower", "catch", "calm_time",
    )  # fmt: skip
    if limits is None:
        numbers["speed_margin"] = np.inf
    command = guarded_zeros(ENTRIES)
    parts: dict[str, Any] = {
        f"commanded_{name}": command[i : i + 1] for i, name in enumerate(STEP_PARAMETERS, 3)
    }
    return Gait.allocate(
        **numbers,
        command=command,
        **parts,
        **in_si(limits or config.limits, units, "time_min"),
        treads=allocate_treads(config.treads, list(surfaces), units),
    )


def limits_of_legs(robot: Robot, gait: GaitConfig) -> StepLimits | None:
    """The limits of a gait's steps that this robot's legs can keep; None: they cannot step."""
    return possible_limits(robot, gait.limits, gait.lifting, gait.qp.torque.share)


def over_treads(config: GaitConfig) -> GaitConfig:
    """The same gait with the times and the height of one on given footholds."""
    treads = config.treads
    return replace(
        config,
        step_time=treads.step_time,
        transfer_time=treads.transfer_time,
        time_price=treads.time_price,
        height=treads.height,
        limits=replace(config.limits, time_max=max(treads.time_max, config.limits.time_max)),
    )


class Walk(Commanded, CaptureStep):
    """Walks at a commanded velocity by footholds that lead the capture point [Englsberger11].

    Without a command it is `capture-step` with the same gains, bit for bit. With one it shifts its
    weight and walks: each foothold puts the capture point where the gait has it at lift-off
    (`dcm.py`), so that a push moves the foothold and the walk goes on. When the command is zero
    again it walks until both soles hold the capture point, and stands. Steps stay within what the
    legs' motors can do; a robot whose feet could not be down again in time stands, whatever the
    command. On a `terrain` that gives footholds, such as stairs, each is on its tread
    (`treads.py`); the CoM's height is that of the line through them then, whatever the gait's
    model. Raises ConfigError as `CaptureStep` does.
    """

    kernel = staticmethod(walk_tick)

    def __init__(self, robot: Robot, config: WalkConfig | None = None):
        config = config or WalkConfig()
        prepare("contacts", "planner", "walking")
        gait = self._gait_config = self._level_gait = config.gait
        check_qps(config, {"gait.qp": gait.qp})
        limits = limits_of_legs(robot, gait)
        self.gait_limits = limits or gait.limits  #: of the steps of a walk
        self.gait = allocate_gait(gait, robot.units, limits)
        self._terrain: Terrain = Flat()
        self.gait_sets = ContactSets(robot, gait.qp, gait.torque_rate_limit)
        self._walk_tick: WalkTick | None = None
        legs = no_legs() if gait.model.keeps_height else leg_arrays(robot)
        self.reference = allocate_reference(robot, gait.qp.period, legs)
        self.arms = swinging_arms(robot, self.gait_sets.posture.weight, gait.arm_weight)
        self._posture_weight = self.gait_sets.posture.weight.copy()
        self._takes_clip = False
        super().__init__(robot, config)

    @property
    def walking(self) -> bool:
        """True from the first shift of weight until the walk has stopped."""
        return bool(self.gait.walking)

    def check_command(self, command: GaitCommand) -> None:
        """Raise ConfigError with the limits of this robot for a command out of its reach."""
        check_command(command, self.robot, self.gait, self.gait_limits, self._gait_config.lifting)

    @property
    def reach(self) -> Reach:
        """The ranges of its commands, on the terrain that it assumes."""
        return reach_of(self.robot, self.gait, self.gait_limits, self._gait_config.lifting)

    @property
    def terrain(self) -> Terrain:
        """The terrain that it assumes; may be set between trials.

        Setting it raises ConfigError with the limits of the robot for what it cannot step on.
        """
        return self._terrain

    @terrain.setter
    def terrain(self, terrain: Terrain) -> None:
        level = self._level_gait
        given = given_footholds(terrain, self.robot, level.treads)
        self._gait_config = over_treads(level) if given else level
        limits = limits_of_legs(self.robot, self._gait_config)
        self.gait_limits = limits or self._gait_config.limits
        gait = allocate_gait(self._gait_config, self.robot.units, limits, given)
        members = self.gait.named().items()
        kept = {name: each for name, each in members if isinstance(each, np.ndarray)}
        self.gait, self._terrain, self._walk_tick = gait.replace(**kept), terrain, None

    def take_clip(self, walked: bool) -> None:
        """Hold trunk and arms to the targets' by the gait's `clip_weight` where a clip is walked;
        else arms are free to balance the robot."""
        if walked == self._takes_clip:
            return
        weight, self._takes_clip = self._posture_weight.copy(), walked
        if walked:
            others = 6 + PlantedLegs(self.robot).others
            least = self._level_gait.clip_weight / self.robot.units.omega**4
            weight[others] = np.maximum(weight[others], least)
        self.arms = swinging_arms(self.robot, weight, self._level_gait.arm_weight)
        self.gait_sets.posture.weight[:], self._walk_tick = weight, None

    @property
    def failures(self) -> int:
        """See `CaptureStep`; those of the gait count, too."""
        return super().failures + self.gait_sets.failures

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial, its command too."""
        super().reset(state)
        self.gait_sets.reset()
        self.gait.clear()
        self.gait.treads.leaning = 0.0

    def block(self, state: RobotState, targets: Targets) -> WalkTick:
        """See `CaptureStep`."""
        return self.around(self.tick(state, targets))

    def around(self, capture: CaptureTick) -> WalkTick:
        """The same around the block of `capture_tick`."""
        known = self._walk_tick
        if known is None or known.capture is not capture:
            model = self._gait_config.model
            known = WalkTick.allocate(
                capture=capture, walk=self._of_gait(capture), gait=self.gait,
                reference=self.reference, arms=self.arms,
                model=model.bind(self.robot, capture.state, self.reference),
                constant_height=int(model.keeps_height),
            )  # fmt: skip
            self._walk_tick = known
        return known

    def _of_gait(self, capture: CaptureTick) -> CaptureTick:
        """A block with the same memory, and the QPs, the swing and the limits of the gait."""
        gait, units = self._gait_config, self.robot.units
        legs = [leg_task(leg, self.reference) for leg in range(2)] if gait.model.has_rows else ()
        ticks = bind_swings(
            self.gait_sets, capture.state, capture.reference_out, gait.swing,
            self._swing.reference, self.memory.level_frame, legs,
        )  # fmt: skip
        swing = capture.swing.replace(
            **in_si(gait.swing, units, "lift", "landing_speed"),
            apex=gait.swing.clearance * units.height,
        )
        return capture.replace(
            swing=swing,
            gains=capture.gains.replace(**in_si(gait, units, *LEG_NUMBERS)),
            search=capture.search.replace(**in_si(self.gait_limits, units, *SEARCHED)),
            **ticks,
        )  # fmt: skip
