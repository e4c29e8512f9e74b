"""Sentences of a report."""

import math

from poise.training.benchmarking.diagnosis.words import towards
from poise.training.benchmarking.evaluation.tables import (
    EARLY,
    SEPARATED,
    assisted,
    judged_by_falls,
    shared_ranks,
)
from poise.training.benchmarking.results.read import Record, Results
from poise.training.benchmarking.trials.trial import Trial
from poise.training.running.summary import Summary, both_ends

from .cells import number_text

SIDES = {None: "", "lower": "no less than ", "upper": "no more than "}  # of a bound


def lead(results: Results) -> list[str]:
    """Return the result in a sentence or three."""
    summary = results.summary
    fair = [name for name in summary["ranking"] if not assisted(summary["controllers"][name])]
    first = (fair or summary["ranking"])[0]
    best = summary["controllers"][first]
    unfair = len(fair) < len(results.controllers)
    alone = " of those that take no force from outside" if unfair else ""
    what = "random trials" if summary["rated"] else "trials"
    ranks = shared_ranks(summary["controllers"])
    tied = [name for name in fair if ranks[name] == 1 and name != first]
    place = "comes first"
    if tied:
        place = f"ties with {' and '.join(tied)} for the first place"
    elif len(fair) > 1 and (doubt := _not_separated(summary, first, fair[1])):
        place = doubt
    rate, tried = best["recovered_rate"], f"{best['trials']} {what}"
    upright = best.get("never_fell_rate")
    if upright is None:
        said = [f"{first} {place}{alone}: it recovers {rate:.1%} of {tried}."]
    elif judged_by_falls(summary["controllers"]):
        said = [f"{first} {place}{alone}: it does not fall in {upright:.1%} of {tried}, and goes "
                f"on as commanded in {rate:.1%}."]  # fmt: skip
    else:
        said = [f"{first} {place}{alone}: it recovers {rate:.1%} of {tried}, and does not fall in "
                f"{upright:.1%}."]  # fmt: skip
    if "j50_mean" in best:
        bound = best.get("j50_mean_bound")
        around = None if bound else both_ends(best["j50_mean_ci95"])
        fell = judged_by_falls(summary["controllers"])
        text = f"{'It falls in half' if fell else 'Half'} of its trials"
        text += f"{'' if fell else ' are recovered'} at {SIDES[bound]}{best['j50_mean']:.1f} N·s"
        text += f" (95 % {around[0]:.1f} to {around[1]:.1f})" if around else ""
        text += f": {best['eta_mean']:.2f} of the ankle limit, {best['eta_min']:.2f} in the worst"
        said.append(text + " direction, over all directions.")
    return said


def trials_met(results: Results) -> str:
    """Return how many trials each controller has, and how many of them are common to all: second
    stages differ, and pairs leave them out."""
    own = [{record.met for record in results.of(name)} for name in results.controllers]
    common, sizes = len(set.intersection(*own)), sorted({len(met) for met in own})
    if len(own) > 1 and sizes == [common]:
        return f"on the same {common} trials"
    each = " to ".join(str(size) for size in dict.fromkeys((sizes[0], sizes[-1])))
    return f"with {each} trials" + (f" each, {common} of them common to all" if own[1:] else "")


def early_fall_notes(results: Results) -> list[str]:
    """Return a line for each controller that fell before pushes."""
    found = {name: results.of(name) for name in results.summary["ranking"]}
    counts = {name: sum(record.fell_first for record in own) for name, own in found.items()}
    return [EARLY.format(name, n, len(found[name])) for name, n in counts.items() if n]


def _not_separated(summary: Summary, first: str, second: str) -> str:
    """Return how far the trials tell the first two apart; empty where they do.

    By the interval of the gain in J50 where controllers are ranked by that, else by McNemar's test.
    """
    pairs = [pair for pair in summary["pairs"] if {pair["a"], pair["b"]} == {first, second}]
    if not pairs:
        return f"is listed first, not compared with {second} on the same trials"
    pair = pairs[0]
    words = f"is listed first, not separated from {second}"
    if ends := both_ends(pair.get("j50_gain_ci95")):
        low, high = (100.0 * end for end in ends)
        return "" if low * high > 0.0 else f"{words} (gain in J50 {low:+.1f} to {high:+.1f} %)"
    p = pair.get("p_mcnemar", 1.0)
    return "" if p < SEPARATED else f"{words} (McNemar p = {p:.2f})"


def push_and_conditions(record: Record, trial: Trial) -> str:
    """Return the first push in words, and in what the trial differs from the standard one."""
    if not math.isfinite(record.impulse):
        return "No push."
    details = f", {record.fraction:.2f} of the limit" if math.isfinite(record.fraction) else ""
    details += "".join(f"; {text}" for text in _world(trial))
    return (
        f"{record.impulse:.1f}\u00a0N·s in {record.duration:.2f}\u00a0s on {record.line['body']}, "
        f"towards {record.direction:.0f}° ({towards(record.direction)}){details}."
    )


def _world(trial: Trial) -> list[str]:
    """Return how the conditions of a trial differ from the standard ones."""
    said, conditions = [], trial.conditions
    if conditions.friction is not None:
        said.append(f"friction {conditions.friction:.2f}")
    if conditions.delay:
        said.append(f"sensors {1000.0 * conditions.delay:.0f}\u00a0ms late")
    if conditions.mass_error:
        said.append(number_text(conditions.mass_error, "+.0%") + " mass")
    if conditions.velocity_noise:
        said.append(f"joint velocities with {conditions.velocity_noise:g}\u00a0rad/s of noise")
    if conditions.realism:
        said.append(f"realism {conditions.realism}")
    if trial.terrain is not None:
        said.append(type(trial.terrain).__name__.lower())
    if len(trial.pushes) > 1:
        said.append(f"{len(trial.pushes)} pushes")
    return said
