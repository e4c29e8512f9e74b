"""Logistic fit of recovery against impulse, on synthetic data and against statsmodels."""

import warnings

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import expit

from poise.training.benchmarking.statistics import fits
from poise.training.benchmarking.statistics.fits import (
    PRIOR_SCALE,
    check_trials,
    fit_logistic,
    solve_weighted,
)

LOG_9 = np.log(9.0)


def synthetic(n, j50=17.0, scale=1.0, seed=0, width=0.4):
    """Trials drawn from a logistic curve, impulses even within ± width of j50."""
    rng = np.random.default_rng(seed)
    impulse = j50 * rng.uniform(1 - width, 1 + width, n)
    return impulse, rng.random(n) < expit((j50 - impulse) / scale)


def penalised(impulse, recovered, j50, scale):
    """The objective of `fit_logistic`, written straight from its docstring."""
    sign = np.where(recovered, 1.0, -1.0)
    ratio = PRIOR_SCALE * impulse.mean() / scale
    return -np.logaddexp(0, sign * (impulse - j50) / scale).sum() - (ratio - np.log(ratio))


@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
def test_recovers_the_curve_behind_many_trials(scale):
    """With 20,000 trials J50, J90 and s come out as they went in."""
    fit = fit_logistic(*synthetic(20_000, scale=scale))
    assert fit.j50 == pytest.approx(17.0, abs=0.15)
    assert fit.scale == pytest.approx(scale, rel=0.1)
    assert fit.j90 == pytest.approx(17.0 - scale * LOG_9, abs=0.3)
    assert fit.bound is None


def test_matches_statsmodels_logit_with_many_trials():
    """The prior vanishes in many trials: the fit is the maximum-likelihood one."""
    api = pytest.importorskip("statsmodels.api")
    impulse, recovered = synthetic(20_000)
    result = api.Logit(recovered.astype(float), api.add_constant(impulse)).fit(disp=0)
    constant, slope = result.params
    fit = fit_logistic(impulse, recovered)
    assert fit.j50 == pytest.approx(-constant / slope, rel=1e-4)
    assert fit.scale == pytest.approx(-1 / slope, rel=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_maximises_the_documented_objective(seed):
    """A general optimiser finds nothing better, in few trials with any scale."""
    scale = [0.5, 1.0, 2.0, 8.0][seed % 4]
    impulse, recovered = synthetic(25, scale=scale, seed=100 + seed)
    fit = fit_logistic(impulse, recovered)
    best = minimize(
        lambda x: -penalised(impulse, recovered, x[0], np.exp(x[1])),
        [17.0, 1.0],
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-10, "maxiter": 4000},
    )
    # J50 stays in the gap of separated trials, and among the impulses that were tried.
    low, high = impulse[recovered].max(), impulse[~recovered].min()
    if low > high:
        low, high = impulse.min(), impulse.max()
    assert fit.j50 == pytest.approx(np.clip(best.x[0], low, high), rel=1e-5)
    assert fit.scale == pytest.approx(np.exp(best.x[1]), rel=1e-5)


def test_separated_trials_give_a_j50_in_the_gap():
    """All below 15 recovered, all above 16 fallen: J50 lies between, with a finite s."""
    impulse = np.array([10, 11, 12, 13, 14, 15, 16, 17, 18, 19], dtype=float)
    fit = fit_logistic(impulse, impulse <= 15)
    assert 15 <= fit.j50 <= 16
    assert 0.01 < fit.scale < 1.5
    assert fit.bound is None


def test_separated_trials_that_are_lopsided_stay_in_the_gap():
    """One success and thirty failures do not drag J50 below the success."""
    impulse = np.append(10.0, np.full(30, 10.1))
    fit = fit_logistic(impulse, impulse <= 10.0)
    assert 10.0 <= fit.j50 <= 10.1
    assert fit.bound is None


def test_all_recovered_is_a_lower_bound():
    """If no trial was lost, J50 is at least the largest impulse, and the fit says so."""
    fit = fit_logistic([10.0, 12.0, 14.0], [True, True, True])
    assert (fit.j50, fit.j90, fit.bound) == (14.0, 14.0, "lower")
    assert (fit.trials, fit.recovered) == (3, 3)
    assert fit.scale == pytest.approx(PRIOR_SCALE * 12.0)


def test_none_recovered_is_an_upper_bound():
    """If every trial was lost, J50 is at most the smallest impulse, and the fit says so."""
    fit = fit_logistic([10.0, 12.0, 14.0], [0, 0, 0])
    assert (fit.j50, fit.j90, fit.bound) == (10.0, 10.0, "upper")


def test_a_curve_that_passes_half_outside_the_trials_is_a_bound():
    """Mostly recovered everywhere: J50 is not extrapolated beyond the largest impulse."""
    impulse = np.linspace(10, 12, 20)
    fit = fit_logistic(impulse, np.arange(20) % 7 != 0)
    assert (fit.j50, fit.bound) == (12.0, "lower")
    fit = fit_logistic(impulse, np.arange(20) % 7 == 0)
    assert (fit.j50, fit.bound) == (10.0, "upper")
    assert 0 <= fit.j90 < 10.0


