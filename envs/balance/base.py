"""What all environments share: a pushed robot, its observation, reward, fall and record."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.numbers import (
    finite_array,
    option_mapping,
    real_array,
    seed_number,
    whole_number,
)
from poise.envs.compiled.calls import CompiledStep
from poise.envs.compiled.copies import Copyable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.simulation import Simulation
from poise.envs.pushes.options import parse_pushes
from poise.envs.pushes.push import push_info
from poise.envs.robots.mirror import Mirror, mirror_robot
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.viewing.camera import Camera, find_camera

from .config import EnvConfig as EnvConfig
from .config import env_config
from .episode import (
    FAILURES,
    FALLEN,
    QUIET_STEPS,
    REWARD_TERMS,
    SATURATED,
    TICKS,
    EpisodeArrays,
    allocate_episode,
    begin_episode,
    judge,
)
from .observation import Term, mirror_terms, observation_terms, observe, scales

if TYPE_CHECKING:
    from poise.envs.viewing.renderer import SceneRenderer

RESET_OPTIONS = ("push", "noise", "qpos", "qvel")


class BalanceEnv(Copyable, gymnasium.Env):
    """Base of `ResidualBalanceEnv` and `TorqueBalanceEnv`: subclasses say what an action does."""

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012
    observation_space: spaces.Box
    action_space: spaces.Box

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        camera: Camera | Mapping[str, Any] | str | int | None = None,
        **overrides: Any,
    ):
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(
                f"unknown render mode {shown(render_mode)}",
                field="render_mode",
                choices=tuple(self.metadata["render_modes"]),
            )
        self.render_mode = render_mode
        self.robot = robot if isinstance(robot, Robot) else load_robot(robot)
        self.config = env_config(config, **overrides)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.config.policy_period)}
        self.width = whole_number(width, 1, "width", "environment")  #: of a frame [pixels]
        self.height = whole_number(height, 1, "height", "environment")
        self.camera = find_camera(camera, self.robot.model)
        self.push_sampler = self.config.pushes  #: may be replaced between episodes
        self.simulation = Simulation(self.robot)
        self.arrays: RobotArrays = self.simulation.arrays
        period = self.config.policy_period
        self.substeps = self._whole(period, self.arrays.timestep, "policy_period")
        self.max_steps = round(self.config.duration / period)
        self.quiet_steps = int(np.ceil(self.config.fall.quiet_time / period - 1e-9))
        state = self.simulation.state
        self.scales = scales(self.arrays, state.support_polygon)
        self.judge = judge(
            self.config.fall, self.config.reward, self.robot.height_com, self.max_steps
        )
        self.action_names = self._action_names()
        soles = [sole.name for sole in self.robot.soles]
        self.terms = self._observation_terms(soles)
        size = sum(term.size for term in self.terms)
        self.episode = allocate_episode(len(self.action_names), size, len(soles))
        self.observation_space = spaces.Box(-10.0, 10.0, (size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.action_names),), np.float32)
        self._described: tuple[Any, list[dict[str, Any]]] = None, []  # pushes, their infos
        self._renderer: SceneRenderer | None = None

    def __getstate__(self) -> dict[str, Any]:
        if self._renderer is not None and self._renderer.viewer is not None:
            raise PoiseError("an environment whose window is open cannot be copied: close() first")
        return {**super().__getstate__(), "_renderer": None}  # the copy draws with one of its own

    @property
    def steps(self) -> int:
        """Policy steps since the reset."""
        return int(self.episode.steps[0])

    @property
    def simulation(self) -> Simulation:
        """The robot and its world; may be replaced between episodes."""
        return self._simulation

    @simulation.setter
    def simulation(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._step: Any = None  # what compiled code is bound to, with the simulation of before

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, for reading: environments of one robot share it."""
        return self.simulation.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of this environment, current after `reset` and after every `step`."""
        return self.simulation.data

    def arguments(self) -> dict[str, Any]:
        """What makes another environment like this one; the robot is shared."""
        names = ("robot", "config", "render_mode", "width", "height", "camera")
        return {name: vars(self)[name] for name in names}

    @staticmethod
    def _whole(period: float, step: float, name: str) -> int:
        count = round(period / step)
        if count < 1 or abs(count * step - period) > 1e-9:
            raise ConfigError(
                f"{period} s is not a whole number of steps of {step} s",
                source="environment",
                field=name,
            )
        return count

    def _action_names(self) -> tuple[str, ...]:
        """One name for each entry of the action."""
        raise NotImplementedError

    def _observation_terms(self, soles: list[str]) -> list[Term]:
        """Parts of the observation: those that `observe` fills, then a subclass's own."""
        return observation_terms(self.robot.joint_names, soles, self.action_names)

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

    def _begin(self) -> None:
        """Prepare the subclass for a new episode; the simulation has just been reset."""

    def advance(self) -> None:
        """One policy step with `episode.action`: reward, metrics and observation of the record."""
        raise NotImplementedError

    def compiled_step(self) -> CompiledStep | None:
        """What does what `advance` does, if it can be compiled; the same object while it can be
        used again.
        """
        return None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode.

        `options`: "push" sets the pushes exactly (a mapping, a list of mappings, [] for none; see
        `parse_pushes`), "noise" scales the start noise, "qpos" (nq,) and "qvel" (nv,) are the
        start itself.

        Raises ConfigError naming the option that is unknown or wrong, and what it may be.
        """
        self.episode.running[0] = 0  # until this one has succeeded
        options = option_mapping(options)
        super().reset(seed=seed_number(seed))
        for name in options:
            if name not in RESET_OPTIONS:
                raise ConfigError(
                    "unknown option", source="reset", field=str(name), choices=RESET_OPTIONS
                )
        push, qpos, qvel = (options.get(name) for name in ("push", "qpos", "qvel"))
        start, speed = self._start(float(self._numbers(options.get("noise", 1.0), (), "noise")))
        qpos = start if qpos is None else self._numbers(qpos, start.shape, "qpos")
        qvel = speed if qvel is None else self._numbers(qvel, speed.shape, "qvel")
        state = self.simulation.reset(qpos, qvel)
        if push is not None:
            pushes = parse_pushes(push, self.robot, state.support_margin)
        elif self.push_sampler is None:
            pushes = ()
        else:
            pushes = self.push_sampler.sample(self.np_random, self.robot, state.support_margin)
        self.simulation.set_pushes(pushes)
        begin_episode(self.simulation.state_arrays, self.episode)
        self._begin()
        self._observe()
        if self.render_mode == "human":
            self.render()
        return self.episode.observation.astype(np.float32), self.info()

    def _start(self, scale: float) -> tuple[np.ndarray, np.ndarray]:
        """A disturbed standing posture with its lowest sole on the ground."""
        noise, rng, robot = self.config.noise, self.np_random, self.robot
        qpos, qvel = robot.standing_qpos.copy(), np.zeros(robot.model.nv)
        nj = len(robot.joint_names)
        qpos[7:] += scale * rng.uniform(-noise.joints, noise.joints, nj)
        qpos[7:] = np.clip(qpos[7:], robot.joint_range[:, 0], robot.joint_range[:, 1])
        qvel[6:] = scale * rng.uniform(-noise.joint_speeds, noise.joint_speeds, nj)
        qvel[:2] = scale * rng.uniform(-noise.speed, noise.speed, 2)
        state = self.simulation.reset(qpos)
        lowest = min(
            float((point + polygon @ axes[:, :2].T)[:, 2].min())
            for point, axes, polygon in zip(
                state.sole_points, state.sole_axes, (s.polygon for s in robot.soles), strict=True
            )
        )
        qpos[2] -= lowest
        return qpos, qvel

    @staticmethod
    def _numbers(value: Any, shape: tuple[int, ...], name: str) -> np.ndarray:
        numbers = finite_array(value, shape)
        if numbers is None:
            expected = f"{shape[0]} finite numbers" if shape else "a finite number"
            raise ConfigError(f"must be {expected}", source="reset", field=name)
        return numbers

    def set_action(self, action: np.ndarray) -> None:
        """Check `action` and remember it and the one before.

        Raises ConfigError as `check_action` does.
        """
        vector = self.check_action(action)
        self.episode.last_action[:] = self.episode.action
        self.episode.action[:] = np.clip(vector, -1.0, 1.0)

    def check_action(self, action: np.ndarray) -> np.ndarray:
        """`action` as numbers.

        Raises ConfigError naming the entries: all for a wrong shape, else those out of bounds.
        """
        vector = real_array(action)
        names = self.action_names
        if vector is None:
            raise ConfigError(
                f"must be numbers of shape {(len(names),)}, not {shown(action)}: "
                f"{', '.join(names)}",
                field="action",
            )
        if vector.shape != (len(names),):
            raise ConfigError(
                f"has shape {vector.shape}, expected {(len(names),)}: {', '.join(names)}",
                field="action",
            )
        vector = vector.astype(float, copy=False)
        good = np.abs(vector) <= 1.0 + 1e-6  # NaN is not
        if not good.all():
            bad = [f"{names[i]} is {vector[i]:g}" for i in np.flatnonzero(~good)]
            raise ConfigError(f"must lie in [-1, 1], but {', '.join(bad)}", field="action")
        return vector

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One policy step; a fall is `terminated`, the end of time is `truncated`.

        Raises ConfigError for an action that is not valid, PoiseError after the episode's end.
        """
        reward, terminated, truncated = self.step_in_place(action)
        if self.render_mode == "human":
            self.render()
        observation = self.episode.observation.astype(np.float32)
        return observation, reward, terminated, truncated, self.info()

    def step_in_place(self, action: np.ndarray) -> tuple[float, bool, bool]:
        """What `step` does, without `info`: the observation is in `episode.observation`."""
        self.set_action(action)
        return self.apply_action()

    def apply_action(self) -> tuple[float, bool, bool]:
        """What `step_in_place` does with an action that has been set."""
        self.expect_running()
        self.advance()
        terminated = self.fallen
        truncated = not (terminated or self.episode.running[0])
        return float(self.episode.reward[0]), terminated, truncated

    def expect_running(self) -> None:
        """Raises PoiseError if there is no episode that could go on."""
        if not self.episode.running[0]:
            raise PoiseError("step() after the episode's end: call reset() first")

    def _observe(self) -> None:
        q_ref, v_ref = self._references()
        observe(
            self.arrays,
            self.simulation.state_arrays,
            self.scales,
            q_ref,
            v_ref,
            self.episode.action,
            self.episode.observation,
        )

    @property
    def fallen(self) -> bool:
        """Whether the robot has fallen."""
        return bool(self.episode.metrics[FALLEN])

    @property
    def recovered(self) -> bool:
        """Upright and quiet for the last `quiet_time` seconds."""
        return bool(self.episode.metrics[QUIET_STEPS] >= self.quiet_steps)

    def info(self) -> dict[str, Any]:
        """Reward terms, push and record of the episode so far; see also `InfoColumns`."""
        metrics, terms = self.episode.metrics, self.episode.reward_terms.tolist()
        return {
            "reward_terms": dict(zip(REWARD_TERMS, terms, strict=True)),
            "push": self.push_infos(),
            "is_success": self.recovered,
            "solver_failures": int(metrics[FAILURES]),
            "torque_saturation": float(metrics[SATURATED] / max(metrics[TICKS], 1.0)),
            "root_wrench": self.episode.root_wrench.copy(),
        }

    def push_infos(self) -> list[dict[str, Any]]:
        """What `info` says of the episode's pushes, see `push_info`."""
        pushes, (known, infos) = self.simulation.pushes, self._described
        if known is not pushes:
            infos = [push_info(push, self.robot) for push in pushes]
            self._described = pushes, infos
        return [info.copy() for info in infos]

    def render(self) -> np.ndarray | None:
        """A frame (height, width, 3) for "rgb_array"; shows it for "human"."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            from poise.envs.viewing.renderer import SceneRenderer

            self._renderer = SceneRenderer(
                self.simulation, self.render_mode == "human", self.width, self.height, self.camera
            )
        return self._renderer.render()

    def close(self) -> None:
        """Free what rendering holds."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class InfoColumns(Copyable):
    """What `BalanceEnv.info` says of each of `envs`, one array for each key.

    `record` holds their rows. The lists of pushes are the same ones until the next episode.
    """

    def __init__(self, envs: Sequence[BalanceEnv], record: EpisodeArrays):
        self.envs, self.record = envs, record
        self._quiet_steps = np.array([env.quiet_steps for env in envs])
        self._pushes: list[Any] = [None] * len(envs)  # those described
        self._descriptions = np.empty(len(envs), dtype=object)

    def read(self) -> dict[str, Any]:
        """The columns of the last step."""
        record, metrics = self.record, self.record.metrics
        for i, env in enumerate(self.envs):
            pushes = env.simulation.pushes
            if pushes is not self._pushes[i]:
                self._pushes[i], self._descriptions[i] = pushes, env.push_infos()
        return {
            "reward_terms": dict(zip(REWARD_TERMS, record.reward_terms.T.copy(), strict=True)),
            "push": self._descriptions.copy(),
            "is_success": metrics[:, QUIET_STEPS] >= self._quiet_steps,
            "solver_failures": metrics[:, FAILURES].astype(int),
            "torque_saturation": metrics[:, SATURATED] / np.maximum(metrics[:, TICKS], 1.0),
            "root_wrench": record.root_wrench.copy(),
        }
