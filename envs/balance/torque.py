"""`poise/TorqueBalance-v0`: the action is the joints' torques."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Program, address_of, run
from poise.envs.compiled.jit import compiled
from poise.envs.physics.simulation import World, simulate
from poise.envs.robots.mirror import Mirror

from .base import BalanceEnv
from .episode import EpisodeArrays, StepEnd, end_step, record_tick


@dataclass(frozen=True, eq=False)
class MotorStep(Block):
    """All that a policy step works on."""

    world: World
    estimate: Program  # of the state source
    substeps: int  # physics steps
    episode: EpisodeArrays
    end: StepEnd


@compiled
def torque_step(step: MotorStep):
    """Take a policy step: torques are held for `substeps` physics steps."""
    world, e, ctrl = step.world, step.episode, step.world.views.ctrl
    for i in range(ctrl.shape[0]):
        ctrl[i] = e.action[i] * world.robot.torque_limit[i]
    record_tick(world.robot, world.state.qvel, ctrl, step.substeps * world.robot.timestep, e)
    simulate(world, step.substeps)
    run(step.estimate)
    end_step(step.end)


class MotorBalanceEnv(BalanceEnv):
    """The base of environments whose action is a number for each motor (nu,).

    The reference is the standing posture at rest. A subclass says what is compiled.
    """

    kernel: ClassVar[Callable[..., None]]  #: takes a policy step
    step_block: ClassVar[type[MotorStep]] = MotorStep  #: that it works on

    def _action_names(self) -> tuple[str, ...]:
        return self.robot.motor_names

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        return parts["motors"]

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self.arrays.q_standing, np.zeros(len(self.robot.joint_names))

    def _step_members(self) -> dict[str, Any]:
        """Return the members that `step_block` adds to those of a `MotorStep`."""
        return {}

    def advance(self) -> None:
        self.compiled_step().play()
        self.check()

    def compiled_step(self) -> CompiledStep:
        """The compiled policy step; the same object while it can be used again."""
        world, known = self.simulation.world(), self._step
        if known is None or getattr(known.block, "world", None) is not world:
            block = self.step_block(
                world=world,
                estimate=self.state_source.estimate,
                substeps=self.substeps,
                episode=self.episode,
                end=self.step_end(),
                **self._step_members(),
            )
            known = self._step = CompiledStep(address_of(self.kernel, block), block)
        return known


class TorqueBalanceEnv(MotorBalanceEnv):
    """Keep a pushed robot on its feet by joint torques.

    Action: Box(−1, 1, (nu,)): the torque of each motor over its limit, held for one policy step
    (`policy_period`, 20 ms); `action_names` are the motors, `robot.torque_limit` has their limits.

    Observation: <observation>

    The push is not observed. The reference is the standing posture at rest.

    <rewards>

    <start>

    Arguments: `robot` (a name, a .yaml file or a `Robot`), `config` (an `EnvConfig`, a .yaml file
    or a mapping), <arguments>

    Version history: v0, first release.
    """

    kernel = staticmethod(torque_step)
