"""One trial of the benchmark: a start, a push, and what became of it."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from poise.envs.balance import episode
from poise.envs.balance.base import BalanceEnv
from poise.envs.pushes.push import Push

from .players import Player

STEP_LENGTH = 0.05  # [m] a foot that moves further has stepped, or slid as far
SETTLED = 1.0  # [s] after which actions and drift count


@dataclass(frozen=True)
class Trial:
    """What every controller meets alike.

    Attributes:
        number: of the trial within its evaluation.
        seed: of the disturbed start.
        push: the push, or the first one; None for none.
        limit_fraction: impulse over the limit of the suite (see `PushLimits.scale`).
        stage: of suites that choose trials by the outcome of earlier ones.
        later: further pushes.
    """

    number: int
    seed: int
    push: Push | None = None
    limit_fraction: float | None = None
    stage: int = 1
    later: tuple[Push, ...] = ()

    @property
    def options(self) -> dict[str, Any]:
        """For the environment's `reset`."""
        return {"push": [] if self.push is None else [self.push, *self.later]}


@dataclass(frozen=True)
class Outcome:
    """What became of a trial. Distances [m], times [s]; None where there is no such value, or
    where a simulation has blown up.

    Attributes:
        recovered: upright and quiet for the last second.
        fallen: whether it fell; `fall_time` counts from the reset.
        recovery_time: from the start of the last push to the last moment that was not quiet.
        stepped: a foot moved more than 5 cm.
        steps: touchdowns of feet that were in the air for 0.08 s.
        max_com, max_capture: largest distance of CoM and capture point from the soles' centre.
        min_cop_margin: smallest distance of the CoP from the edge of the support.
        max_slide: largest distance of a sole from where it started.
        energy: ∫ Σ |τ q̇| dt [J].
        peak_torque: largest |τ| over its limit.
        saturation: share of motors and ticks at the limit.
        solver_failures: ticks at which the QP was not solved.
        mean_abs_action: mean |action| after the first second.
        com_drift: without a push, largest horizontal distance of the CoM from where it was after
            the first second.
        final_speed: |ċ| at the end [m/s].
        root_force: largest force [N] that a soft root took from nowhere; 0 with a hard root.
    """

    recovered: bool
    fallen: bool
    fall_time: float | None
    recovery_time: float | None
    stepped: bool
    steps: int
    max_com: float | None
    max_capture: float | None
    min_cop_margin: float | None
    max_slide: float | None
    energy: float | None
    peak_torque: float | None
    saturation: float
    solver_failures: int
    mean_abs_action: float | None
    com_drift: float | None
    final_speed: float | None
    root_force: float | None


OUTCOMES = tuple(Outcome.__dataclass_fields__)
PUSH_COLUMNS = (
    *("body", "start", "duration", "impulse", "direction", "elevation"),
    *("point_x", "point_y", "point_z", "profile"),
)
COLUMNS = (
    "trial",
    "controller",
    "seed",
    "stage",
    *PUSH_COLUMNS,
    "limit_fraction",
    "later",
    *OUTCOMES,
)


def run_trial(
    player: Player, trial: Trial, watch: Callable[[BalanceEnv], Any] | None = None
) -> Outcome:
    """Play a trial to its end; `watch(env)` is called after the reset and after every step."""
    env = player.env
    observation, _ = env.reset(seed=trial.seed, options=trial.options)
    if player.begin is not None:
        player.begin()
    state = env.simulation.state  # its arrays follow the simulation
    settled = round(SETTLED / env.config.policy_period)
    actions, steps, drift = 0.0, 0, 0.0
    touchdowns = Touchdowns(len(state.contacts), env.config.policy_period)
    start: np.ndarray | None = None
    done = False
    while not done:
        if watch is not None:
            watch(env)
        action = player.act(observation)
        _, terminated, truncated = env.step_without_info(action)
        observation = env.episode.observation.astype(np.float32)
        done = terminated or truncated
        touchdowns.update(state.contacts)
        if env.steps == settled:
            start = state.com[:2].copy()
        elif start is not None:
            actions += float(np.mean(np.abs(action)))
            steps += 1
            drift = max(drift, float(np.linalg.norm(state.com[:2] - start)))
    if watch is not None:
        watch(env)
    return Outcome(
        mean_abs_action=actions / steps if steps else None,
        steps=touchdowns.count,
        com_drift=_finite(drift) if steps and trial.push is None else None,
        **_record(env, trial),
    )


def _record(env: BalanceEnv, trial: Trial) -> dict[str, Any]:
    """What the environment has recorded about the episode."""
    m = env.episode.metrics
    recovered = env.recovered and not env.fallen
    pushed = max((push.start for push in trial.options["push"]), default=0.0)
    return {
        "recovered": recovered,
        "fallen": env.fallen,
        "fall_time": env.simulation.time if env.fallen else None,
        "recovery_time": max(float(m[episode.LAST_MOVING]) - pushed, 0.0) if recovered else None,
        "stepped": bool(m[episode.MAX_SLIDE] > STEP_LENGTH),
        "max_com": _finite(m[episode.MAX_COM]),
        "max_capture": _finite(m[episode.MAX_CAPTURE]),
        "min_cop_margin": _finite(m[episode.MIN_COP_MARGIN]),
        "max_slide": _finite(m[episode.MAX_SLIDE]),
        "energy": _finite(m[episode.ENERGY]),
        "peak_torque": _finite(m[episode.PEAK_TORQUE]),
        "saturation": float(m[episode.SATURATED] / max(m[episode.TICKS], 1.0)),
        "solver_failures": int(m[episode.FAILURES]),
        "final_speed": _finite(float(np.linalg.norm(env.simulation.state.com_vel))),
        "root_force": _finite(m[episode.ROOT_FORCE]),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def row(trial: Trial, controller: str, outcome: Outcome) -> dict[str, Any]:
    """A line of trials.csv; numbers are written so that they read back exactly."""
    line: dict[str, Any] = dict.fromkeys(PUSH_COLUMNS)
    if trial.push is not None:
        push = asdict(trial.push)
        push.update(zip(("point_x", "point_y", "point_z"), push.pop("point"), strict=True))
        line.update(push)
    return {
        "trial": trial.number,
        "controller": controller,
        "seed": trial.seed,
        "stage": trial.stage,
        **line,
        "limit_fraction": trial.limit_fraction,
        "later": json.dumps([asdict(push) for push in trial.later]) if trial.later else None,
        **asdict(outcome),
    }


AIR_TIME = 0.08  # [s] off the ground, below which a foot has only rocked or bounced


class Touchdowns:
    """Counts touchdowns of feet that were in the air for at least `AIR_TIME`.

    Args:
        feet: number of feet.
        period: seconds between two calls of `update`.
    """

    def __init__(self, feet: int, period: float):
        self.count = 0
        self._least = max(round(AIR_TIME / period), 1)
        self._air = np.zeros(feet, dtype=int)  # updates in a row without contact

    def update(self, contacts: np.ndarray) -> None:
        """(feet,) 1 where a foot touches the ground, else 0."""
        down = contacts > 0.5
        self.count += int(np.sum(down & (self._air >= self._least)))
        self._air = np.where(down, 0, self._air + 1)
