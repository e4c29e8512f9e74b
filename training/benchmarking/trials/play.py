"""Run one trial: its outcome depends bit for bit on the trial and the agent alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any, Protocol

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.environments.commanded import CommandedEnv
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.extras import load_extra
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.pushes.push import Kick, Push
from poise.training.benchmarking.diagnosis.diagnosis import Diagnosis, diagnose
from poise.training.benchmarking.diagnosis.record import CourseRecord, swing_of

from .agents import Agent
from .gait_figures import NO_ERROR, SWING_TIME, RecordedWalk, TrackingError, near
from .gait_record import WalkRecord
from .rising import Rise, Rising
from .signals import Sway
from .trial import Outcome, Trial

FOOT_DISPLACED = 0.05  # [m]
TINY = 1e-9  # [s]
SETTLED = 1.0  # [s] after which actions and drift count
Watch = Callable[[BalanceEnv], object]  # called after the reset and after every step


class TracksMotion(Protocol):
    """The record of a performed motion, which `poise[motion]` makes.

    Attributes:
        fallen: whether the robot fell, for what the motion does at that time.
        ended: whether the trial is over.
    """

    fallen: bool

    @property
    def ended(self) -> bool: ...

    def update(self) -> None:
        """Record a policy step."""

    def figures(self) -> Any:
        """Return the fields of `Outcome` that are of motions, as a dataclass."""


class SteppedTrial:
    """A trial that begins on construction and is advanced step by step.

    Attributes:
        done: whether it has ended, by a fall or by time.
        tracking: the record of the motion that the trial performs, or None.
    """

    def __init__(self, agent: Agent, trial: Trial):
        self._agent, self._trial, self.done, env = agent, trial, False, agent.env
        until, period = trial.until, env.config.policy_period
        self._steps = env.max_steps if until is None else round(until / period)
        self._observation, _ = env.reset(seed=trial.seed, options=trial.options)
        if agent.begin is not None:
            agent.begin()
        self.tracking: TracksMotion | None = None
        if trial.motion is not None and isinstance(env, ResidualBalanceEnv):
            tracking = load_extra("motions", "tracking", f"the motion {trial.motion!r}")
            self.tracking = tracking(env, [push.start for push in trial.pushes])

    def step(self) -> np.ndarray:
        """Take a policy step; returns its action (na,). Raises what the controller raises."""
        env, action = self._agent.env, self._agent.act(self._observation)
        _, terminated, truncated = env.step_without_info(action)
        self._observation = env.episode.observation.astype(np.float32)
        self.done = terminated or truncated or env.steps >= self._steps
        self.done |= env.fallen and self._trial.start is None
        if self.tracking is not None:
            self.tracking.update()
            self.done |= self.tracking.ended
        return action

    def rise(self, duration: float) -> Rise:
        """Continue for `duration` [s] with a fallen robot, at most until it is up again."""
        env, rising = self._agent.env, Rising(self._agent.env)
        for _ in range(round(duration / env.config.policy_period)):
            if not env.episode.running or rising.held:
                break
            self.step()
            rising.update()
        return rising.outcome()


def run_trial(agent: Agent, trial: Trial, watch: Watch | None = None) -> Outcome:
    """Run a trial to its end in the agent's environment."""
    env, stepped = agent.env, SteppedTrial(agent, trial)
    if trial.start is not None:
        return rise_trial(env, trial, stepped, watch)
    settled, course = Settled(), CourseRecord()
    touchdowns = TouchdownCounter(len(env.robot.soles), env.config.policy_period)
    stands = not trial.commands and stepped.tracking is None
    sway = Sway() if trial.pushes and stands else None
    walk = WalkRecord() if trial.commands else None
    watches = [each for each in (course, sway, walk, watch) if each is not None]
    while not stepped.done:
        for each in watches:
            each(env)
        action = stepped.step()
        touchdowns.update(env.simulation.state.contacts, swing_of(env))
        settled.update(env, action)
    for each in watches:
        each(env)
    outcome, loss = _outcome(env, trial, settled, touchdowns.count), "not quiet"
    if walk is not None:
        outcome, loss = walk_outcome(env, trial, outcome, walk), "off command"
        if left_command(trial, outcome) and outcome.own_speed_error is None:
            return against_unpushed(agent, trial, explained(env, trial, outcome, course, loss))
    elif stepped.tracking is not None:
        outcome, loss = followed(env, outcome, stepped.tracking), "motion"
    elif sway is not None and outcome.recovered:
        body, recovery = sway.of(trial.pushes[0], env.config.policy_period)
        outcome = replace(outcome, sway=body, sway_recovery=recovery)
    if outcome.recovered:
        return outcome
    outcome = explained(env, trial, outcome, course, loss)
    if trial.get_up and env.fallen and env.episode.running:
        return replace(outcome, **asdict(stepped.rise(trial.get_up)))
    return outcome


