"""One trial: a start, the pushes, the conditions that they meet, and what became of it."""

from dataclasses import dataclass
from typing import Any

from poise.baselines.walking.schedule import TimedCommand
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.terrain.terrain import Terrain
from poise.training.benchmarking.diagnosis.diagnosis import Diagnosis


@dataclass(frozen=True)
class Conditions:
    """The difference of a trial's robot from the one that its controller knows.

    Attributes:
        friction: of floor and soles; None: the robot's own.
        delay: of the sensors [s].
        mass_error: by which all masses differ from those that the controller knows.
        velocity_noise: standard deviation of measured joint velocities [rad/s].
        realism: name or file of a level, in which the other fields have the last word; None: ideal.
    """

    friction: float | None = None
    delay: float = 0.0
    mass_error: float = 0.0
    velocity_noise: float = 0.0
    realism: str | None = None


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
        commands: that a controller that walks follows, in the order of time; none: it stands.
        kicks: sudden changes of the root's velocity.
        terrain: that it is played on; None: that of the environment.
        motion: that is performed, by its name in the suite; None: that of the environment.
        share: of the controller's J50 that the push is.
        until: when it ends [s]; None: when those of its suite do.
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
    commands: tuple[TimedCommand, ...] = ()
    kicks: tuple[Kick, ...] = ()
    terrain: Terrain | None = None
    motion: str | None = None
    share: float | None = None
    until: float | None = None

    @property
    def command(self) -> TimedCommand | None:
        """The last command, or None where the robot only stands."""
        return self.commands[-1] if self.commands else None

    @property
    def push(self) -> Push | None:
        """The first push, or None."""
        return self.pushes[0] if self.pushes else None

    @property
    def options(self) -> dict[str, Any]:
        """The argument `options` of the environment's `reset`."""
        pushes = {"push": [*self.pushes, *self.kicks]}
        return {**pushes, "command": list(self.commands)} if self.commands else pushes


@dataclass(frozen=True)
class TrialFigures:
    """The figures of a trial. Distances [m], times [s]; None where there is no such value, or
    where a simulation has blown up.

    Attributes:
        recovered: upright, quiet and with feet at rest for the last second; of a walk that goes on,
            not fallen, and in the last two strides as commanded, see `Walk.as_commanded`; on a
            terrain, not fallen and beyond its last edge; where a motion is performed, not fallen.
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
        mean_power: ∫ Σ |τ q̇| dt over the time that was played [W].
        torque_variation: Σ |τ_k − τ_k−1| / τ_max over the control ticks k, mean over the motors,
            over the time that was played [1/s]. A torque that goes from one limit to the other and
            back once a second has 4; one that hums has more.
        solver_failures: ticks at which the QP was not solved.
        mean_abs_action: mean |action| after the first second.
        com_drift: without a push, largest horizontal distance of the CoM from where it was after
            the first second.
        foot_drift: the same of a sole.
        final_speed: |ċ| at the end [m/s].
        final_lean: of the root from the described posture at the end [°].
        root_force: largest force [N] that a soft root took from nowhere; 0 with a hard root.
        sway, sway_recovery: body sway [rad] and recovery time by the sway's speed, of a recovered
            push, see `training/benchmarking/statistics/eurobench.py`.
        speed_ahead, speed_left, turn_rate: means over the strides of a walk [m/s, rad/s]. A stride
            is two steps; those count, for this and what follows, that begin 4 s or more after the
            last change of the command and end a second or more before a fall.
        speed_error, speed_error_rms: mean and root mean square over the strides of the distance
            of their velocity from the command [m/s].
        turn_error_rms: root mean square over the strides of the turn's error [rad/s].
        step_length, step_width, step_time: means over the steps [m, m, s], of a sole that lands
            from the other one, along the heading and across it, and between touchdowns.
        swing_time, step_clearance: from lift-off to touchdown [s]; of the sole's middle at its
            highest above where it lands [m]; means over the steps.
        step_error: largest deviation of a step parameter from its command, as a fraction, among
            those that are commanded: step time, step length, width, clearance. A step time is
            that from touchdown to touchdown but for the gait's time on both feet.
        yaw_momentum: root mean square of the angular momentum about the vertical [N·m·s].
        cost_of_transport: ∫ Σ |τ q̇| dt / (m g d), d the way; `positive_cost_of_transport` of the
            work Σ max(τ q̇, 0) alone.
        knee_mean, knee_peak: |τ|/m of the stance leg's knee on one foot [N·m/kg], at the ends of
            policy steps.
        circle_error: of one command that is a circle, largest distance of the walk from it, around
            the middle that the walk goes round.
        foot_slide: largest way of a sole that bears the robot alone.
        push_phase: phase of the stride at the start of the first push or kick: 0 where the left
            foot lands, 0.5 where the right one does.
        edge_contacts: times that a foot came to touch an edge of the terrain.
        surfaces_passed: of a terrain, of which the CoM has passed the beginning; stairs climbed.
        joint_rms, body_error, body_error_root, body_error_last, com_error, sole_slide,
            motion_delay, swing_error, placement_error, support_slide, interruptions: of a motion
            that is performed, see `TrackingFigures`.
        drawn: of a robot that is drawn, its numbers as JSON, see `DrawnRobot.summary`.
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
    mean_power: float | None = None
    torque_variation: float | None = None
    solver_failures: int = 0
    mean_abs_action: float | None = None
    com_drift: float | None = None
    foot_drift: float | None = None
    final_speed: float | None = None
    final_lean: float | None = None
    root_force: float | None = None
    sway: float | None = None
    sway_recovery: float | None = None
    speed_ahead: float | None = None
    speed_left: float | None = None
    turn_rate: float | None = None
    speed_error: float | None = None
    speed_error_rms: float | None = None
    turn_error_rms: float | None = None
    step_length: float | None = None
    step_width: float | None = None
    step_time: float | None = None
    swing_time: float | None = None
    step_clearance: float | None = None
    step_error: float | None = None
    yaw_momentum: float | None = None
    cost_of_transport: float | None = None
    positive_cost_of_transport: float | None = None
    knee_mean: float | None = None
    knee_peak: float | None = None
    circle_error: float | None = None
    foot_slide: float | None = None
    push_phase: float | None = None
    edge_contacts: int = 0
    surfaces_passed: int | None = None
    joint_rms: float | None = None
    body_error: float | None = None
    body_error_root: float | None = None
    body_error_last: float | None = None
    com_error: float | None = None
    sole_slide: float | None = None
    motion_delay: float | None = None
    swing_error: float | None = None
    placement_error: float | None = None
    support_slide: float | None = None
    interruptions: float | None = None
    drawn: str | None = None
    error: str | None = None


@dataclass(frozen=True)
class Outcome(Diagnosis, TrialFigures):
    """The outcome of a trial: its figures, then why it was lost, of which a recovered one has none.

    Bases are listed from the last field to the first, as dataclasses collect them.
    """


def failed(error: Exception) -> Outcome:
    """The outcome of a trial in which the controller raised."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return Outcome(recovered=False, fallen=False, error=text, loss="error")
