"""One trial: its start, pushes and conditions, and its outcome."""

from dataclasses import dataclass
from typing import Any

from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import raised
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.terrain.terrain import Terrain
from poise.training.benchmarking.diagnosis.diagnosis import Diagnosis


@dataclass(frozen=True)
class Conditions:
    """The difference of a trial's robot from its controller's model."""

    friction: float | None = None  #: of floor and soles; None: the robot's own
    delay: float = 0.0  #: of the sensors [s]
    mass_error: float = 0.0  #: relative error of all masses in the controller's model
    velocity_noise: float = 0.0  #: standard deviation of measured joint velocities [rad/s]
    #: name or file of a realism level, which the other fields override; None: ideal
    realism: str | None = None


STANDARD_CONDITIONS = Conditions()  # the robot as its controller models it


@dataclass(frozen=True)
class Trial:
    """A trial, the same for all controllers."""

    number: int  #: within its suite
    seed: int  #: of the disturbed start
    pushes: tuple[Push, ...] = ()  #: one after the other; none where the robot only stands
    conditions: Conditions = STANDARD_CONDITIONS  #: of robot, ground and sensors
    #: impulse of the only push over its limit (see `PushLimits.scale`), of repeated ones of each
    limit_fraction: float | None = None
    part: str = ""  #: of the suite
    stage: int = 1  #: 2 if it was chosen by the outcome of earlier ones
    #: which factor it varies; "standard" for the case that others are compared with
    factor: str | None = None
    level: str | None = None  #: the factor's value, as text
    #: of a walk, in order of time; empty: the robot stands
    commands: tuple[TimedCommand, ...] = ()
    kicks: tuple[Kick, ...] = ()  #: sudden changes of the root's velocity
    terrain: Terrain | None = None  #: None: that of the environment
    #: reference motion by its name in the suite; None: that of the environment
    motion: str | None = None
    share: float | None = None  #: impulse of the push over the controller's J50
    until: float | None = None  #: when it ends [s]; None: when those of its suite do
    #: number of the posture on the ground that it starts from; None: it starts on its feet
    start: int | None = None
    get_up: float | None = None  #: time after a fall in which the robot may get up again [s]

    @property
    def command(self) -> TimedCommand | None:
        """The last command, or None where the robot only stands."""
        return self.commands[-1] if self.commands else None

    @property
    def push(self) -> Push | None:
        """The first push, or None."""
        return self.pushes[0] if self.pushes else None

    @property
    def judged_by_falls(self) -> bool:
        """Whether it is won by not falling: a walk on level ground."""
        return bool(self.commands) and self.terrain is None

    @property
    def options(self) -> dict[str, Any]:
        """The argument `options` of the environment's `reset`."""
        pushes = {"push": [*self.pushes, *self.kicks]}
        commands = {"command": list(self.commands)} if self.commands else {}
        fallen = {} if self.start is None else {"fallen": self.start}
        return {**pushes, **commands, **fallen}


