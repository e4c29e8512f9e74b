"""The momentum QP with any subset of the soles in contact, and with contacts of other bodies.

One reduced problem for each subset (see `reduced_qp.py`), built on arrays that hold the soles in
contact only. A stack of tasks says what else is asked of v̇, such as the way of a swing foot.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.envs.compiled.calls import address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .gains import MomentumQPConfig
from .momentum_qp import BoundQP
from .parameters import QPParameters
from .parts.part import Bound
from .reduced_qp import assemble
from .tasks.task import Task
from .tick import ContactTick, forget, solve
from .workspace import Workspace


@dataclass(frozen=True, eq=False)
class ContactSet(Copyable):
    """A subset of the soles: the robot with these alone, its parameters and scratch."""

    index: int
    arrays: RobotArrays
    parameters: QPParameters
    workspace: Workspace


class ContactSets(BoundQP):
    """The momentum QP for each sole alone and for all; remembers torques between ticks.

    No torque changes by more than `torque_rate_limit` of its limit from one tick to the next,
    whatever the contacts do: this is a bound of the QP; where the QP has no solution within it, the
    torques are clipped.
    """

    def __init__(self, robot: Robot, config: MomentumQPConfig, torque_rate_limit: float = np.inf):
        super().__init__(robot, config)
        limit, count = self.parameters.torque_limit, len(robot.soles)
        self.slew = np.where(limit > 0.0, torque_rate_limit * limit, np.inf)
        self.applied = guarded_zeros(len(limit))  # torques of the last tick, if
        self.follows: Any = guarded_zeros(1, dtype=np.int64)  # there was one
        # index of the subset of the last tick, −1: none
        self.chosen: Any = guarded_zeros(1, dtype=np.int64)
        self.chosen[0] = -1
        subsets: list[tuple[int, ...]] = [(i,) for i in range(count)]
        if count > 1:
            subsets.append(tuple(range(count)))
        self.sets = {soles: self._set(index, soles) for index, soles in enumerate(subsets)}

    def _set(self, index: int, soles: tuple[int, ...]) -> ContactSet:
        pick = list(soles)
        names = [item.name for item in fields(RobotArrays)]
        names = [name for name in names if name.startswith(("sole_", "chain"))]
        picked = {name: getattr(self.arrays, name)[pick] for name in names}
        arrays = self.arrays.replace(**picked)
        cone = self.parameters.cone[pick]  # with a row more for each sole: the bound on its load
        p = self.parameters.replace(cone=np.pad(cone, ((0, 0), (0, 1), (0, 0))))
        return ContactSet(index, arrays, p, self.new_workspace(arrays, p))

    def reset(self) -> None:
        """Forget the last trial."""
        forget(self.memory)
        self.chosen[0], self.follows[0] = -1, 0

    def bind(
        self,
        soles: tuple[int, ...],
        s: StateArrays,
        targets: TargetArrays,
        tasks: Iterable[Bound[Task]] = (),
    ) -> ContactTick:
        """What a tick with these soles works on from `s`; its stack has the tasks of the
        configuration, then `tasks`."""
        chosen = self.sets[soles]
        feet, rows = slice(soles[0], soles[-1] + 1), slice(6 * soles[0], 6 * soles[-1] + 6)
        own = s.replace(
            J=s.J[rows], J_v=s.J_v[rows], Jdot_v=s.Jdot_v[rows], sole_point=s.sole_point[feet],
            sole_axes=s.sole_axes[feet], contacts=s.contacts[feet], origin=guarded_zeros(3),
        )  # fmt: skip
        ws = chosen.workspace
        problem = self.new_assembly(chosen.arrays, own, chosen.parameters, targets, ws, s, tasks)
        return ContactTick.allocate(
            {"nc": len(soles)}, problem=problem, memory=self.memory, posture=self.posture,
            applied=self.applied, slew=self.slew, follows=self.follows, chosen=self.chosen,
            index=chosen.index, assemble=address_of(assemble, problem), solve=address_of(solve, ws),
        )  # fmt: skip
