"""What a report says in words."""

from __future__ import annotations

import math
from collections.abc import Mapping

from poise.training.results.read import Record, Results
from poise.training.results.values import interval, number

from .svg import number_text, towards
from .tables import assisted, ranked


def lead(results: Results) -> list[str]:
    """What the result says, in a sentence or three."""
    fair = [name for name in ranked(results) if not assisted(results, name)]
    first = (fair or ranked(results))[0]
    best, where = results.summary["controllers"][first], f"{results.folder}: summary.json"
    rate = number(best, "recovered_rate", where, needed=True)
    unfair = len(fair) < len(results.controllers)
    alone = " of those that take no force from outside" if unfair else ""
    what = "random trials" if results.parts else "trials"
    said = [f"{first} comes first{alone}: it recovers {rate:.1%} of {best['trials']} {what}."]
    mean = number(best, "j50_mean", where)
    if mean is not None:
        ends = interval(best, "j50_mean_ci95", where)
        text = f"Half of its trials are recovered at {mean:.1f} N·s"
        text += f" ({ends[0]:.1f} to {ends[1]:.1f})" if ends else ""
        share, worst = number(best, "eta_mean", where), number(best, "eta_min", where)
        if share is not None and worst is not None:
            text += f": {share:.2f} of the ankle limit, {worst:.2f} in the worst direction"
        said.append(text + ", over all directions.")
    return said


def push_text(record: Record) -> str:
    """The push in words."""
    if not math.isfinite(record.impulse):
        return "No push."
    share = f", {record.fraction:.2f} of the limit" if math.isfinite(record.fraction) else ""
    share += "".join(f"; {text}" for text in _world(record.line))
    return (
        f"{record.impulse:.1f}\u00a0N·s in {record.duration:.2f}\u00a0s on {record.line['body']}, "
        f"towards {record.direction:.0f}° ({towards(record.direction)}){share}."
    )


def push_times(record: Record) -> list[tuple[float, float]]:
    """(start, duration) of every push of a trial [s]."""
    line = record.line
    if not line.get("start"):
        return []
    count, interval = int(line.get("pushes") or 1), float(line.get("interval") or 0.0)
    return [(float(line["start"]) + k * interval, record.duration) for k in range(count)]


def _world(line: Mapping[str, str]) -> list[str]:
    """In what the world of a benchmark's trial differs from the standard one."""
    said = []
    if line.get("friction"):
        said.append(f"friction {float(line['friction']):.2f}")
    if float(line.get("delay") or 0.0):
        said.append(f"sensors {1000.0 * float(line['delay']):.0f}\u00a0ms late")
    if float(line.get("mass_error") or 0.0):
        said.append(number_text(float(line["mass_error"]), "+.0%") + " mass")
    if int(line.get("pushes") or 1) > 1:
        said.append(f"{line['pushes']} pushes, {float(line['interval']):g}\u00a0s apart")
    return said
