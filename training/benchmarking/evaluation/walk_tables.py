"""Tables of controllers that walk: by command, and by the phase of a push."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from rich.markup import escape
from rich.table import Table

from poise.training.running.summary import Number, PhaseJ50, Summary, WalkLevel

NONE = "–"
Columns = tuple[tuple[str, Callable[[WalkLevel], str]], ...]  # heading, text of a level


def walk_tables(summary: Summary) -> Iterator[Table]:
    """Three of the levels of each controller, and one of J50 by phase; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        levels = entries[name].get("walks", [])
        for columns in (FOLLOWS, STEPS, COSTS):
            table = _levels(name, levels, columns)
            if len(table.columns) > 1:
                yield table
    phases = {name: entries[name].get("phases", []) for name in summary["ranking"]}
    if any(phases.values()):
        yield _phases(phases)


def _levels(name: str, levels: list[WalkLevel], columns: Columns) -> Table:
    """The columns that have any figure."""
    table = Table(title=escape(name), title_justify="left")
    table.add_column("command", overflow="fold")
    forms = [(head, form) for head, form in columns if {form(level) for level in levels} - {NONE}]
    for heading, _ in forms:
        table.add_column(heading, justify="right", overflow="fold")
    for level in levels:
        table.add_row(escape(level["level"]), *(form(level) for _, form in forms))
    return table


def _figure(key: str, form: str) -> Callable[[WalkLevel], str]:
    def text(level: WalkLevel) -> str:
        value: Number = level.get(key)  # type: ignore[assignment]
        return NONE if value is None else format(value, form)

    return text


def _falls(level: WalkLevel) -> str:
    if level["falls_per_minute_ci95"] is None:  # the controller raised in every trial
        return NONE
    low, high = level["falls_per_minute_ci95"]
    return f"{level['falls_per_minute']:.2f} [{low:.2f}, {high:.2f}]"


def _edges(level: WalkLevel) -> str:
    """Where there is a terrain."""
    return NONE if level.get("surfaces_passed") is None else _figure("edge_contacts", ".2f")(level)


FOLLOWS: Columns = (
    ("fell", lambda level: f"{level['fallen']} of {level['trials']}"),
    ("falls a minute", _falls),
    ("as told", lambda level: f"{level['recovered_rate']:.0%}"),
    ("ahead [m/s]", _figure("speed_ahead", ".3f")),
    ("left", _figure("speed_left", ".3f")),
    ("turn [rad/s]", _figure("turn_rate", ".3f")),
    ("RMS error [m/s]", _figure("speed_error_rms", ".3f")),
    ("of the turn [rad/s]", _figure("turn_error_rms", ".3f")),
    ("off the circle [m]", _figure("circle_error", ".3f")),
    ("surfaces passed", _figure("surfaces_passed", ".1f")),
    ("edges touched", _edges),
)
STEPS: Columns = (
    ("as told", _figure("steps_as_told_rate", ".0%")),
    ("off by", _figure("step_error", ".0%")),
    ("step [m]", _figure("step_length", ".3f")),
    ("width [m]", _figure("step_width", ".3f")),
    ("time [s]", _figure("step_time", ".3f")),
    ("in the air [s]", _figure("swing_time", ".3f")),
    ("clearance [m]", _figure("step_clearance", ".3f")),
    ("slide [mm]", lambda level: _millimetres(level.get("foot_slide"))),
)
COSTS: Columns = (
    ("cost of transport", _figure("cost_of_transport", ".2f")),
    ("of positive work", _figure("positive_cost_of_transport", ".2f")),
    ("stance knee [N·m/kg]", _figure("knee_mean", ".2f")),
    ("at most", _figure("knee_peak", ".2f")),
    ("yaw momentum [N·m·s]", _figure("yaw_momentum", ".2f")),
)


def _millimetres(length: Number) -> str:
    return NONE if length is None else f"{1000.0 * length:.1f}"


def _phases(phases: dict[str, list[PhaseJ50]]) -> Table:
    table = Table(title="J50 [N·s] by phase of the stride, 0: the left foot lands",
                  title_justify="left")  # fmt: skip
    table.add_column("controller", overflow="fold")
    middles = sorted({entry["phase"] for found in phases.values() for entry in found})
    for middle in middles:
        table.add_column(f"{middle:.3f}", justify="right", overflow="fold")
    for name, found in phases.items():
        known = {entry["phase"]: f"{entry['j50']:.1f}" for entry in found}
        table.add_row(escape(name), *(known.get(middle, NONE) for middle in middles))
    return table
