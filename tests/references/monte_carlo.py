"""Acceptance rule for Monte-Carlo results, used by every test in tests/physics."""

import numpy as np
from scipy import stats


def assert_mean_matches(replicates, expected, *, max_relative_standard_error, false_alarm=1e-4, model_tolerance=0.0):
    """Fail if independent replicates contradict an expected mean.

    The rule first checks its own power: replicates too noisy to see the error that matters are a failure, not a
    pass. Then comes a two-sided t-test for each quantity, Sidak-corrected for their number.

    replicates (R, ...): R >= 8 results, each with its own seed. expected (...): closed form, same unit.
    max_relative_standard_error: largest allowed standard error / |expected|, about a quarter of the smallest
    relative error that must be found. false_alarm: probability that a correct renderer fails with a random seed.
    model_tolerance: relative error of the closed form itself (say in the test where it comes from).
    """
    replicates = np.asarray(replicates, dtype=np.float64)
    assert len(replicates) >= 8, f"test has no power: {len(replicates)} replicates, needed: 8 or more"
    expected = np.broadcast_to(expected, replicates.shape[1:])
    count = len(replicates)
    mean = replicates.mean(axis=0)
    standard_error = replicates.std(axis=0, ddof=1) / np.sqrt(count)

    relative_error = standard_error / np.abs(expected)
    assert relative_error.max() <= max_relative_standard_error, (
        f"test has no power: relative standard error {relative_error.max():.2g} > {max_relative_standard_error:.2g}; "
        "use more samples"
    )
    beyond = np.maximum(np.abs(mean - expected) - model_tolerance * np.abs(expected), 0)
    t = beyond / np.maximum(standard_error, 1e-6 * np.abs(expected))
    p_value = 2 * stats.t.sf(t, df=count - 1)
    threshold = 1 - (1 - false_alarm) ** (1 / p_value.size)
    worst = np.unravel_index(p_value.argmin(), p_value.shape)
    assert p_value.min() > threshold, (
        f"biased at {worst}: mean {mean[worst]:.6g}, expected {expected[worst]:.6g}, "
        f"t = {t[worst]:.1f}, p = {p_value[worst]:.2g} < {threshold:.2g}"
    )


def assert_two_samples_agree(found, reference, *, largest: float, model_tolerance=3e-3, false_alarm=1e-4):
    """Welch's t-test of two means of independent replicates (n, k), Sidak over k; fails without power.

    largest: allowed standard error of the difference relative to the mean.
    """
    mean, error = found.mean(axis=0) - reference.mean(axis=0), []
    for sample in (found, reference):
        error.append(sample.var(axis=0, ddof=1) / len(sample))
    total, level = np.sqrt(error[0] + error[1]), np.abs(reference.mean(axis=0))
    assert np.all(total <= largest * level), f"test has no power: relative standard error {(total / level).max():.2g}"
    freedom = total**4 / (error[0] ** 2 / (len(found) - 1) + error[1] ** 2 / (len(reference) - 1))
    t = np.maximum(np.abs(mean) - model_tolerance * level, 0) / total
    p_value = 2 * stats.t.sf(t, freedom)
    assert p_value.min() > 1 - (1 - false_alarm) ** (1 / p_value.size), (
        f"biased: relative difference {mean[p_value.argmin()] / level[p_value.argmin()]:.3g}, t = {t.max():.1f}"
    )
