"""The tables of a report, from a summary."""

from collections.abc import Sequence
from dataclasses import replace

from poise.training.benchmarking.evaluation.tables import (
    NOT_CORRECTED,
    judged_by_falls,
    shared_ranks,
)
from poise.training.benchmarking.results.read import Results
from poise.training.running.columns import (
    AGAINST,
    AIMED,
    AS_COMMANDED,
    ERRORS,
    ETA_MEAN,
    ETA_WORST,
    FAILURES,
    FAILURES_RECOVERED,
    GAIN,
    J50_BOUNDED,
    J50_MEAN,
    J50_PER_MASS,
    J50_SCALED,
    J50_WORST,
    LOSSES,
    NOT_FALLEN,
    P_VALUE,
    PAIRED,
    RECOVERED,
    ROOT,
    TICK,
    TRIED,
    Entry,
    Figure,
)

from .cells import CONTROLLER, Column, Table, Text, entries_of, entry_table
from .worst_trials import smallest_lost

SMALLEST = 3  # pushes listed for each controller
RANK = Figure("rank", "#", ".0f",
              words="by mean J50, else by the fraction of the limit, else by rate")  # fmt: skip
DIRECTION = Figure("direction", "direction", "g", "°", "counter-clockwise from forward")
TRIAL = Figure("trial", "trial", ".0f", words="its number in trials.csv")
APART = {"lost": None, "won": None, "p_mcnemar": None}  # of one that nothing is compared with
PAIR = (Text("b", "b", head=True), Text("a", "against a", head=True))
#: of a record
LOST = (
    TRIAL,
    Figure("fraction", "push", ".2f", words="fraction of the limit", csv="limit_fraction"),
    Figure("impulse", "impulse", ".1f", "N·s"),
    replace(DIRECTION, form=".0f"),
    Figure("duration", "duration", ".2f", "s"),
    Text("body", "body"),
    Figure("fall_time", "fell at", ".2f", "s", "after the reset; none: stood, but not quiet"),
    Text("why", "why"),
)


def ranking(results: Results, baseline: str) -> Table | None:
    """Return every controller with what the benchmark measures, the best first."""
    entries, rated = results.summary["controllers"], results.summary["rated"]
    mix = f" of the {rated}" if rated else ""
    second = replace(NOT_FALLEN, ends="")  # there is no room for two intervals
    rates = (NOT_FALLEN, AS_COMMANDED) if judged_by_falls(entries) else (RECOVERED, second)
    columns: tuple[Column, ...] = (
        RANK, CONTROLLER, J50_MEAN, J50_PER_MASS, J50_WORST, J50_BOUNDED, ETA_MEAN, ETA_WORST,
        replace(J50_SCALED, unit=f"× {results.summary['scale']}",
                words="half of the trials survive"),
        *(replace(each, words=f"{each.words}{mix}") for each in rates),
        replace(TRIED[0], words=f"that the rate is of{mix}"),
        *AGAINST, P_VALUE, ERRORS, FAILURES, FAILURES_RECOVERED, TICK, ROOT,
    )  # fmt: skip
    rank, against = shared_ranks(entries), _against(results, baseline)
    rows = [
        {**entries[name], **against.get(name, APART), "controller": name, "rank": rank[name]}
        for name in results.summary["ranking"]
    ]
    caption = f"Controllers, the best first. Lost and won are counted against {baseline}."
    if rated:
        caption = f"{caption[:-1]}; like the recovered rate, on the random {rated}."
    return entry_table("ranking", caption, columns, rows)


def paired_rows(results: Results) -> Table | None:
    """Return every pair of controllers on the same trials; None of one alone."""
    columns = (*PAIR, *PAIRED, P_VALUE, GAIN)
    pairs = results.summary["pairs"]
    caption = f"All pairs on the same trials{NOT_CORRECTED * (len(pairs) > 1)}."
    return entry_table("pairs", caption, columns, pairs)


def directions(results: Results) -> Table | None:
    """J50 or the fraction of the limit in every direction; None where no suite measured it."""
    entries = results.summary["controllers"].values()
    key = "directions" if any(entry.get("directions") for entry in entries) else "sectors"
    columns: list[Column] = [CONTROLLER, DIRECTION, *TRIED, *AIMED]
    found = entries_of(results, results.controllers, key)
    return entry_table("directions", "Every direction.", columns, found)


def _against(results: Results, baseline: str) -> dict[str, Entry]:
    """controller → trials lost and won against the baseline, and p."""
    found: dict[str, Entry] = {}
    for pair in results.summary["pairs"]:
        if baseline not in (pair["a"], pair["b"]) or "p_mcnemar" not in pair:
            continue
        lost, won, other = pair["only_a"], pair["only_b"], pair["b"]
        if other == baseline:
            lost, won, other = won, lost, pair["a"]
        found[other] = {"lost": lost, "won": won, "p_mcnemar": pair["p_mcnemar"]}
    return found


def loss_rows(results: Results, order: Sequence[str]) -> Table | None:
    """How often what was the cause of a loss; None in older results, and where nothing was lost."""
    caption = "Causes of lost trials, the most frequent one of each controller first."
    columns = (CONTROLLER, LOSSES, Text("cause", "cause"))
    return entry_table("losses", caption, columns, entries_of(results, order, "losses"))


def smallest(results: Results, order: Sequence[str]) -> Table | None:
    """The smallest pushes that each controller did not recover; None where nothing was lost."""
    caption = f"The {SMALLEST} smallest pushes that each controller did not recover."
    rows = [
        {**vars(record), "body": record.line["body"]}
        for name in order
        for record in smallest_lost(results, name)[:SMALLEST]
    ]
    return entry_table("smallest_lost", caption, (CONTROLLER, *LOST), rows)