@dataclass(frozen=True)
class TrialFigures:
    """The figures of a trial. Distances [m], times [s]; None without such a value, or
    where the simulation has diverged.

    Of a walk only strides (two steps) count that begin at least 4 s after the last change of the
    command and end at least 1 s before a fall, and the steps that end them.
    """

    #: upright, quiet and with feet at rest for the last second; of a walk that goes on, not fallen,
    #: and in the last two strides as commanded again, see `Walk.as_commanded`; on a terrain, not
    #: fallen and beyond its last edge; where a motion is performed, not fallen; from a
    #: start on the ground, up for the last second
    recovered: bool
    fallen: bool
    fall_time: float | None = None  #: from the reset
    #: from the start of the last push to the last moment that was not quiet
    recovery_time: float | None = None
    #: a foot moved more than 5 cm; the column `stepped` of trials.csv
    foot_displaced: bool = False
    #: touchdowns after a swing of 0.08 s or more; of a controller that plans its steps, or keeps
    #: its feet fixed, only planned ones
    steps: int = 0
    max_com: float | None = None  #: largest distance of the CoM from the soles' centre
    max_capture: float | None = None  #: the same of the capture point
    min_cop_margin: float | None = None  #: smallest distance of the CoP from the support's edge
    max_slide: float | None = None  #: largest distance of a sole from where it started
    energy: float | None = None  #: ∫ Σ |τ q̇| dt [J]
    peak_torque: float | None = None  #: largest |τ| over its limit
    saturation: float = 0.0  #: fraction of motors and ticks at the limit
    mean_power: float | None = None  #: ∫ Σ |τ q̇| dt over the duration of the trial [W]
    #: Σ |τ_k − τ_k−1| / τ_max over the control ticks k, mean over the motors, over the duration of
    #: the trial [1/s]. A torque that goes from one limit to the other and back once a second has
    #: 4; chattering torques have more
    torque_variation: float | None = None
    solver_failures: int = 0  #: ticks at which the QP was not solved
    mean_abs_action: float | None = None  #: mean |action| after the first second
    #: without a push, largest horizontal distance of the CoM from where it was after the first
    #: second
    com_drift: float | None = None
    foot_drift: float | None = None  #: the same of a sole
    final_speed: float | None = None  #: |ċ| at the end [m/s]
    final_lean: float | None = None  #: of the root from the described posture at the end [°]
    #: largest external force [N] of a soft root; 0 with a hard root
    root_force: float | None = None
    #: body sway [rad] of a recovered push, see `training/benchmarking/statistics/eurobench.py`
    sway: float | None = None
    sway_recovery: float | None = None  #: recovery time by the sway's speed
    speed_ahead: float | None = None  #: mean over the strides of a walk [m/s]
    speed_left: float | None = None  #: the same
    turn_rate: float | None = None  #: the same [rad/s]
    #: mean over the strides of the distance of their velocity from the command [m/s]
    speed_error: float | None = None
    speed_error_rms: float | None = None  #: its root mean square
    turn_error_rms: float | None = None  #: root mean square of the turn's error [rad/s]
    #: mean over the steps, of a sole that lands from the other one, along the heading
    step_length: float | None = None
    step_width: float | None = None  #: the same across the heading
    step_time: float | None = None  #: between touchdowns, mean over the steps
    swing_time: float | None = None  #: from lift-off to touchdown, mean over the steps
    #: of the sole's middle at its highest above where it lands, mean over the steps
    step_clearance: float | None = None
    #: largest deviation of a step parameter from its command, as a fraction, among those that are
    #: commanded: step time, step length, width, clearance. A step time is that from touchdown to
    #: touchdown but for the gait's time on both feet
    step_error: float | None = None
    #: root mean square of the angular momentum about the vertical [N·m·s]
    yaw_momentum: float | None = None
    cost_of_transport: float | None = None  #: ∫ Σ |τ q̇| dt / (m g d), d the way
    positive_cost_of_transport: float | None = None  #: of the work Σ max(τ q̇, 0) alone
    #: mean |τ|/m of the stance leg's knee on one foot, at the ends of policy steps [N·m/kg]
    knee_mean: float | None = None
    knee_peak: float | None = None  #: the largest
    #: of a single circular command, largest distance of the walk from that circle around the walk's
    #: own centre
    circle_error: float | None = None
    foot_slide: float | None = None  #: largest displacement of a sole in single support
    #: phase of the stride at the start of the first push or kick: 0 where the left foot lands, 0.5
    #: where the right one does
    push_phase: float | None = None
    #: of a pushed walk, largest error of a stride's velocity before the first push or kick, else
    #: without it, see `Walk.own_error` [m/s]
    own_speed_error: float | None = None
    own_turn_error: float | None = None  #: the same of the turn rate [rad/s]
    #: distance of the last two strides' mean velocity from the command [m/s]; None after a fall
    last_speed_error: float | None = None
    last_turn_error: float | None = None  #: the same of the turn rate [rad/s]
    edge_contacts: int = 0  #: new contacts of a foot with an edge of the terrain
    #: of a terrain, of which the CoM has passed the beginning; stairs climbed
    surfaces_passed: int | None = None
    #: from here to `interruptions`: of a motion that is performed, see `TrackingFigures`
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
    #: whether a robot that fell, or began on the ground, was up again for a second at the end: the
    #: root within 30° of standing, the CoM at 0.8 of its height, only the feet on the ground
    up_again: bool | None = None
    up_time: float | None = None  #: from the fall, or the start on the ground, until it was up
    #: parameters of a randomised robot as JSON, see `DrawnRobot.summary`
    randomised: str | None = None
    #: exception of the controller on one line; the trial then counts as not recovered
    error: str | None = None

    @property
    def upright(self) -> bool:
        """Not fallen, and the controller has not raised."""
        return not self.fallen and self.error is None


@dataclass(frozen=True)
class Outcome(Diagnosis, TrialFigures):
    """The outcome of a trial: its figures and, if it was lost, the diagnosis.

    Bases are listed from the last field to the first, as dataclasses collect them.
    """


#: older name → name of fields of `Outcome`, which are columns of trials.csv (`respelled`)
FORMER = {
    "full_motor": "saturated_motor",
    "full_from": "saturated_from",
    "full_time": "saturated_time",
    "drawn": "randomised",
}


def counts_as_won(trial: Trial, outcome: Outcome) -> bool:
    """Return whether a trial counts as won in J50, rankings and pairs: a walk on level ground
    without a fall, any other trial recovered."""
    return outcome.upright if trial.judged_by_falls else outcome.recovered


def failed_trial(error: Exception) -> Outcome:
    """Return the outcome of a trial in which the controller raised."""
    return Outcome(recovered=False, fallen=False, error=raised(error), loss="error")
