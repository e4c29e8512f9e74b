"""`poise/PositionBalance-v0`: the action is targets of joint positions, which servos reach for."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build, to_dict
from poise.envs.compiled.calls import run
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.simulation import physics_step
from poise.envs.robots.robot import Robot

from .base import EnvConfig
from .episode import end_step, record_tick
from .servos import ServoConfig, Servos, aim, drive, make_servos
from .torque import MotorBalanceEnv, MotorStep


@dataclass(frozen=True, eq=False)
class PositionStep(MotorStep):
    """All that a policy step works on."""

    servos: Servos


@compiled
def drive_step(step: PositionStep):
    """New targets, then `substeps` physics steps with torques of their own."""
    aim(step.servos, step.episode.action)
    run_servos(step)


@compiled
def run_servos(step: PositionStep):
    """`substeps` physics steps with torques of their own, by the targets that there are."""
    world, e, views = step.world, step.episode, step.world.views
    for _ in range(step.substeps):
        drive(step.servos, world)
        record_tick(world.robot, views.qvel, views.ctrl, world.robot.timestep, e)
        physics_step(world)
    update_state(world.robot, views, world.state)
    run(step.estimate)


@compiled
def position_step(step: PositionStep):
    """Take a policy step, and judge it."""
    drive_step(step)
    end_step(step.end)


class PositionBalanceEnv(MotorBalanceEnv):
    """Keep a pushed robot on its feet by targets of its joints' positions.

    Action: Box(−1, 1, (nu,)): how far the target of each motor lies from its holding one, over
    `reach`. A servo drives each motor, in every physics step, within the motor's limit τ_max:

        q* = q_hold + reach · a,    τ = clip(K (q* − q) − D q̇, ± τ_max)

    q_hold = q_standing + τ_hold / K, so that action 0 stands; `env.servos` has the numbers, and
    `action_names` are the motors. Targets are new every policy step (`policy_period`, 20 ms). A
    servo measures its own joint: it is never late, whatever `sensors` say.

    Observation: <observation>

    The push is not observed. The reference is the standing posture at rest.

    <rewards>

    <start>

    Arguments: `robot` (a name, a .yaml file or a `Robot`), `config` (an `EnvConfig`, a .yaml file
    or a mapping), `servos` (a `ServoConfig` or a mapping: how K, D and reach are chosen),
    <arguments>

    Version history: v0, first release.
    """

    kernel = staticmethod(position_step)
    step_block: ClassVar[type[MotorStep]] = PositionStep

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        servos: ServoConfig | Mapping | None = None,
        render_mode: str | None = None,
        **overrides: Any,
    ):
        super().__init__(robot, config, render_mode=render_mode, **overrides)
        self.servo_config = servo_config(servos)
        self.servos = make_servos(self.robot, self.servo_config)

    def arguments(self) -> dict[str, Any]:
        """The arguments that make another environment like this one; the robot is shared."""
        return {**super().arguments(), "servos": self.servo_config}

    def _step_members(self) -> dict[str, Any]:
        return {"servos": self.servos}


def servo_config(servos: ServoConfig | Mapping | None) -> ServoConfig:
    """Raises ConfigError naming the field that is wrong."""
    fields = {} if servos is None else to_dict(servos)
    if not isinstance(fields, Mapping):
        raise ConfigError(
            f"must be a ServoConfig or a mapping, not {shown(servos)}",
            source="environment", field="servos", choices=ServoConfig.__dataclass_fields__,
        )  # fmt: skip
    return build(ServoConfig, dict(fields), "servos")
