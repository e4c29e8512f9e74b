"""Two controllers compared: on their common trials, and by their mean J50."""

from collections import Counter
from collections.abc import Iterable, Mapping

from poise.training.benchmarking.statistics.bootstrap import j50_gain
from poise.training.benchmarking.statistics.differences import paired_rates, relative_gain
from poise.training.benchmarking.statistics.rates import mcnemar
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.benchmarking.trials.trial import counts_as_won as is_won
from poise.training.running.summary import Entry, Pair, Paired

from .evaluated import DIRECTIONAL, Evaluated, pushes, rated, trials_of_parts, won


def pair_figures(
    a: str, b: str, evaluated: Mapping[str, Evaluated], entries: Mapping[str, Entry]
) -> Pair:
    """Compare b with a: McNemar's test on the common rated trials and on all, gain in mean J50.

    The gain is paired, and given for each direction, where both had the same pushes.
    """
    met = alike(evaluated[a], evaluated[b])
    every, rated_numbers = paired(met), {trial.number for trial, _ in rated(evaluated[a])}
    pair: Pair = {"a": a, "b": b, "all": every}
    if own := paired([each for each in met if each[0].number in rated_numbers]):
        pair |= own
    pair["identical"] = len(met) == len(evaluated[a]) == len(evaluated[b]) and all(
        one == two for _, one, two in met
    )
    if "j50_mean" in entries[a] and "j50_mean" in entries[b]:
        _add_gain(
            pair, [trials_of_parts(evaluated[name], *DIRECTIONAL) for name in (a, b)], entries
        )
    return pair


def alike(a: Evaluated, b: Evaluated) -> list[tuple[Trial, Outcome, Outcome]]:
    """Return the trials common to both: second stages share numbers, but not pushes."""
    others = {trial.number: (trial, outcome) for trial, outcome in b}
    return [
        (trial, outcome, others[trial.number][1])
        for trial, outcome in a
        if trial.number in others and others[trial.number][0] == trial
    ]


def paired(met: list[tuple[Trial, Outcome, Outcome]]) -> Paired | None:
    """Return counts of the common trials; None without any."""
    return counted((is_won(trial, one), is_won(trial, two)) for trial, one, two in met)


def counted(won_by: Iterable[tuple[bool, bool]]) -> Paired | None:
    """Return counts of trials won by a, b, both or neither, with McNemar's test."""
    found = Counter(won_by)
    if not found:
        return None
    both, only_a = found[True, True], found[True, False]
    only_b, neither = found[False, True], found[False, False]
    rate, interval = paired_rates(both, only_a, only_b, neither)
    return {
        "both": both,
        "only_a": only_a,
        "only_b": only_b,
        "neither": neither,
        "p_mcnemar": mcnemar(only_a, only_b),
        "rate_gain": rate,
        "rate_gain_ci95": interval,
    }


def _add_gain(pair: Pair, directional: list[Evaluated], entries: Mapping[str, Entry]) -> None:
    met = alike(*directional)
    if len(met) == len(directional[0]) == len(directional[1]):
        direction, impulse, _ = pushes(directional[0])
        gain = j50_gain(direction, impulse, won(directional[0]), won(directional[1]))
        pair["j50_gain"], pair["j50_gain_ci95"] = gain.mean.relative, gain.mean.relative_ci
        pair["directions"] = [
            {"direction": angle, "j50_gain": g.relative, "j50_gain_ci95": g.relative_ci}
            for angle, g in zip(gain.directions, gain.gains, strict=True)
        ]
        return
    one, two = entries[pair["a"]], entries[pair["b"]]
    pair["j50_gain"], pair["j50_gain_ci95"] = relative_gain(
        one["j50_mean"], one["j50_mean_ci95"], two["j50_mean"], two["j50_mean_ci95"]
    )
