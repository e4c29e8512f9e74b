"""`poise/ResidualBalance-v0`: the action moves the targets of a momentum QP."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from poise.baselines.allowance import allowing, named
from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import ReferenceMotion, command_options
from poise.baselines.balance.references.targets import motion_arrays
from poise.baselines.balance.references.tempo import Pace, Tempo
from poise.baselines.controller import Controller, Targets, as_base_controller
from poise.baselines.registry import (
    ControllerConfig,
    controller_kind,
    is_replaced,
    load_controller,
    performing_controllers,
    where_uncertain,
)
from poise.baselines.walking.controller import ClipWalker
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.balance.base import EnvConfig
from poise.envs.balance.mdp.observation import Term, mirror_terms
from poise.envs.balance.vector.vector_env import make_vector_env
from poise.envs.compiled.block import Block
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot
from poise.envs.sensing.push_force import forget_pushes, push_force
from poise.envs.sensing.realism import Realism

from .controlled import ControlledEnv
from .policy_step import TargetInputs, set_targets
from .scales import Lag, ResidualScales, action_term, make_residual
from .terms import FORCE_TERMS, ForceView, MotionView


@runtime_checkable
class Performer(Protocol):
    """What a controller has that knows the motion whose targets it is given."""

    def perform(self, motion: ReferenceMotion, pace: Pace) -> None:
        """Take the motion, and the pace of its time."""


class ResidualBalanceEnv(ControlledEnv):
    """Keep a pushed robot on its feet by moving the targets of the momentum QP.

    Action: Box(−1, 1, (4,)), in the heading frame (origin at the middle of the soles, x forward, y
    left), held for one policy step (`policy_period`, 20 ms) while the QP runs at its own period.
    Zero is the controller alone, bit for bit. Where sensors err or bodies are drawn, the one that
    the controller's `uncertain` names takes its place.

    | index | name | 1 adds | to |
    | --- | --- | --- | --- |
    | 0 | com_x | `residual.com`, 0.2 m | CoM target, forward |
    | 1 | com_y | `residual.com`, 0.2 m | CoM target, left |
    | 2 | cop_x | `residual.cop`, 0.15 m | CoP target, forward |
    | 3 | cop_y | `residual.cop`, 0.15 m | CoP target, left |

    With the feet fixed, CoM targets gain for pushes that last and for gusts from one side; the CoP
    target changes next to nothing at the packaged gains: at rest the CoP is below the CoM, whatever
    is asked of it, and in between it is the CoM's law that decides. A `residual.cop` of 0 leaves
    both entries out.

    Scales above 0 for `residual.height` [m] and `residual.lean` [rad] append `com_z` (the CoM's
    height) and `lean_x`, `lean_y` (a rotation of the root's target about the axes x and y); one for
    `residual.momentum` [m h² ω] appends `momentum_x` and `momentum_y`, angular momentum that the
    posture is to carry. One for `residual.torque` [the motor's limit] appends an entry for each
    motor, whose torque is added to the controller's, within the limit. With `smoothing` τ > 0 [s]
    the targets follow the action as a first-order lag, a ← a + (1 − e^(−T/τ)) (action − a) per
    policy step T; a then is what the observation and the rewards call the action. With `gate`
    d₀ > 0 [m] the residual is scaled by 1 − exp(−(d/d₀)²), d the distance of the capture point from
    the reference's: at rest the controller is alone.

    Observation: <observation>

    The push is not observed. `observation: {extra: [push_force, push_mean]}` adds the force that
    is estimated from momentum and CoP, and its leaky mean. The reference is that of `motion`.

    A controller that walks follows `command`, a `GaitCommand` that may be set at any time; the
    option "command" of `reset` sets it from the start on: a mapping with `ahead`, `left` [m/s] and
    `turn` [rad/s], or a list of them, each from its `start` [s] on.

    <rewards>

    <start>

    Arguments: `robot` (a name, a .yaml file or a `Robot`), `config` (an `EnvConfig`, a .yaml file
    or a mapping), `controller` (a name, a .yaml file, a mapping or a `Controller`),
    `motion` (a name, a .yaml file, a .npz file or a `ReferenceMotion`), `residual` (what an action
    of 1 adds, a `ResidualScales`), `smoothing` (time constant of the action [s]), `gate` (distance
    from rest at which the residual opens [m]), `tempo` (whether and how the motion waits while
    the robot catches itself, a `Tempo`), <arguments>

    Version history: v0, first release.
    """

    scales_class: type[ResidualScales] = ResidualScales  #: whose fields `residual` has
    _keeps_arms = True  # of a clip that is walked
    only_targets = True  #: the action moves targets and nothing else
    known_terms = FORCE_TERMS

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: str | Path | Mapping | ControllerConfig | Controller = "momentum-qp",
        motion: str | Path | ReferenceMotion = "standing",
        residual: ResidualScales | Mapping | None = None,
        smoothing: float = 0.0,
        gate: float = 0.0,
        tempo: Tempo | Mapping | None = None,
        render_mode: str | None = None,
        **overrides: Any,
    ):
        prepare()
        given = {} if residual is None else to_dict(residual)
        self.residual = build(self.scales_class, given, "residual")
        self._moved = np.flatnonzero(list(self.residual.entries().values()))
        if self.only_targets and len(self._moved) == 0 and self.residual.torque == 0.0:
            raise ConfigError("at least one scale must be above 0", field="residual")
        super().__init__(robot, config, render_mode=render_mode, **overrides)
        lag = build(Lag, to_dict({"smoothing": smoothing, "gate": gate}), "environment")
        self.smoothing, self.gate = lag.smoothing, lag.gate
        momentum = 10.0 * self.scales.momentum  # m h² ω
        limit, period = np.array(self.robot.torque_limit), self.config.policy_period
        self._residual = make_residual(self.residual, lag, period, momentum, limit)
        self._offsets = self._residual.offsets
        self._push_force = push_force(self.robot.omega)
        with allowing(named(controller)):  # the user hands it over, not a file
            self.controller = self._known = load_controller(controller, self.robot)
        self._stand_in: Controller | None = None  # where state and robot are uncertain
        self.tempo = build(Tempo, {} if tempo is None else to_dict(tempo), "tempo")
        self.motion = load_motion(motion, self.robot)
        self.targets = Targets.standing(self.robot, self.simulation.state)
        self._targets = self.targets.arrays()

    @property
    def motion(self) -> ReferenceMotion:
        """The reference; may be replaced between episodes.

        Raises ConfigError for one of another robot, and for one whose feet leave the ground where
        the controller keeps them planted.
        """
        return self._reference

    @motion.setter
    def motion(self, motion: ReferenceMotion) -> None:
        self._reference = load_motion(motion, self.robot)
        tempo = self.tempo if self._reference.moves else Tempo()
        self._motion = motion_arrays(self._reference, tempo, self.robot.height_com)
        self._hand_over_motion()
        self._unbind()

    def _hand_over_motion(self) -> None:
        """Tell a controller that performs motions with steps which one it is to be."""
        decides = self._base.unwrapped
        self._handed = decides, self._motion
        if isinstance(decides, ClipWalker):
            walked = self._reference.commands is not None and not self._reference.free_arms
            decides.take_clip(walked and self._keeps_arms)
        if isinstance(decides, Performer):
            decides.perform(self._reference, self._motion.pace)
        elif self._reference.footing is not None:
            raise ConfigError(
                f"the feet of {self._reference.name!r} leave the ground, which "
                f"{controller_kind(decides)} cannot perform", source="environment", field="motion",
                choices=performing_controllers(),
            )  # fmt: skip

    @property
    def motion_time(self) -> float:
        """Time of the motion now; that since the reset unless it waits [s]."""
        pace = self._motion.pace
        return pace.time if pace.waits else self.simulation.time

    def arguments(self) -> dict[str, Any]:
        """The arguments that make another environment like this one; robot and motion are shared.

        Raises ConfigError for a controller that cannot be rebuilt: its memory cannot be shared.
        """
        given = self._known if self._controller is self._stand_in else self._controller
        return {
            **super().arguments(),
            "controller": as_base_controller(given, self.robot).another(),
            "motion": self.motion,
            "residual": self.residual,
            "smoothing": self.smoothing,
            "gate": self.gate,
            "tempo": self.tempo,
        }

    def _action_names(self) -> tuple[str, ...]:
        names = list(self.residual.entries())
        motors = self.robot.motor_names if self.residual.torque > 0.0 else ()
        return (*(names[i] for i in self._moved), *motors)

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        names, targets = self.action_names, len(self._moved)
        terms = [action_term(name) for name in names[:targets]]
        if self.residual.torque > 0.0:
            terms.append(Term("motors", names[targets:], "1", "", "motors"))
        return mirror_terms(terms, parts)

    def _readings(self, kind: type[Block]) -> tuple[Any, ...]:
        if kind is ForceView:
            return (self._push_force,)
        return (self._motion,) if kind is MotionView else super()._readings(kind)

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self._targets.q_ref, self._targets.v_ref

    def stand_in(self, level: Realism) -> str | None:
        """Return the controller that runs in place of the named one at a level, or None.

        It is the one that the named controller's `uncertain` names. Where it runs in an episode,
        `info["stand_in"]` names it.
        """
        config = getattr(self._known, "config", None)
        if config is not None and is_replaced(config, level):
            return str(config.uncertain)
        return None

    def info(self) -> dict[str, Any]:
        """The entries of `BalanceEnv`, and the controller that runs in place of the named one."""
        info = super().info()
        if self._controller is self._stand_in:
            info["stand_in"] = self.stand_in(self.realism)
        return info

    def _suit_level(self) -> None:
        """Choose the controller for this realism level, see `where_uncertain`."""
        if not any(self._controller is own for own in (self._known, self._stand_in)):
            return  # a user has put another one in its place
        wanted = self._known
        config = getattr(wanted, "config", None)
        if is_replaced(config, self.realism):
            if self._stand_in is None:
                other = where_uncertain(config)
                assert other is not None  # as it is replaced
                self._stand_in = load_controller(other, self.robot)
            wanted = self._stand_in
        if wanted is not self._controller:
            self.controller = wanted

    def _begin(self, options: Mapping[str, Any]) -> None:
        self._suit_level()
        if self._handed[0] is not self._base.unwrapped or self._handed[1] is not self._motion:
            self._hand_over_motion()
            self._unbind()
        self.controller.reset(self.state_source.state)
        if "command" not in options and self.motion.commands is not None:
            options = {**options, "command": command_options(self.motion.commands)}
        self._begin_walk(options)
        self._motion.pace.clear()
        self._offsets.clear()
        self._residual.torques[:] = 0.0
        forget_pushes(self._push_force)
        set_targets(self._target_inputs())

    def _target_inputs(self) -> TargetInputs:
        if self._inputs is None:
            source = self.state_source
            self._inputs = TargetInputs(
                robot=source.arrays,
                state=source.state_arrays,
                clock=self.simulation.clock,
                motion=self._motion,
                com_offset=self._com_offset,
                residual=self._residual,
                push=self._push_force,
                observes_push=any(term.view is ForceView for term in self.terms),
                period=float(self._base.period),
                targets=self._targets,
            )
        return self._inputs


vector_env = partial(make_vector_env, ResidualBalanceEnv)  # for gymnasium.make_vec
