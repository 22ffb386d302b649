"""Sim-to-real check: do methods rank on simulated pictures as they rank on real ones?"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from uwsim.bench.records import Result

# the harder water says more about methods; a result without it has all cases together
SUMMARIES, METRIC = ("tank_high", "all"), "tags_found"
RESAMPLES, CONFIDENCE = 9999, 0.95
LEAST_METHODS = 3


@dataclass(frozen=True)
class Agreement:
    """Rank correlations over `methods`; None where all scores of one side are equal.

    `spearman_interval`, `kendall_interval`: where 95 % of the bootstrap over methods lies; `spearman_p`, `kendall_p`:
    share of random rankings that agree as much or more (one-sided).
    """

    methods: tuple[str, ...]
    simulated: tuple[float, ...]
    real: tuple[float, ...]
    spearman: float | None
    spearman_interval: tuple[float, float] | None
    spearman_p: float | None
    kendall: float | None
    kendall_interval: tuple[float, float] | None
    kendall_p: float | None


def rank_agreement(simulated_scores: Mapping[str, float], real_scores: Mapping[str, float]) -> Agreement:
    """Return how much two scorings {method: score} agree in rank over the methods that both have.

    Raises ValueError with fewer than 3 methods in common, or a score that is not finite.

    Source: Spearman's rho with mean ranks for ties; Kendall's tau-b (Biometrika 33(3), 1945); intervals: percentile
    bootstrap over methods, seed 0; p: random permutations, seed 0, the observed one counted in (Davison and Hinkley,
    Bootstrap Methods, 1997, eq. 4.11).
    Valid: the methods are taken for a sample of methods; scatter of the scores themselves is not in the intervals,
    which collapse to one number where the rankings are equal: then p alone says how much that means.
    """
    methods = tuple(name for name in simulated_scores if name in real_scores)
    if len(methods) < LEAST_METHODS:
        raise ValueError(f"rank agreement: got {len(methods)} methods in common, allowed: at least {LEAST_METHODS}")
    pair = np.array([[scores[name] for name in methods] for scores in (simulated_scores, real_scores)], dtype=float)
    if not np.isfinite(pair).all():
        raise ValueError("rank agreement: got a score that is not finite, allowed: finite scores")
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(methods), (RESAMPLES, len(methods)))
    bootstrap = pair[0][drawn], pair[1][drawn]
    shuffled = np.broadcast_to(pair[0], drawn.shape), rng.permuted(np.broadcast_to(pair[1], drawn.shape), axis=1)
    found = {}
    for name, coefficient in (("spearman", _spearman), ("kendall", _kendall)):
        value = float(coefficient(*pair[:, None])[0])
        known = np.isfinite(value)
        found[name] = value if known else None
        found[f"{name}_interval"] = _interval(coefficient(*bootstrap)) if known else None
        found[f"{name}_p"] = _share_as_high(coefficient(*shuffled), value) if known else None
    return Agreement(methods, tuple(pair[0].tolist()), tuple(pair[1].tolist()), **found)


def simulated_scores(result: Result) -> tuple[str, dict[str, float]]:
    """Return (summary, {method: verified tags}) of a result on simulated pictures; ValueError if it has none."""
    for summary in SUMMARIES:
        scores = {
            record.algorithm: record.value for record in result.records
            if record.case == summary and record.metric == METRIC and record.value is not None
        }  # fmt: skip
        if scores:
            return summary, scores
    raise ValueError(f"result of {result.benchmark}: no {METRIC} in a summary, allowed: in {' or '.join(SUMMARIES)}")


def _interval(values: np.ndarray) -> tuple[float, float]:
    tail = (1 - CONFIDENCE) / 2
    low, high = np.nanquantile(values, (tail, 1 - tail))
    return float(low), float(high)


def _share_as_high(values: np.ndarray, observed: float) -> float:
    # a coefficient that is equal but for round-off counts
    return float((1 + np.sum(values >= observed - 1e-12)) / (1 + len(values)))


def _spearman(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return rho of each row of two arrays (k, n); NaN where all values of a row are equal."""
    from scipy.stats import rankdata

    return _correlation(*(rankdata(values, axis=1) for values in (first, second)))


def _kendall(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return tau-b of each row of two arrays (k, n); NaN where all values of a row are equal."""
    low, high = np.triu_indices(first.shape[1], k=1)
    signs = (np.sign(values[:, low] - values[:, high]) for values in (first, second))
    return _cosine(*signs)


def _correlation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return _cosine(*(values - values.mean(axis=1, keepdims=True) for values in (first, second)))


def _cosine(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    size = np.sqrt(np.sum(first**2, axis=1) * np.sum(second**2, axis=1))
    return np.divide(np.sum(first * second, axis=1), size, out=np.full(len(size), np.nan), where=size > 0)