def explained(
    env: BalanceEnv, trial: Trial, outcome: Outcome, course: CourseRecord, loss: str
) -> Outcome:
    """Return the outcome of a lost trial with its diagnosis; `loss` is the criterion without a
    fall."""
    start = first_start(trial) or 0.0
    return replace(outcome, **asdict(diagnose(env, course.course(), start, loss)))


def rise_trial(
    env: BalanceEnv, trial: Trial, stepped: SteppedTrial, watch: Watch | None
) -> Outcome:
    """Return the outcome of a trial that starts on the ground: `recovered` is to be up at its
    end."""
    rising, settled = Rising(env), Settled()
    touchdowns = TouchdownCounter(len(env.robot.soles), env.config.policy_period)
    while not stepped.done:
        if watch is not None:
            watch(env)
        action = stepped.step()
        rising.update()
        touchdowns.update(env.simulation.state.contacts)
        settled.update(env, action)
    if watch is not None:
        watch(env)
    rise = rising.outcome()
    outcome = _outcome(env, trial, settled, touchdowns.count)
    return replace(
        outcome,
        **asdict(rise),
        recovered=rise.up_again,
        loss=None if rise.up_again else "down",
        recovery_time=None,
        com_drift=None,
        foot_drift=None,
    )


def first_start(trial: Trial) -> float | None:
    """When the first push or kick begins [s]; None without one."""
    events: list[Push | Kick] = [*trial.pushes, *trial.kicks]
    return min((each.start for each in events), default=None)


def walk_outcome(env: BalanceEnv, trial: Trial, outcome: Outcome, record: WalkRecord) -> Outcome:
    """Return the outcome of a trial with commands, with the figures of its walk.

    Where it is to walk at the end, `recovered` is to have not fallen and to walk as commanded
    again, as near to the command as before the push (`Walk.as_commanded`), on a terrain to be
    beyond its last edge; it then has no recovery time and no drift.
    """
    assert isinstance(env, CommandedEnv)  # it has taken the commands
    walk = RecordedWalk(
        record.arrays(), trial.commands, outcome.fall_time, env.transfer_time or 0.0
    )
    figures: dict[str, Any] = {
        name: None if value is None else _finite(value) for name, value in walk.figures().items()
    }
    weight = env.robot.mass * float(np.linalg.norm(env.model.opt.gravity))
    for name, per_metre in (
        ("cost_of_transport", "energy_per_metre"),
        ("positive_cost_of_transport", "work_per_metre"),
    ):
        cost = figures.pop(per_metre)
        figures[name] = None if cost is None else cost / weight
    first = first_start(trial)
    left = int(np.argmax(foot_signs(env.robot)))
    phase = None if first is None else walk.phase_at(first, left)
    outcome = replace(
        outcome, **figures, push_phase=phase, com_drift=None, foot_drift=None, recovery_time=None
    )
    terrain = env.simulation.robot.terrain
    if not terrain.flat:
        last, passed = len(terrain.surfaces()) - 1, outcome.surfaces_passed
        outcome = replace(outcome, recovered=not env.fallen and passed == last)
    elif trial.commands[-1].array()[:3].any():
        own = None if first is None else walk.own_error(first)
        end = None if env.fallen else walk.last_error()
        recovered = end is not None and near(end, own or NO_ERROR)
        outcome = replace(outcome, recovered=recovered, **_errors("own", own),
                          **_errors("last", end))  # fmt: skip
    return outcome


def _errors(whose: str, error: TrackingError | None) -> dict[str, Any]:
    """Return the figures of an outcome that say how far a walk is from its command."""
    speed, turn = (None, None) if error is None else map(_finite, error)
    return {f"{whose}_speed_error": speed, f"{whose}_turn_error": turn}


def left_command(trial: Trial, outcome: Outcome) -> bool:
    """Return whether a pushed walk did not fall but does not follow its command."""
    pushed = first_start(trial) is not None
    return pushed and outcome.last_speed_error is not None and not outcome.recovered


def against_unpushed(agent: Agent, trial: Trial, outcome: Outcome) -> Outcome:
    """Return the outcome of a walk without a settled stride before its push.

    It is compared with the same trial without the push, which runs in addition.
    """
    assert outcome.last_speed_error is not None and outcome.last_turn_error is not None
    last = TrackingError(outcome.last_speed_error, outcome.last_turn_error)
    env, record = agent.env, WalkRecord()
    stepped = SteppedTrial(agent, replace(trial, pushes=(), kicks=()))
    record(env)
    while not stepped.done:
        stepped.step()
        record(env)
    fell = env.simulation.time if env.fallen else None
    own = RecordedWalk(record.arrays(), trial.commands, fell).own_error()
    outcome = replace(outcome, **_errors("own", own))
    if own is not None and near(last, own):
        outcome = replace(outcome, recovered=True, **asdict(Diagnosis()))
    return outcome


