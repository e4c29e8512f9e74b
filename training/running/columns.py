"""Names, units, digits and meanings of all figures of a result.

The terminal, the leaderboard (Markdown) and the report (HTML and CSV) use them. `summary.json` and
the CSV files hold the figures in SI units.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from .trial_figures import Interval

NONE = "–"
#: kind of bound, or whether it is a lower bound → sign before the figure
SIGNS = {None: "", "lower": "≥ ", "upper": "≤ ", True: "≥ ", False: ""}
Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Figure:
    """A figure of a result's entries.

    Attributes:
        key: in the entry.
        name, unit: of the heading.
        form: format specification.
        words: meaning.
        scale: factor from SI units to `unit`.
        ends: key of the 95 % interval.
        of: key of the total of a count; the terminal prints "2 of 9".
        beside: key of a second count; the terminal prints "2, 9".
        bound: key of the kind of bound.
        csv: name in the report's CSV files, where it is not `key`.
        where: whether the figure applies to an entry; None: to all.
    """

    key: str
    name: str
    form: str
    unit: str = ""
    words: str = ""
    scale: float = 1.0
    ends: str = ""
    of: str = ""
    beside: str = ""
    bound: str = ""
    csv: str = ""
    where: Callable[[Entry], object] | None = None

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def value(self, entry: Entry) -> float | None:
        """Return the figure in SI units; None where the entry has none."""
        if self.where is not None and not self.where(entry):
            return None
        return cast("float | None", entry.get(self.key))

    def interval(self, entry: Entry) -> Interval | None:
        """Return the 95 % interval in SI units, or None."""
        return cast("Interval | None", entry.get(self.ends)) if self.ends else None

    def sign(self, entry: Entry) -> str:
        """Return ≥ or ≤ of a bound, else an empty text."""
        return SIGNS[entry.get(self.bound)] if self.bound else ""

    def has_range(self, entry: Entry) -> bool:
        """Return whether the interval says anything: not that of a bound, nor one of no width."""
        low, high = self.interval(entry) or (None, None)
        return bool(self.ends) and not self.sign(entry) and (low is None or low != high)

    def text(self, entry: Entry) -> str:
        """Return the figure with sign and interval, as in the terminal; "–" where it is missing."""
        value = self.value(entry)
        if value is None:
            return NONE
        text = f"{self.sign(entry)}{self.scale * value:{self.form}}"
        if not self.ends:
            text += f", {entry[self.beside]}" if self.beside else ""
            return f"{text} of {entry[self.of]}" if self.of else text
        return f"{text} {self.range(entry)}" if self.has_range(entry) else text

    def range(self, entry: Entry) -> str:
        """Return the interval as in the terminal, with "–" for an unknown end."""
        ends = self.interval(entry) or (None, None)
        low, high = (NONE if end is None else f"{self.scale * end:{self.form}}" for end in ends)
        return f"[{low}, {high}]"


def known(figures: Sequence[Figure], entries: Sequence[Entry]) -> list[Figure]:
    """Return the figures that at least one of the entries has."""
    return [each for each in figures if any(each.text(entry) != NONE for entry in entries)]


def _some(key: str, zero: bool = False) -> Callable[[Entry], bool]:
    """Return a test of whether an entry has this figure, other than 0 unless `zero`."""
    return lambda entry: entry.get(key) is not None and (zero or entry[key] != 0)


def _mm(key: str, name: str, words: str, form: str = ".1f") -> Figure:
    return Figure(key, name, form, "mm", words, 1e3)


TRIED = (Figure("trials", "trials", ".0f"),
         Figure("recovered", "won", ".0f", words="recovered; of walks, not fallen"))  # fmt: skip
J50 = Figure("j50", "J50", ".1f", "N·s", "impulse that half of the trials survive",
             ends="j50_ci95", bound="j50_bound")  # fmt: skip

# of a controller
J50_MEAN = Figure("j50_mean", "mean J50", ".1f", "N·s",
                  "impulse that half of the trials survive, mean over directions",
                  ends="j50_mean_ci95", bound="j50_mean_bound")  # fmt: skip
J50_PER_MASS = Figure("j50_mean_per_mass", "J50/m", ".3f", "N·s/kg",
                      "the same over the robot's mass", csv="j50_per_mass")  # fmt: skip
J50_WORST = Figure("j50_min", "worst J50", ".1f", "N·s", "in the worst direction", csv="j50_worst")
J50_BOUNDED = Figure("j50_bounded", "bounds", ".0f", words="directions where J50 is only a bound",
                     csv="j50_bounds", where=_some("j50_bounded"))  # fmt: skip
ETA_MEAN = Figure("eta_mean", "η mean", ".2f", words="J50 over the ankle limit, mean of all",
                  ends="eta_mean_ci95", bound="j50_mean_bound")  # fmt: skip
ETA_WORST = Figure("eta_min", "η worst", ".2f", words="in the worst direction", csv="eta_worst")
#: in units of the suite's limit; each table sets its own unit
J50_SCALED = Figure(
    "fraction50", "J50", ".2f", "limit", "half of the pushes of this size are recovered",
    ends="fraction50_ci95", bound="fraction50_bound",
)  # fmt: skip
RECOVERED = Figure("recovered_rate", "recovered", ".0%", words="fraction of all trials",
                   ends="recovered_ci95")  # fmt: skip
#: of a walk, under the same key: whether the last strides track the command as well as before
AS_COMMANDED = replace(
    RECOVERED,
    name="as commanded again",
    words="fraction of all trials whose "
    "last strides are as near to the command as those before the push",
)
ERRORS = Figure("errors", "errors", ".0f", words="trials in which a controller raised an error",
                where=_some("errors"))  # fmt: skip
FAILURES = Figure("solver_failures", "solver failures", ".0f", words="ticks at which no QP was "
                  "solved", where=_some("solver_failures"))  # fmt: skip
STEPS_TAKEN = Figure("steps_mean", "steps, mean", ".1f", where=_some("steps_mean"))
NOT_FALLEN = Figure("never_fell_rate", "not fallen", ".0%", words="fraction of all trials",
                    ends="never_fell_ci95")  # fmt: skip
UP_AGAIN = (
    Figure(
        "up_again_rate",
        "up again",
        ".0%",
        words="fraction of the robots that were down, by a fall or from the start",
        ends="up_again_ci95",
    ),
    Figure("up_time_median", "time to get up", ".1f", "s", "median"),
)
AT_REST = (
    _mm("com_drift_max", "CoM drift", "largest"),
    _mm("foot_drift_max", "feet drift", "largest"),
    Figure("unpushed_lean_max", "lean at the end", ".2f", "°"),
    # only without pushes, which otherwise dominate these two
    Figure("mean_power_median", "power", ".0f", "W", where=_some("com_drift_max", zero=True)),
    Figure("torque_variation_median", "chatter", ".2f", "1/s",
           where=_some("com_drift_max", zero=True)),
)  # fmt: skip
FAILURES_RECOVERED = Figure("solver_failures_recovered", "of them in recoveries", ".0f",
                            words="in trials that recovered",
                            where=_some("solver_failures"))  # fmt: skip
CHATTER = Figure("torque_variation_median", "chatter", ".1f", "1/s",
                 "change of torques over the motors' limits, of trials without a fall")  # fmt: skip
ROOT = Figure("root_force_max", "root", ".0f", "N",
              "largest external force of a soft root")  # fmt: skip
TICK = Figure("tick_us", "tick", ".0f", "µs", "time of one control tick")
ROBUST = (
    Figure("step_share_1_mean", "of one-step limit", ".2f"),
    FAILURES,
    FAILURES_RECOVERED,
    Figure("mean_abs_action", "mean |action|", ".3f", where=_some("mean_abs_action")),
    ROOT,
    TICK,
)

# of a scenario
SPEED = Figure("speed_ahead", "speed", ".2f", "m/s", "ahead, mean over the strides")
STOOD = replace(NOT_FALLEN, name="stood", words="trials without a fall")

# of training seeds taken together
OVER_SEEDS = (
    replace(J50_MEAN, words="", ends=""),
    Figure("eta", "η", ".2f"),
    Figure("recovered", "recovered", ".1%"),
)

ENERGY = Figure("energy_median", "energy", ".0f", "J", "of trials without a fall")

# of a controller at a realism level
J50_KEPT = Figure("j50_kept", "J50 kept", ".2f", words="over that of the first level",
                  ends="j50_kept_ci95")  # fmt: skip
AT_LEVEL = (
    replace(J50_MEAN, words=""),
    J50_BOUNDED,
    J50_KEPT,
    RECOVERED,
    NOT_FALLEN,
    Figure("stood", "stood", ".0f", words="unpushed, without a fall", of="unpushed"),
    CHATTER,
    ENERGY,
)  # fmt: skip

# of a cause of lost trials
LOSSES = Figure("trials", "losses", ".0f")

# of two controllers, or of a level and the standard case, on the same trials
PAIRED = (
    Figure("both", "both", ".0f", words="recovered by both, of walks not fallen with either"),
    Figure("only_a", "only a (lost)", ".0f", words="lost by b"),
    Figure("only_b", "only b (won)", ".0f", words="won by b"),
    Figure("neither", "neither", ".0f"),
)
AGAINST = (
    Figure(
        "lost",
        "lost",
        ".0f",
        words="trials that only the other one recovers (of walks: does not fall)",
    ),
    Figure("won", "won", ".0f", words="trials that only this one recovers"),
)
LOST_WON = Figure("only_a", "lost, won", ".0f", beside="only_b",
                  words="of the trials common to both")  # fmt: skip
P_VALUE = Figure("p_mcnemar", "McNemar p", ".2g", words="McNemar's exact test of lost against won")
GAIN = Figure("j50_gain", "J50 gain", "+.1%", words="of b over a, relative", ends="j50_gain_ci95")

# of a direction
AIMED = (
    J50,
    Figure("j90", "J90", ".1f", "N·s", ends="j90_ci95"),
    J50_SCALED,
    Figure("ankle_limit", "ankle limit", ".1f", "N·s"),
    Figure("eta", "η", ".2f"),
    *(
        figure
        for key, name in (("1", "1-step limit"), ("2", "2-step limit"), ("inf", "∞-step limit"))
        for figure in (
            Figure(f"step_limit_{key}", name, ".1f", "N·s", "of a pendulum that steps"),
            Figure(f"step_share_{key}", f"J50 / {name}", ".2f", bound="j50_bound"),
        )
    ),
)  # fmt: skip

# EUROBENCH's, of a controller and of a direction
SWAY = (
    Figure("body_sway_mean", "body sway", ".3f", "rad", "mean over recovered standard pushes"),
    Figure("recovery_time_mean", "recovery time", ".2f", "s",
           "until the sway stays below 0.015 rad/s"),
    Figure("recovery_time_trials", "trials at rest", ".0f", words="by this measure"),
)  # fmt: skip
MARGINS = (
    Figure("force", "margin", ".0f", "N", "largest with < 30 % falls in 10 runs",
           bound="largest_tried"),
    Figure("force_normalised", "at human size", ".0f", "N", "normalised", bound="largest_tried"),
    Figure("energy_normalised", "energy", ".1f", "J", "normalised", bound="largest_tried"),
)  # fmt: skip

# of walks and motions
FALLS = (
    TRIED[0],
    Figure("fallen", "fell", ".0f", of="trials"),
    Figure("falls_per_minute", "falls a minute", ".2f", words="Garwood's interval",
           ends="falls_per_minute_ci95"),
    replace(NOT_FALLEN, words="fraction of the trials"),
    replace(AS_COMMANDED, name="as commanded", words="fraction of trials whose last strides are as "
            "near to the command as those before the push; unpushed: within 0.05 m/s and 5 °/s"),
)  # fmt: skip
FOLLOWED = (
    Figure("speed_ahead", "ahead", ".3f", "m/s", "mean over the strides"),
    Figure("speed_left", "left", ".3f", "m/s", "mean over the strides"),
    Figure("turn_rate", "turn", ".3f", "rad/s", "to the left, mean over the strides"),
    Figure("speed_error_rms", "RMS error", ".3f", "m/s",
           "of the strides' velocities from the command"),
    Figure("turn_error_rms", "turn RMS error", ".3f", "rad/s", "over the strides"),
    Figure("own_speed_error", "own error", ".3f", "m/s",
           "largest of a stride before the push: the controller's own tracking error"),
    Figure("last_speed_error", "final error", ".3f", "m/s", "of the last two strides"),
    Figure("circle_error", "circle error", ".3f", "m", "largest distance from the circle"),
    Figure("surfaces_passed", "surfaces passed", ".1f", words="of the terrain, mean"),
    Figure("edge_contacts", "edges touched", ".2f",
           words="new contacts of a foot with an edge, mean",
           where=lambda entry: entry.get("surfaces_passed") is not None),  # else no edges
)  # fmt: skip
STEPS = (
    Figure(
        "steps_as_commanded_rate", "steps as commanded", ".0%", words="no fall, all within 10 %"
    ),
    Figure("step_error", "step error", ".1%", words="largest of the commanded step parameters"),
    Figure("step_length", "step", ".3f", "m", "length, along the heading"),
    Figure("step_width", "width", ".3f", "m", "of a step, across the heading"),
    Figure("step_time", "time", ".3f", "s", "between touchdowns"),
    Figure("swing_time", "swing", ".3f", "s", "from lift-off to touchdown"),
    Figure("step_clearance", "clearance", ".3f", "m", "of the sole's middle at its highest"),
    _mm("foot_slide", "slide", "largest displacement of a sole in single support"),
)
COSTS = (
    Figure("cost_of_transport", "cost of transport", ".2f", words="∫ Σ |τ q̇| dt / (m g d)"),
    Figure("positive_cost_of_transport", "of positive work", ".2f",
           words="∫ Σ max(τ q̇, 0) dt / (m g d)"),
    Figure("knee_mean", "stance knee", ".2f", "N·m/kg", "mean of |τ|/m"),
    Figure("knee_peak", "peak", ".2f", "N·m/kg", "largest |τ|/m"),
    Figure("yaw_momentum", "yaw momentum", ".2f", "N·m·s", "root mean square about the vertical"),
)  # fmt: skip
FELL = Figure("fallen_rate", "fell", ".1%", words="share of the trials; Wilson's interval",
              ends="fallen_ci95")  # fmt: skip
PERFORMED = (
    Figure("joint_rms", "joints", ".1f", "°", "root mean square of the joint errors",
           float(np.degrees(1.0))),
    _mm("body_error", "bodies", "mean distance from the reference motion"),
    _mm("body_error_root", "from the root", "the same, relative to the root"),
    _mm("body_error_last", "last second", "the same in the last second"),
    _mm("com_error", "CoM", "mean distance from the reference motion"),
    _mm("sole_slide", "slide", "displacement of a sole since touchdown"),
    Figure("motion_delay", "delay", ".2f", "s", "of the motion at the end, where it may wait"),
    _mm("swing_error", "swing", "root mean square error of the swing foot, with steps"),
    _mm("placement_error", "foothold", "largest error of a sole at touchdown"),
    _mm("support_slide", "support", "largest displacement of a planted sole"),
    Figure("interruptions", "recovery steps", ".2f", words="times that the planner took over"),
    Figure("steps_mean", "steps", ".1f", words="mean of the touchdowns"),
    Figure("mean_power", "power", ".0f", "W", "∫ Σ |τ q̇| dt over the time"),
)  # fmt: skip
IN_MOTION = (
    TRIED[0],
    Figure("recovered", "stayed up", ".0f"),
    Figure("share50", "J50 in motion", ".2f", "J50", "over the J50 by which pushes were chosen",
           ends="share50_ci95", bound="share50_bound"),
    Figure("over_standing", "over standing", ".2f", words="J50 in motion over J50 standing",
           ends="over_standing_ci95", bound="share50_bound"),
)  # fmt: skip

# of sustained pushes and gusts
SUSTAINED = (
    TRIED[0],
    Figure("never_fell_rate", "not fallen", ".0%", words="trials without a fall",
           ends="never_fell_ci95"),
    Figure("f50", "F50", ".1f", "N", "peak force that half of the trials resist without a fall",
           ends="f50_ci95", bound="f50_bound"),
    Figure("f50_per_mass", "F50/m", ".2f", "N/kg", "the same over the robot's mass"),
    replace(RECOVERED, name="at rest again", words="fraction of all trials, at the end"),
)  # fmt: skip
GUSTS = (
    TRIED[0],
    Figure("never_fell_rate", "not fallen", ".0%", words="trials without a fall",
           ends="never_fell_ci95"),
    Figure("survived_mean", "gusts survived", ".2f", words="mean over the trials",
           ends="survived_ci95", of="pushes"),
    Figure("first_survived", "first survived", ".0f", words="trials that survive the first gust"),
    SUSTAINED[-1],
)  # fmt: skip
