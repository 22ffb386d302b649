"""What restorations come to beside each other, and what the scores without a reference are worth."""

import math
from collections.abc import Iterable

import numpy as np

from uwsim.bench.kept import Scores
from uwsim.bench.restoration.scores import no_reference_scores
from uwsim.dataset.store import Dataset

LEAST_GAIN_DB = 6.0
SHARES = {"oracle_share": "psnr", "oracle_share_gain": "psnr_gain"}
_FULL_REFERENCE = ("psnr", "ssim")
_LEAST_METHODS = 3


def relate(scores: Scores, do_nothing: str, oracle: str) -> Scores:
    """Return the scores of a case with each algorithm's share of the oracle's gain, (P - P_raw) / (P_oracle - P_raw).

    P is the PSNR, for `oracle_share_gain` after the global gain. NaN where the oracle gains less than 6 dB or is not
    installed: there is nothing to share.
    """
    return {name: {**one, **_shares(one, scores[do_nothing], scores.get(oracle))} for name, one in scores.items()}


def _shares(one: dict, raw: dict, oracle: dict | None) -> dict[str, float]:
    found = dict.fromkeys(SHARES, math.nan)
    for share, metric in SHARES.items() if oracle is not None else ():
        gained = oracle[metric] - raw[metric]
        if math.isfinite(gained) and gained >= LEAST_GAIN_DB:
            found[share] = (one[metric] - raw[metric]) / gained
    return found


def findings(dataset: Dataset, scores: dict[str, Scores]) -> dict[str, dict]:
    """Return the tables `rank_correlations` and `white_noise` of the scores without a reference."""
    sizes = {(dataset.frame(name).info.camera.height_px, dataset.frame(name).info.camera.width_px) for name in scores}
    noise = noise_scores(sizes)
    metrics = list(next(iter(noise.values())))
    methods = sorted({name for case in scores.values() for name in case})
    pooled = [one for case in scores.values() for one in case.values()]
    means = [_means([case[name] for case in scores.values() if name in case], metrics) for name in methods]
    whole, pictures = (sum(not math.isnan(one["psnr"]) for one in some) for some in (means, pooled))
    head = [f"with {metric.upper()} over {what}" for metric in _FULL_REFERENCE for what in ("methods", "all pictures")]
    rows = [
        [metric, *(rank_correlation(of, metric, true) for true in _FULL_REFERENCE for of in (means, pooled))]
        for metric in metrics
    ]
    return {
        "rank_correlations": {
            "caption": "Rank correlation (Spearman) of scores without a reference with scores against the truth: over "
            f"the means of {whole} methods, and over {pictures} pictures, methods x cases",
            "head": ["score", *head],
            "rows": rows,
        },
        "white_noise": noise_table(noise),
    }


def noise_scores(sizes: Iterable[tuple[int, int]]) -> dict[tuple[int, int], dict[str, float]]:
    """Return {(height_px, width_px): what white noise of that size scores without a reference}."""
    return {size: no_reference_scores(white_noise(*size)) for size in sorted(sizes)}


def noise_table(scores: dict[tuple[int, int], dict[str, float]]) -> dict:
    """Return the finding `white_noise` of {(height_px, width_px): scores without a reference}."""
    return {
        "caption": "Warning: what white noise scores without a reference",
        "head": ["picture", *next(iter(scores.values()))],
        "rows": [[f"white noise {width} x {height}", *one.values()] for (height, width), one in scores.items()],
    }


def white_noise(height_px: int, width_px: int) -> np.ndarray:
    """Return (H, W, 3) uint8 of independent, uniform levels, the same in every run."""
    return np.random.default_rng(0).integers(0, 256, (height_px, width_px, 3), dtype=np.uint8)


def _means(scores: list[dict], metrics: list[str]) -> dict[str, float]:
    # NaN where a case has no score: means over other cases than those of the other methods say nothing
    return {metric: math.fsum(one[metric] for one in scores) / len(scores) for metric in (*metrics, *_FULL_REFERENCE)}


def rank_correlation(scores: list[dict], first: str, second: str) -> float | None:
    """Return Spearman's rank correlation of two metrics; None below 3 scores or where one of them does not vary.

    A NaN among the two leaves the pair out.
    """
    from scipy.stats import spearmanr

    pairs = np.array([[one[first], one[second]] for one in scores])
    pairs = pairs[~np.isnan(pairs).any(axis=1)]
    if len(pairs) < _LEAST_METHODS or any(len(np.unique(column)) < 2 for column in pairs.T):
        return None
    return float(spearmanr(*pairs.T).statistic)