def followed(env: BalanceEnv, outcome: Outcome, tracking: TracksMotion) -> Outcome:
    """Return the outcome of a trial that performs a motion: `recovered` is to have not fallen."""
    figures: dict[str, Any] = {
        name: _finite(value) for name, value in asdict(tracking.figures()).items()
    }
    fallen, time = tracking.fallen, env.simulation.time
    return replace(
        outcome, **figures, fallen=fallen, fall_time=time if fallen else None,
        recovered=not fallen, recovery_time=None, com_drift=None, foot_drift=None,
    )  # fmt: skip


def _outcome(env: BalanceEnv, trial: Trial, settled: Settled, touchdowns: int) -> Outcome:
    """Return the outcome recorded by the environment."""
    m = env.episode.metrics
    recovered = env.recovered and not env.fallen
    pushed = max((push.start for push in trial.pushes), default=0.0)
    return Outcome(
        recovered=recovered,
        fallen=env.fallen,
        fall_time=env.simulation.time if env.fallen else None,
        recovery_time=max(float(m.last_moving) - pushed, 0.0) if recovered else None,
        foot_displaced=bool(m.max_slide > FOOT_DISPLACED),
        steps=touchdowns,
        max_com=_finite(m.max_com),
        max_capture=_finite(m.max_capture),
        min_cop_margin=_finite(m.min_cop_margin),
        max_slide=_finite(m.max_slide),
        energy=_finite(m.energy),
        peak_torque=_finite(m.peak_torque),
        saturation=float(m.saturated / max(m.ticks, 1.0)),
        mean_power=_finite(m.energy / max(m.torque_time, TINY)),
        torque_variation=_finite(m.torque_variation / max(m.torque_time, TINY)),
        solver_failures=int(m.failures),
        mean_abs_action=settled.actions / settled.steps if settled.steps else None,
        com_drift=_finite(settled.drift) if settled.steps and not trial.pushes else None,
        foot_drift=_finite(settled.foot_drift) if settled.steps and not trial.pushes else None,
        final_speed=_finite(float(np.linalg.norm(env.simulation.state.com_vel))),
        final_lean=_finite(tilt_of(env)),
        root_force=_finite(m.root_force),
        edge_contacts=int(m.edge_contacts),
        surfaces_passed=surfaces_passed(env),
        randomised=randomised_robot(env),
    )


def randomised_robot(env: BalanceEnv) -> str | None:
    """Return the parameters of the episode's randomised robot as JSON; None without any."""
    return None if env.drawn is None else json.dumps(env.drawn.summary(env.arrays.timestep))


def surfaces_passed(env: BalanceEnv) -> int | None:
    """Return the surfaces of the terrain, without the start's, of which the CoM has passed the
    beginning; None on level ground."""
    surfaces, com = env.simulation.robot.terrain.surfaces(), env.simulation.state.com
    return sum(bool(com[0] > each.x_min) for each in surfaces[1:]) if surfaces else None


def tilt_of(env: BalanceEnv) -> float:
    """Return the tilt of the root from the standing posture [°], independent of yaw."""
    standing = env.simulation.arrays.root_standing[2]
    cosine = float(env.simulation.state.root_axes[2] @ standing)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


class Settled:
    """Actions and the drift of the CoM and of the feet after the first second.

    Attributes:
        steps: policy steps after it.
        actions: sum of their mean |action|.
        drift: largest horizontal distance of the CoM from where it was then [m].
        foot_drift: the same of a sole.
    """

    def __init__(self) -> None:
        self.actions, self.steps, self.drift, self.foot_drift = 0.0, 0, 0.0, 0.0
        self._start: np.ndarray | None = None

    def update(self, env: BalanceEnv, action: np.ndarray) -> None:
        """Call it after every step."""
        state = env.simulation.state
        places = np.vstack([state.com[:2], state.sole_points[:, :2]])
        if env.steps == round(SETTLED / env.config.policy_period):
            self._start = places
        elif self._start is not None:
            self.actions += float(np.mean(np.abs(action)))
            self.steps += 1
            ways = np.linalg.norm(places - self._start, axis=1)
            self.drift = max(self.drift, float(ways[0]))
            self.foot_drift = max(self.foot_drift, float(ways[1:].max()))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


class TouchdownCounter:
    """Count touchdowns after a swing of at least `SWING_TIME`.

    Where the controller has a plan, only its planned steps count.

    Args:
        feet: number of feet.
        period: seconds between two calls of `update`.
    """

    def __init__(self, feet: int, period: float):
        self.count = 0
        self._least = max(round(SWING_TIME / period), 1)
        self._swing = np.zeros(feet, dtype=int)  # updates in a row without contact
        self._planned = np.zeros(feet, dtype=bool)  # whether the foot swung by plan in these

    def update(self, contacts: np.ndarray, swinging: int | None = None) -> None:
        """Take (feet,) 1 where a foot touches the ground, else 0, and `swing_of` the controller."""
        down = contacts > 0.5
        swung = swinging is None or np.arange(len(down)) == swinging
        self._planned |= ~down & swung
        self.count += int(np.sum(down & self._planned & (self._swing >= self._least)))
        self._planned &= ~down
        self._swing = np.where(down, 0, self._swing + 1)
