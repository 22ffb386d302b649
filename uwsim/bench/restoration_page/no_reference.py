"""UIQM and UCIQE against the truth: what white noise scores, and how the metrics rank the methods in each water."""

import math

import numpy as np

from uwsim.bench import restoration
from uwsim.bench.restoration.relations import rank_correlation as spearman
from uwsim.bench.restoration.relations import white_noise
from uwsim.bench.restoration_page.study import Study
from uwsim.bench.task import spread
from uwsim.dataset.store import Dataset

METRICS = ("uiqm_f", "uiqm_m", "uciqe_o")
_CASES = 6


def noise_scores(study: Study, dataset: Dataset) -> dict[str, float]:
    """Return the means over a few cases of the scores of a picture of white noise: METRICS and `psnr`."""
    truths = [restoration.reference(dataset.frame(shot.case)) for shot in spread(study.cases, _CASES)]
    scores = [restoration.picture_scores(truth, white_noise(*truth.shape[:2])) for truth in truths]
    return {name: float(np.mean([one[name] for one in scores])) for name in ("psnr", *METRICS)}


def points(study: Study, metric: str, water: str | None) -> list[tuple[str, float, float]]:
    """Return (method, mean of a no-reference metric, mean PSNR) of what sees no layer of the truth."""
    names = [study.raw, *study.restorers]
    found = [(name, study.mean(name, metric, water), study.mean(name, "psnr", water)) for name in names]
    return [point for point in found if all(map(math.isfinite, point[1:]))]


def rank_correlation(study: Study, metric: str, water: str | None) -> float:
    """Return Spearman's rank correlation of a no-reference metric with PSNR over the methods; NaN where undefined."""
    found = spearman([{metric: score, "psnr": psnr} for _, score, psnr in points(study, metric, water)], metric, "psnr")
    return math.nan if found is None else found
