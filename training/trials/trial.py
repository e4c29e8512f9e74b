"""One trial: a start, the pushes, the conditions that they meet, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass

from poise.envs.pushes.push import Push


@dataclass(frozen=True)
class Conditions:
    """The difference of a trial's robot from the one that its controller knows.

    Attributes:
        friction: of floor and soles; None: the robot's own.
        delay: of the sensors, besides that of the environment itself [s].
        mass_error: by which all masses differ from those that the controller knows.
    """

    friction: float | None = None
    delay: float = 0.0
    mass_error: float = 0.0


STANDARD_CONDITIONS = Conditions()  # the robot as its controller knows it


@dataclass(frozen=True)
class Trial:
    """A trial that controllers meet alike.

    Attributes:
        number: of the trial within its suite.
        seed: of the disturbed start.
        pushes: one after the other; none where the robot only stands.
        conditions: in which it is played.
        limit_fraction: impulse of the only push over its limit (see `PushLimits.scale`), of
            repeated pushes that of each.
        part: of the suite.
        stage: 2 if it was chosen by the outcome of earlier ones.
        factor: which factor the trial varies; "standard" for the case they are compared with.
        level: the factor's value, as text.
    """

    number: int
    seed: int
    pushes: tuple[Push, ...] = ()
    conditions: Conditions = STANDARD_CONDITIONS
    limit_fraction: float | None = None
    part: str = ""
    stage: int = 1
    factor: str | None = None
    level: str | None = None

    @property
    def push(self) -> Push | None:
        """The first push, or None."""
        return self.pushes[0] if self.pushes else None

    @property
    def options(self) -> dict[str, list[Push]]:
        """The argument `options` of the environment's `reset`."""
        return {"push": list(self.pushes)}


@dataclass(frozen=True)
class Outcome:
    """The outcome of a trial. Distances [m], times [s]; None where there is no such value, or
    where a simulation has blown up.

    Attributes:
        recovered: upright, quiet and with feet at rest for the last second.
        fallen: whether it fell; `fall_time` counts from the reset.
        recovery_time: from the start of the last push to the last moment that was not quiet.
        foot_displaced: a foot moved more than 5 cm; the column `stepped` of trials.csv.
        steps: touchdowns of feet that were in the air for 0.08 s.
        max_com, max_capture: largest distance of CoM and capture point from the soles' centre.
        min_cop_margin: smallest distance of the CoP from the edge of the support.
        max_slide: largest distance of a sole from where it started.
        energy: ∫ Σ |τ q̇| dt [J].
        peak_torque: largest |τ| over its limit.
        saturation: fraction of motors and ticks at the limit.
        solver_failures: ticks at which the QP was not solved.
        mean_abs_action: mean |action| after the first second.
        com_drift: without a push, largest horizontal distance of the CoM from where it was after
            the first second.
        foot_drift: the same of a sole.
        final_speed: |ċ| at the end [m/s].
        final_lean: of the root from the described posture at the end [°].
        root_force: largest force [N] that a soft root took from nowhere; 0 with a hard root.
        sway, sway_recovery: body sway [rad] and recovery time by the sway's speed, of a recovered
            push, see `training/statistics/eurobench.py`.
        error: what the controller raised, on one line; the trial then counts as not recovered.
    """

    recovered: bool
    fallen: bool
    fall_time: float | None = None
    recovery_time: float | None = None
    foot_displaced: bool = False
    steps: int = 0
    max_com: float | None = None
    max_capture: float | None = None
    min_cop_margin: float | None = None
    max_slide: float | None = None
    energy: float | None = None
    peak_torque: float | None = None
    saturation: float = 0.0
    solver_failures: int = 0
    mean_abs_action: float | None = None
    com_drift: float | None = None
    foot_drift: float | None = None
    final_speed: float | None = None
    final_lean: float | None = None
    root_force: float | None = None
    sway: float | None = None
    sway_recovery: float | None = None
    error: str | None = None


def failed(error: Exception) -> Outcome:
    """The outcome of a trial in which the controller raised."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return Outcome(recovered=False, fallen=False, error=text)
