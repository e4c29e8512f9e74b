"""What the report shows of controllers that perform motions: falls, errors, J50 in motion."""

from __future__ import annotations

from collections.abc import Sequence

from poise.training.benchmarking.results.read import Results
from poise.training.motion.following.motion_tables import ALL, BOUNDS

from .cells import Cell, Column, Table, cell, figure_cell, name_cell

#: key of a level → title, note, format
FIGURES = {
    "joint_rms": ("Joints [rad]", "root mean square of the joints' errors", ".3f"),
    "body_error": ("Bodies [m]", "mean distance from where the motion has them", ".4f"),
    "body_error_root": ("From the root [m]", "the same, relative to the root", ".4f"),
    "body_error_last": ("At the end [m]", "the same in the last second", ".4f"),
    "com_error": ("CoM [m]", "mean distance from where the motion has it", ".4f"),
    "sole_slide": ("Slide [m]", "how far a sole moved since it landed", ".4f"),
    "motion_delay": ("Late [s]", "the motion at the end, where it waits", ".2f"),
    "swing_error": ("Swing [m]", "root mean square of a sole's way in the air, with steps", ".4f"),
    "placement_error": ("Placement [m]", "largest, of a sole that lands", ".4f"),
    "support_slide": ("Support [m]", "largest way of a planted sole", ".4f"),
    "interruptions": ("Caught", "how often steps of the planner took over", ".2f"),
    "steps_mean": ("Steps", "mean of the touchdowns", ".1f"),
    "mean_power": ("Power [W]", "∫ Σ |τ q̇| dt over the time", ".0f"),
}


def motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """Every motion and share of every controller; None where no motion was performed."""
    columns = [
        Column("controller", "Controller"),
        Column("motion", "Motion"),
        Column("share", "Push", "of the controller's J50"),
        Column("trials", "Trials"),
        Column("fallen", "Falls"),
        Column("fallen_rate", "Share of falls", "Wilson's interval", interval=True),
        *(Column(key, title, note) for key, (title, note, _) in FIGURES.items()),
    ]
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            _name(level["motion"], ALL),
            cell(level["share"], "g"),
            cell(level["trials"], "d"),
            cell(level["fallen"], "d"),
            figure_cell(level, "fallen_rate", ".1%", "fallen_ci95"),
            *(figure_cell(level, key, form) for key, (_, _, form) in FIGURES.items()),
        ]
        for name in order
        for level in results.summary["controllers"][name].get("motions", ())
    ]
    caption = "Falls and errors of every motion, by the share of J50 that it was pushed by."
    return Table("motions", caption, columns, rows) if rows else None


def in_motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each motion of every controller; None where nothing was pushed in motion."""
    columns = [
        Column("controller", "Controller"),
        Column("motion", "Motion"),
        Column("trials", "Trials"),
        Column("recovered", "Stayed up"),
        Column("share50", "Half fall at", "share of the J50 that pushes were chosen by",
               interval=True),
        Column("over_standing", "Over standing", "J50 in motion over J50 standing", interval=True),
    ]  # fmt: skip
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            _name(row["motion"], "mean of the motions"),
            cell(row["trials"], "d"),
            cell(row["recovered"], "d"),
            figure_cell(row, "share50", ".2f", "share50_ci95", BOUNDS[row["share50_bound"]]),
            figure_cell(row, "over_standing", ".2f", "over_standing_ci95",
                        BOUNDS[row["share50_bound"]]),
        ]
        for name in order
        for row in results.summary["controllers"][name].get("in_motion", ())
    ]  # fmt: skip
    caption = "J50 in motion over that of standing, over all directions."
    return Table("in_motion", caption, columns, rows) if rows else None


def _name(motion: str | None, otherwise: str) -> Cell:
    return Cell(motion or otherwise, motion or otherwise)
