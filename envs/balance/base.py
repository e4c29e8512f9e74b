"""The base of all environments: a pushed robot, its observation, reward, fall and record."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from poise.configs.errors import PoiseError
from poise.configs.numbers import real_array, seed_number, whole_steps
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Program, run
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.pushes.push import PushInfo, push_info
from poise.envs.physics.simulation import Simulation, World
from poise.envs.physics.state_source import StateSource
from poise.envs.robots.mirror import Mirror, mirror_robot
from poise.envs.robots.robot import Robot, load_robot, on_terrain
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.measurement import Rings
from poise.envs.sensing.sensed import SensedRobot
from poise.envs.viewing.camera import Camera
from poise.envs.viewing.rendered import RenderedEnv

from .action import checked_action, take_action
from .config import EnvConfig as EnvConfig
from .config import env_config
from .episode import (
    EpisodeArrays,
    Judge,
    Metrics,
    StepEnd,
    begin_episode,
)
from .mdp.docstrings import filled
from .mdp.interleaving import interleave, interleaving, kept_frames
from .mdp.observation import Term, Terms, View, frames, mirror_terms, observer, scales
from .mdp.reward import REWARD_TERMS, RewardView, rewards
from .mdp.termination import episode_limits
from .mdp.terms import TERMS
from .servos import holding_torques
from .start import RESET_OPTIONS, chosen_pushes, chosen_start, reset_options


class BalanceEnv(SensedRobot, RenderedEnv):
    """Base of `ResidualBalanceEnv` and `TorqueBalanceEnv`: subclasses say what an action does."""

    observation_space: spaces.Box
    action_space: spaces.Box
    _spec: EnvSpec | None = None
    known_terms: ClassVar[Terms] = TERMS  #: of which `observation` chooses
    #: the blocks of terms that can be of the true state
    true_views: ClassVar[tuple[type[Block], ...]] = (View,)
    option_names: ClassVar[tuple[str, ...]] = RESET_OPTIONS  #: of `reset`

    def __init_subclass__(cls, **arguments: object) -> None:
        super().__init_subclass__(**arguments)
        cls.__doc__ = filled(cls.__doc__, cls.known_terms)

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        camera: Camera | Mapping[str, object] | str | int | None = None,
        **overrides: object,
    ):
        self.config = env_config(config, **overrides)
        known = robot if isinstance(robot, Robot) else load_robot(robot)
        self.robot = on_terrain(known, self.config.terrain)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.config.policy_period)}
        self._set_up_rendering(self.robot.model, render_mode, width, height, camera)
        self.estimator, self.physics = self.config.estimator, self.config.physics
        self.push_sampler = self.config.pushes  #: may be replaced between episodes
        if self.push_sampler is not None:
            self.push_sampler.check_limits()
        self.simulation = Simulation(self.robot)
        self.arrays: RobotArrays = self.simulation.arrays  #: of `robot`
        self.realism = self.config.realism
        period = self.config.policy_period
        timestep = self.arrays.timestep
        self.substeps = whole_steps(period, timestep, "policy_period", "environment")
        self.max_steps = round(self.config.duration / period)
        self.quiet_steps = int(np.ceil(self.config.fall.quiet_time / period - 1e-9))
        state = self.simulation.state
        self.scales = scales(self.arrays, state.support_polygon)
        self.limits = episode_limits(
            self.config.fall, self.robot.height_com, self.max_steps, self.quiet_steps
        )
        self.action_names = self._action_names()
        names, chosen = self._entry_names(), self.config.observation
        kinds = self.known_terms.choose(chosen.terms, chosen.extra)
        self._newest = [kind.of(names) for kind in kinds]
        self._privileged = self.terms_by_name(chosen.privileged)
        seen = frames(self._newest, chosen.history)
        #: of which the observation is made
        self.terms = [*seen, *(replace(t, name=f"true_{t.name}") for t in self._privileged)]
        size = sum(term.size for term in self.terms)
        #: entries of the policy's observation; the others are privileged
        self.seen = sum(term.size for term in seen)
        sizes = {"na": len(self.action_names), "no": size, "terms": len(REWARD_TERMS)}
        frame = sum(term.size for term in self._newest)
        sizes["past"] = frame * kept_frames(chosen.history, chosen.history_stride)
        self.episode = EpisodeArrays.allocate(
            sizes | self.simulation.sizes, metrics=Metrics.allocate()
        )
        self.observation_space = spaces.Box(-10.0, 10.0, (size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.action_names),), np.float32)
        self._described: tuple[object, list[PushInfo]] = None, []  # pushes, their infos

    @property
    def steps(self) -> int:
        """Policy steps since the reset."""
        return int(self.episode.steps)

    @property
    def episode(self) -> EpisodeArrays:
        """The record of the running episode; other arrays may take its place."""
        return self._episode

    @episode.setter
    def episode(self, episode: EpisodeArrays) -> None:
        self._episode = episode
        self._unbind()

    @cached_property
    def _holding(self) -> np.ndarray:
        return holding_torques(self.robot)

    def _unbind(self) -> None:
        """Forget the blocks that compiled code works on: what they are made of has changed."""
        self._step: CompiledStep | None = None  # of a policy step
        self._end: StepEnd | None = None
        self._end_of: World | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` made it from, with the steps of its episodes; None without that."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        # not registered with a number: Gymnasium would cut off those that are made longer
        self._spec = spec and replace(spec, max_episode_steps=self.max_steps)

    def arguments(self) -> dict[str, Any]:
        """The arguments that make another environment like this one; the robot is shared."""
        names = ("robot", "config", "render_mode", "width", "height", "camera")
        return {name: vars(self)[name] for name in names}

    def _action_names(self) -> tuple[str, ...]:
        """The names of the action's entries."""
        raise NotImplementedError

    def terms_by_name(self, chosen: Sequence[str]) -> list[Term]:
        """Terms of the true robot in its true state, as `observation.privileged` names them.

        Raises ConfigError for a name that is unknown, or comes twice.
        """
        names = self._entry_names()
        known = self.known_terms.items()
        true = Terms({name: kind for name, kind in known if kind.view in self.true_views})
        return [kind.of(names) for kind in true.choose(chosen, field="privileged")]

    def _entry_names(self) -> dict[str, tuple[str, ...]]:
        return {
            "joints": self.robot.joint_names,
            "motors": self.robot.motor_names,
            "feet": tuple(sole.name for sole in self.robot.soles),
            "actions": self.action_names,
        }

    def _view(self, source: StateSource | Simulation, kind: type[Block], out: np.ndarray) -> Block:
        """The block of a term that fills `out`, of the `kind` that its kernel works on.

        It reads the robot and the state of `source`: the estimated ones, or the true ones.
        """
        world, block = self.simulation.world(), cast(Any, kind)
        q_ref, v_ref = self._references()
        seen = View(
            robot=source.arrays,
            state=source.state_arrays,
            scales=self.scales,
            q_ref=q_ref,
            v_ref=v_ref,
            action=self.episode.action,
            views=world.views,
            clock=world.clock,
            pushes=world.pushes,
            out=out,
        )
        return seen if kind is View else block(seen, *self._readings(kind))

    def _readings(self, kind: type[Block]) -> tuple[Any, ...]:
        """Return the members that a block of this `kind` adds to `View`, as a `MeasuredView`."""
        source = self.state_source
        if isinstance(source, EstimatedState):
            return source.sensors.rings, source.estimation.memory_of("sense"), False
        return Rings.allocate(self.simulation.sizes), 0, True

    def _judge(self) -> Judge:
        """The block that judges the policy steps of this environment."""
        world, e = self.simulation.world(), self.episode
        known: dict[str, Any] = {"robot": world.robot, "state": world.state, "views": world.views}
        view = RewardView(
            **known,
            scales=self.scales,
            limits=self.limits,
            q_ref=self._references()[0],
            action=e.action,
            last_action=e.last_action,
            velocity_error=self._velocity_error(),
            command=self._commanded(),
        )
        return Judge(
            **known,
            clock=world.clock,
            limits=self.limits,
            rewards=rewards(self.config.reward, view),
            episode=e,
        )

    def step_end(self) -> StepEnd:
        """The block that ends a policy step; a new one when `simulation.world()` is."""
        world = self.simulation.world()
        if self._end is None or self._end_of is not world:
            e = self.episode
            seen, true = e.observation[: self.seen], e.observation[self.seen :]
            steps, estimated = e.memory_of("steps"), partial(self._view, self.state_source)
            stride = self.config.observation.history_stride
            calls = observer(self._newest, e.past if stride > 1 else seen, steps, estimated)
            if stride > 1:
                calls += [(interleave, interleaving(self._newest, e.past, seen, stride))]
            if self._privileged:
                known = partial(self._view, self.simulation)
                calls += observer(self._privileged, true, steps, known)
            self._end = StepEnd(self._judge(), self._report(), Program.of(calls))
            self._end_of = world
        return self._end

    def mirrors(self) -> tuple[Mirror, Mirror]:
        """Left and right exchanged, in an observation and in an action.

        Raises ConfigError for a robot that is not its own mirror image.
        """
        parts = mirror_robot(self.robot)
        actions = self._mirror_actions(parts)
        return mirror_terms(self.terms, {**parts, "actions": actions}), actions

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        raise NotImplementedError

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        """Joint positions and velocities (nj,) that the observation is relative to."""
        raise NotImplementedError

    def _velocity_error(self) -> np.ndarray:
        """(3,) how far a walk is from its command, see `RewardView`; here nothing walks."""
        return guarded_zeros(3)

    def _commanded(self) -> np.ndarray:
        """(3,) the commanded velocity, see `RewardView`; here nothing walks."""
        return guarded_zeros(3)

    def _report(self) -> Program:
        """The kernels that follow a judged policy step, before it is observed."""
        return Program.of(())

    def _begin(self, options: Mapping[str, Any]) -> None:
        """Prepare the subclass for a new episode; the simulation has just been reset."""

    def advance(self) -> None:
        """Take the policy step of `episode.action`; the outcome is in `episode`."""
        raise NotImplementedError

    def tick(self) -> None:
        """Play the next control tick of the policy step of `episode.action`; the last one ends it.

        For callers that look between two of them; `advance` plays all that a step has.
        """
        step = self.compiled_step()
        if step is None:
            raise NotImplementedError
        step.play_tick()
        self.check()

    def check(self) -> None:
        """Raise what has gone wrong in the last compiled step: compiled code cannot raise."""
        self.simulation.engine.check()

    def compiled_step(self) -> CompiledStep | None:
        """The compiled form of `advance`, if there is one; the same object while it can be used."""
        return None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode.

        `options`: "push" sets the pushes exactly (a mapping, a list of mappings, [] for none; see
        `parse_pushes`), "noise" scales the start noise, "qpos" (nq,) and "qvel" (nv,) are the
        start itself, "fallen" is the number of a posture on the ground to start from (see
        `fallen_posture`); "realism" fixes fields of the level, a mapping.

        Raises ConfigError naming the option that is unknown or wrong, and what it may be.
        """
        self.episode.running = 0  # until this one has succeeded
        options = reset_options(options, self.option_names)
        super().reset(seed=seed_number(seed))
        rng = self.np_random
        self._draw(options.get("realism"), rng)
        qpos, qvel = chosen_start(
            self.simulation, self.config.noise, self.config.fallen, options, rng
        )
        state = self.simulation.reset(qpos, qvel)
        pushes = chosen_pushes(options.get("push"), self.push_sampler, self.robot, state, rng)
        self.simulation.set_pushes(pushes)
        begin_episode(self.simulation.state_arrays, self.episode)
        self._begin_sensing()
        self._begin(options)
        self._observe()
        if self.render_mode == "human":
            self.render()
        return self.episode.observation.astype(np.float32), self.info()

    def set_action(self, action: np.ndarray) -> None:
        """Check `action`, or clip it where `config.clip_action`; remember it and the one before.

        Raises ConfigError as `check_action` does.
        """
        vector, e = real_array(action), self.episode
        if vector is not None and vector.shape == e.action.shape:
            vector = vector.astype(float)
            if self.config.clip_action:
                vector = np.clip(vector, -1.0, 1.0)
            if take_action(vector, e.last_action, e.action):
                return
        self.check_action(action)  # raises, and names what is wrong

    def check_action(self, action: np.ndarray) -> np.ndarray:
        """Return `action` as numbers, see `checked_action`."""
        return checked_action(action, self.action_names)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take a policy step; a fall is `terminated`, the end of time is `truncated`.

        Raises ConfigError for an action that is not valid, PoiseError after the episode's end.
        """
        reward, terminated, truncated = self.step_without_info(action)
        if self.render_mode == "human":
            self.render()
        observation = self.episode.observation.astype(np.float32)
        return observation, reward, terminated, truncated, self.info()

    def step_without_info(self, action: np.ndarray) -> tuple[float, bool, bool]:
        """Take a step without making `info`: reward, terminated, truncated.

        The observation is in `episode.observation`. Raises as `step` does.
        """
        self.set_action(action)
        return self.apply_action()

    def apply_action(self) -> tuple[float, bool, bool]:
        """Take the step of an action that has been set: reward, terminated, truncated."""
        self.expect_running()
        self.advance()
        terminated = bool(self.episode.metrics.terminated)
        truncated = not (terminated or self.episode.running)
        return float(self.episode.reward), terminated, truncated

    def expect_running(self) -> None:
        """Raises PoiseError if there is no episode that could go on."""
        if not self.episode.running:
            raise PoiseError("step() after the episode's end: call reset() first")

    def _observe(self) -> None:
        """Fill `episode.observation`."""
        run(self.step_end().observe)

    @property
    def fallen(self) -> bool:
        """True after a fall; where a fall does not end the episode, while the robot is down."""
        return bool(self.episode.metrics.fallen)

    @property
    def recovered(self) -> bool:
        """Upright, quiet and with feet at rest for the last `quiet_time` seconds."""
        return bool(self.episode.metrics.quiet_steps >= self.quiet_steps)

    def info(self) -> dict[str, Any]:
        """Reward terms, push and record of the episode so far, and the robot where it is drawn."""
        metrics, terms = self.episode.metrics, self.episode.reward_terms.tolist()
        info = {
            "reward_terms": dict(zip(REWARD_TERMS, terms, strict=True)),
            "push": self.push_infos(),
            "is_success": self.recovered,
            "solver_failures": int(metrics.failures),
            "torque_saturation": metrics.saturated / max(metrics.ticks, 1.0),
            "root_wrench": self.episode.root_wrench.copy(),
        }
        if self.drawn is not None:
            info["realism"] = self.drawn_summary.copy()
        return info

    def push_infos(self) -> list[PushInfo]:
        """The descriptions of the episode's pushes for `info`, see `push_info`."""
        pushes, (known, infos) = self.simulation.pushes, self._described
        if known is not pushes:
            infos = [push_info(push, self.robot) for push in pushes]
            self._described = pushes, infos
        return [info.copy() for info in infos]
