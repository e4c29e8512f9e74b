"""Trials in which a tracker, an external policy, follows a clip; it may be pushed."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.motion.config import NETWORK, MotionConfig
from poise.baselines.policy_files.motion.track import MotionTrack
from poise.baselines.policy_files.observations import tracks_motion
from poise.baselines.policy_files.reading import is_policy
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import whole_number
from poise.configs.problems import out_of_range
from poise.envs.balance.mdp.termination import FallLimits
from poise.envs.physics.engines.config import load_physics
from poise.envs.physics.engines.engine import check_engine
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.trials.agents import follows_no_motion
from poise.training.benchmarking.trials.jobs import ANYWHERE, LONGEST
from poise.training.benchmarking.trials.play import Watch
from poise.training.benchmarking.trials.trial import Trial
from poise.training.motion.tracking.record import AFTER, COUNTED, LAST, SETTLING
from poise.training.motion.tracking.steps import NONE

from .follow import PUSH_TIME, Followed

START_NOISE = 0.02  # [rad] of each joint of a start
CLIPS = (".npz", ".csv")


def tracker_config(controller: str) -> PolicyFileConfig | None:
    """Return the configuration of a tracker; None for a controller that is no external policy.

    Raises ConfigError as `controller_config`, and for an external policy that tracks no motion.
    """
    yaml = Path(controller).suffix in (".yaml", ".yml")
    if not (is_policy(controller) or yaml):
        return None
    config = controller_config(controller)
    if not isinstance(config, PolicyFileConfig):
        return None
    if not tracks_motion(config):
        raise follows_no_motion(controller)
    return config


def following(config: PolicyFileConfig, motion: str | Path) -> PolicyFileConfig:
    """The tracker that plays a clip from a trial's begin on; "network": the one in its network.

    Raises ConfigError for what is no file of a clip.
    """
    if motion != NETWORK and Path(motion).suffix not in CLIPS:
        raise ConfigError(f"a tracker follows a file of a clip, not {shown(str(motion))}",
                          field="motion", choices=(*CLIPS, NETWORK))  # fmt: skip
    own = config.motion or MotionConfig()
    clip = NETWORK if motion == NETWORK else str(Path(motion).resolve())
    return replace(config, motion=replace(own, clip=clip, plays=True))


def follow_clip(
    config: PolicyFileConfig,
    robot: Robot,
    *,
    starts: int = 20,
    pushed: Callable[[float], float] | None = None,
    directions: int = 8,
    seed: int = 0,
    watch: Callable[[Trial], Watch | None] | None = None,
    realism: str | Path | None = None,
    physics: str | Path | None = None,
) -> list[Followed]:
    """Let a tracker follow its clip from `starts` disturbed starts in the clip's first frame.

    The clip lies where the robot stands at first, and faces as it does. A fall is a CoM below 0.6
    of the clip's height at that time, or a root that leans 90° away from the clip's. A trial goes
    on for 3 s after the clip's end, at its last frame, and for 6 s after the push. Errors count
    until half a second after the end, or a fall.

    Args:
        pushed: the impulse [N·s] of a push in a direction [deg], as in `follow`; None: none.
        watch: as in `follow`.
        physics: the engine, by name or file; None: MuJoCo.

    Raises ConfigError as `PolicyFile`, for an engine that is not installed or does not hold the
    robot, for counts below 1, a seed or an impulse below 0.
    """
    for name, count in (("starts", starts), ("directions", directions)):
        whole_number(count, 1, name)
    whole_number(seed, 0, "seed")
    level: dict[str, Any] = {} if realism is None else {"realism": load_realism(realism)}
    engine = load_physics(physics)
    check_engine(engine, robot)
    env = ResidualBalanceEnv(
        robot, controller=config, pushes=None, duration=LONGEST, fall=ANYWHERE, physics=engine,
        **level,
    )  # fmt: skip
    policy = env.controller
    assert isinstance(policy, PolicyFile) and policy.motion is not None
    track, rng, trials = policy.motion, np.random.default_rng(seed), []
    for k in range(starts):
        start = float(rng.uniform(0.1, 0.9)) * track.course.clip.duration
        direction = 360.0 * k / directions % 360.0
        size = 0.0 if pushed is None else pushed(direction)
        if not 0.0 <= size < np.inf:
            raise out_of_range(size, field="impulse", least=0, form="g")
        push = Push(push_bodies(robot)[0], start, PUSH_TIME, size, direction)
        trial = Trial(k, seed + k, (push,) if size else ())
        trials.append(_followed(env, track, trial, None if watch is None else watch(trial)))
    return trials


def _followed(
    env: ResidualBalanceEnv, track: MotionTrack, trial: Trial, watch: Watch | None
) -> Followed:
    rows, fallen = [], False
    push = trial.pushes[0] if trial.pushes else None
    period = env.config.policy_period
    ends = track.course.clip.duration
    until = max(ends + AFTER, 0.0 if push is None else push.start + SETTLING)
    pushes = [] if push is None else [asdict(push)]
    start = _start(env, track, trial.seed)
    env.reset(seed=trial.seed, options={"push": pushes, "qpos": start})
    reference, rest = ClipReference(env.robot, track), np.zeros(len(env.action_names))
    if watch is not None:
        watch(env)
    while not fallen and env.simulation.time < until - 0.5 * period:
        env.step_without_info(rest)
        if watch is not None:
            watch(env)
        step = round(env.simulation.time / period)
        fallen = env.fallen or reference.lies(env, step)
        if not fallen:
            rows.append(reference.errors(env, step))
    counted = np.array(rows[: max(1, round((ends + COUNTED) / period))]).reshape(-1, 4)
    last = np.array(rows[-round(LAST / period) :]).reshape(-1, 4)
    if not len(counted):
        counted = last = np.full((1, 4), np.nan)
    squares, bodies, root, com = (float(each) for each in counted.mean(axis=0))
    return Followed(
        **asdict(NONE), joint_rms=float(np.sqrt(squares)), body_error=bodies,
        body_error_root=root, body_error_last=float(last[:, 1].mean()), com_error=com,
        sole_slide=np.nan, motion_delay=0.0, fallen=bool(fallen), solver_failures=0,
        push=None if push is None else asdict(push),
    )  # fmt: skip


def _start(env: ResidualBalanceEnv, track: MotionTrack, seed: int) -> np.ndarray:
    """Return (nq,) the clip's first frame, its joints disturbed, with no sole below the ground."""
    qpos = track.course.clip.qpos[0].copy()
    qpos[7:] += np.random.default_rng((seed, 1)).normal(0.0, START_NOISE, len(qpos) - 7)
    data = mujoco.MjData(env.robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(env.robot.model, data)
    qpos[2] -= min(float(sole_pose(data, sole)[0][2]) for sole in env.robot.soles)
    return qpos


class ClipReference:
    """Joints, bodies and CoM of a clip where it has been laid."""

    def __init__(self, robot: Robot, track: MotionTrack):
        self._track, self._robot, self._data = track, robot, mujoco.MjData(robot.model)
        model = robot.model
        moving = model.body_weldid == np.arange(model.nbody)
        moving[0] = False
        self._bodies = np.flatnonzero(moving)
        self._root = int(np.searchsorted(self._bodies, robot.root_body_id))

    def _at(self, step: int) -> mujoco.MjData:
        data, model = self._data, self._robot.model
        data.qpos[:] = self._track.qpos(min(step, len(self._track.course.clip.qpos) - 1))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        return data

    def errors(self, env: ResidualBalanceEnv, step: int) -> tuple[float, float, float, float]:
        """As `tracking_errors`: joints squared, bodies, these relative to the root, and the CoM."""
        there, here = self._at(step), env.simulation.data
        gap = here.xpos[self._bodies] - there.xpos[self._bodies]
        return (
            float(np.mean((here.qpos[7:] - there.qpos[7:]) ** 2)),
            float(np.linalg.norm(gap, axis=1).mean()),
            float(np.linalg.norm(gap - gap[self._root], axis=1).mean()),
            float(np.linalg.norm(env.simulation.state.com - there.subtree_com[0])),
        )

    def lies(self, env: ResidualBalanceEnv, step: int) -> bool:
        """Return whether the CoM is too low, or the root leans too far, for the clip."""
        there, state, limits = self._at(step), env.simulation.state, FallLimits()
        wanted = there.xmat[self._robot.root_body_id].reshape(3, 3)
        low = state.com[2] - state.origin[2] < limits.height * there.subtree_com[0, 2]
        leaning = state.root_axes[2] @ wanted[2] < np.cos(np.radians(limits.tilt))
        return bool(low or leaning)
