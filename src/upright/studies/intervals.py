"""Confidence intervals."""

import numpy as np

CONFIDENCE = 0.95
RESAMPLES = 9_999


def wilson_interval(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % interval of a success rate (E. B. Wilson, J. Amer. Stat. Ass. 22, 1927)."""
    from scipy.stats import binomtest

    if runs == 0:
        return 0.0, 1.0
    interval = binomtest(successes, runs).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def bootstrap_interval(values: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of a mean (B. Efron, J. Amer. Stat. Ass. 82, 1987: BCa).

    The same values always give the same interval. If all values are equal (or there is only one),
    the interval collapses to that value.
    """
    from scipy.stats import bootstrap

    if np.all(values == values[0]):
        return float(values[0]), float(values[0])
    interval = bootstrap(
        (np.asarray(values, float),),
        np.mean,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)