def test_recovery_that_rises_with_the_impulse_stays_finite():
    """Trials that contradict a falling curve still give s > 0 and a J50 among the impulses."""
    impulse = np.linspace(10, 20, 20)
    fit = fit_logistic(impulse, impulse > 15)
    assert np.isfinite([fit.j50, fit.j90, fit.scale]).all()
    assert fit.scale > 0 and 10 <= fit.j50 <= 20


def test_a_few_trials_that_rise_with_the_impulse_are_solved_without_a_warning():
    """Replicates of five such trials saturate the curve; each has a J50 within what was tried."""
    impulse = np.array([0.375, 3.021, 6.928, 34.059, 35.562])
    recovered = np.array([False, True, False, False, True])
    weights = np.random.default_rng(0).multinomial(5, np.full(5, 0.2), size=3000).astype(float)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        j50 = solve_weighted(impulse, recovered, weights)[0]
    assert np.all((j50 >= 0.375) & (j50 <= 35.562))


def test_one_impulse_only():
    """Trials of one single impulse: half recovered puts J50 there."""
    fit = fit_logistic(np.full(10, 12.0), np.arange(10) % 2)
    assert fit.j50 == pytest.approx(12.0)
    assert fit.bound is None


def test_the_unit_of_the_impulse_does_not_matter():
    """N·s/kg instead of N·s scales every result and changes nothing else."""
    impulse, recovered = synthetic(30, seed=5)
    a, b = fit_logistic(impulse, recovered), fit_logistic(impulse / 40.9, recovered)
    np.testing.assert_allclose([a.j50, a.j90, a.scale], np.array([b.j50, b.j90, b.scale]) * 40.9)


def test_probability_runs_through_j50_and_j90():
    """The fitted curve is 0.5 at J50, 0.9 at J90 and falls."""
    fit = fit_logistic(*synthetic(60, seed=2))
    np.testing.assert_allclose(fit.probability([fit.j50, fit.j90]), [0.5, 0.9])
    assert np.all(np.diff(fit.probability(np.linspace(5, 30, 50))) < 0)


def test_weights_count_as_repeated_trials():
    """Weighting a trial by two is the same as listing it twice; rows do not touch each other."""
    impulse, recovered = synthetic(25, seed=3)
    weights = np.random.default_rng(0).integers(0, 3, size=(8, 25)).astype(float)
    together = solve_weighted(impulse, recovered, weights)
    for k, row in enumerate(weights):
        alone = solve_weighted(impulse, recovered, row[None])
        np.testing.assert_allclose([t[k] for t in together], [a[0] for a in alone], rtol=1e-9)
    # The prior comes from the mean impulse, so each trial is repeated alike.
    doubled = fit_logistic(np.tile(impulse, 2), np.tile(recovered, 2))
    j50, j90, scale, _ = solve_weighted(impulse, recovered, np.full((1, 25), 2.0))
    np.testing.assert_allclose(
        [j50[0], j90[0], scale[0]], [doubled.j50, doubled.j90, doubled.scale]
    )


def test_replicates_without_a_loss_or_a_success_are_bounds():
    """A replicate that drew only recovered trials ends at the largest impulse tried."""
    impulse, recovered = np.array([10.0, 12.0, 14.0]), np.array([True, True, False])
    weights = np.array([[2.0, 1.0, 0.0], [0.0, 0.0, 3.0], [1.0, 1.0, 1.0]])
    j50, _, _, side = solve_weighted(impulse, recovered, weights)
    assert side.tolist() == [1, -1, 0]
    assert j50[0] == 14.0 and j50[1] == 10.0 and 12.0 <= j50[2] <= 14.0


@pytest.mark.parametrize(
    "impulse, recovered",
    [([], []), ([1.0, 2.0], [1]), ([1.0, np.nan], [1, 0]), ([-1.0], [1]), ([1.0, 2.0], [1, 2])],
)
def test_bad_trials_are_refused(impulse, recovered):
    """No trials, differing shapes, NaN, negative impulses and outcomes beyond 0 and 1 raise."""
    with pytest.raises(ValueError):
        fit_logistic(impulse, recovered)


def test_checked_trials_are_float_and_bool():
    """Lists of int become the arrays that the fit works on."""
    impulse, recovered = check_trials([1, 2], [0, 1])
    assert impulse.dtype == float and recovered.dtype == bool


def test_few_recoveries_are_fitted_in_every_resample() -> None:
    """The gradient vanishes, in units of one trial: where a trial or two bend the whole curve, and
    where harder pushes are recovered more often than weak ones."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        n = int(rng.integers(8, 25))
        x = rng.uniform(-19.0, 20.0, n)
        recovered = np.isin(np.arange(n), rng.choice(n, int(rng.integers(1, 4)), replace=False))
        weights = rng.multinomial(n, np.full(n, 1.0 / n), 100).astype(float)
        mixed = (weights * recovered).any(axis=1) & (weights * ~recovered).any(axis=1)
        w = weights[mixed]
        with np.errstate(all="raise", under="ignore"):
            a, b = fits._newton(x, recovered, w)
        residual = w * (recovered - expit(a[:, None] - b[:, None] * x))
        assert np.abs(residual.sum(axis=1)).max() < 1e-4
        assert np.abs(b * (1.0 / b - 1.0 - residual @ x)).max() < 1e-3
