"""The N-step limit of a linear inverted pendulum: an upper bound of what steps recover."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import cast

import numpy as np

from poise.baselines.balance.stepping.controller import SteppingController
from poise.baselines.balance.stepping.planning.config import StepLimits
from poise.baselines.balance.stepping.planning.cop_region import cop_region
from poise.baselines.controller import as_base_controller
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.compiled.maths.pendulum import capture_distance, duration_factor
from poise.envs.compiled.maths.polygons import ray_to_edge
from poise.training.running.summary import Curves, Direction, EnvelopeFigures, StepCurves

from .agents import Agent
from .push_limits import PushLimits
from .trial import Outcome

STEPPING = 0.1  # fraction of recoveries with a step, from which a controller is one that steps
COUNTS: dict[str, float] = {"1": 1, "2": 2, "inf": np.inf}  # steps, by their name in summary.json
DRAWN = {"1": "one-step limit", "2": "two-step limit"}
ROOM = 2.5  # times all else in a plot: what lies further out is cut off


class NStepLimit:
    """J = m ω d_N · J(T)/J(0), d_N = r + l a (1 − a^N)/(1 − a), a = e^(−ω T_s) [Koolen12].

    In each direction: r is how far the CoP can be brought from the CoM, by both soles with the
    torques of their ankles; l how far a foot gets in one step of the shortest time T_s, by
    `steps`. An upper bound: it ignores collisions of the legs and the CoM's height.
    """

    def __init__(self, limits: PushLimits, steps: StepLimits | None = None):
        self.limits, self.steps = limits, steps or StepLimits()
        standing = limits.standing
        region = cop_region(limits.robot, 1.0).both(standing.sole_points, standing.heading_yaw)
        self._region = region - standing.com[:2]

    @property
    def time(self) -> float:
        """T_s [s]."""
        return self.steps.time_min / self.limits.omega

    def reach(self, direction: float) -> float:
        """r [m], `direction` in degrees."""
        return ray_to_edge(self._region, np.zeros(2), _unit(direction))

    def length(self, direction: float) -> float:
        """l [m], `direction` in degrees: within the box and the speeds of `steps`."""
        steps, (x, y) = self.steps, np.abs(_unit(direction))
        forward = steps.ahead if np.cos(np.radians(direction)) >= 0.0 else steps.behind
        box = min(forward / max(x, 1e-9), steps.width_max / max(y, 1e-9))
        fast = steps.time_min / np.hypot(x / steps.speed, y / steps.side_speed)
        return float(min(box, fast) * self.limits.robot.height_com)

    def __call__(self, direction: float, duration: float, count: float) -> float:
        """J [N·s] of a square push of `duration` that `count` steps can stop."""
        omega, mass = self.limits.omega, self.limits.robot.mass
        r, length = self.reach(direction), self.length(direction)
        d = capture_distance(count, r, length, omega, self.time)
        return mass * omega * d * duration_factor(omega, duration)

    def add_to(self, figures: EnvelopeFigures, duration: float) -> None:
        """Complete the figures of an envelope.

        Each of its `directions` gets r, l and T_s, the limits of `COUNTS` and the fraction of each
        that J50 is; the envelope gets the fractions' means over all directions.
        """
        for entry in figures["directions"]:
            angle = entry["direction"]
            entry["step_reach"], entry["step_length"] = self.reach(angle), self.length(angle)
            entry["step_time"] = self.time
            limits = {f"step_limit_{n}": self(angle, duration, c) for n, c in COUNTS.items()}
            found = {f"step_share_{n}": entry["j50"] / limits[f"step_limit_{n}"] for n in COUNTS}
            entry.update(cast(Direction, limits | found))
        entries = cast(list[dict[str, float]], figures["directions"])
        fractions = {name: [entry[f"step_share_{name}"] for entry in entries] for name in COUNTS}
        means = {f"step_share_{name}_mean": float(np.mean(fractions[name])) for name in COUNTS}
        figures.update(cast(EnvelopeFigures, means))


def stepping_limits(
    agents: Iterable[Agent], outcomes: Mapping[str, Sequence[Outcome]], limits: PushLimits
) -> dict[str, NStepLimit]:
    """Return the N-step limit of every controller that steps, by what its planner allows.

    Those without a planner come last. They count as controllers that step if they did in more than
    a tenth of their recoveries; the defaults of `StepLimits` then stand for their own. A foot that
    tilts and lands where it was is no step: `momentum-qp` does that near its limit.
    """
    if len(limits.robot.soles) != 2:
        return {}
    planned, others = {}, {}
    for agent in agents:
        own = _own_limits(agent)
        stepped = [o.foot_displaced and o.steps > 0 for o in outcomes[agent.name] if o.recovered]
        if own is not None:
            planned[agent.name] = NStepLimit(limits, own)
        elif stepped and np.mean(stepped) > STEPPING:
            others[agent.name] = NStepLimit(limits)
    return planned | others


def _own_limits(agent: Agent) -> StepLimits | None:
    env = agent.env
    if not isinstance(env, ResidualBalanceEnv):
        return None
    controller = as_base_controller(env.controller, env.robot).unwrapped
    return controller.step_limits if isinstance(controller, SteppingController) else None


def groups(steps: Mapping[str, NStepLimit]) -> dict[StepLimits, list[str]]:
    """Return step limits → controllers with these limits."""
    found: dict[StepLimits, list[str]] = {}
    for name, limit in steps.items():
        found.setdefault(limit.steps, []).append(name)
    return found


def curves(steps: Mapping[str, NStepLimit], duration: float) -> list[StepCurves]:
    """For summary.json: limits around the robot [N·s], one entry for each of the `groups`."""
    fine = [float(angle) for angle in range(0, 360, 5)]
    return [
        {
            "controllers": names,
            "steps": asdict(own),
            "curves": cast(
                Curves,
                {"directions": fine}
                | {
                    name: [steps[names[0]](angle, duration, count) for angle in fine]
                    for name, count in COUNTS.items()
                },
            ),
        }
        for own, names in groups(steps).items()
    ]


def line_name(name: str, whose: Sequence[Sequence[str]]) -> str:
    """Return the name of a line of a plot, with its controller where step limits differ."""
    return DRAWN[name] + (f" of {whose[0][0]}" if len(whose) > 1 else "")


def shown_out_to(top: float, limits: Iterable[float]) -> float:
    """Return the range of a plot that shows values up to `top`, and limits within `ROOM`."""
    return max(top, min(max(limits, default=0.0), ROOM * top))


def _unit(direction: float) -> np.ndarray:
    angle = np.radians(direction)
    return np.array([np.cos(angle), np.sin(angle)])
