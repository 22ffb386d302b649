"""What was asked of the estimator and the deconvolver of this project, and whether the numbers meet it."""

import math
from functools import partial

import numpy as np

from uwsim.bench.blur_page.study import DECONVOLVER, OURS, Study
from uwsim.bench.judged import Goal, shown
from uwsim.metrics import blur as blur_metrics

FAILURES_PERCENT, FAILURES_FROM_4_PX_PERCENT = 4.0, 3.0
TO_BOUND = {"length": 3.5, "angle": 3.0}
RMS_TO_BOUND = 1.25
COVERAGE_PERCENT = (85.0, 95.0)
SHARP_PERCENT = 5.0
KEPT_PERCENT, KEPT_FAILURES_PERCENT = 90.0, 2.0
LOSS_DB = -0.1
GAINS_DB = {2.0: 2.2, 4.0: 3.5, 8.0: 4.3, 15.0: 4.7, 20.0: 4.7}
GAIN_WITHIN_DB = 0.2
GAINS_NOISE_PERCENT = 1.0


def of_estimator(study: Study) -> list[Goal]:
    """Return the goals of `whittle` on frames made here."""
    moving = [case for case in study.cases() if study.conditions[case]["length_px"] > 0]
    long = [case for case in moving if study.conditions[case]["length_px"] >= 4]
    return [
        _at_most(f"failures, all frames, <= {FAILURES_PERCENT:g} %",
                 study.mean(OURS, "failure_percent", moving), FAILURES_PERCENT, "%"),
        _at_most(f"failures from 4 px on <= {FAILURES_FROM_4_PX_PERCENT:g} %",
                 study.mean(OURS, "failure_percent", long), FAILURES_FROM_4_PX_PERCENT, "%"),
        *(_to_bound(study, quantity, limit) for quantity, limit in TO_BOUND.items()),
        *(_on_fields(study, quantity) for quantity in TO_BOUND),
        *coverage(study),
        *_gate(study, moving),
        _sharp(study),
    ]  # fmt: skip


def pictures(study: Study, **wanted: object) -> list[str]:
    """Return the blurred frames of pictures that do not repeat themselves."""
    found = study.cases(gaussian=False, periodic=False, **wanted)
    return [case for case in found if study.conditions[case]["length_px"] > 0]


def _at_most(text: str, value: float, limit: float, unit: str) -> Goal:
    if math.isnan(value):
        return Goal(text, "-", None)
    return Goal(text, f"{shown(value)} {unit}".rstrip(), value <= limit)


def _sharp(study: Study) -> Goal:
    """Return the goal of sharp frames, with what it is on the textures of the test alone, which are the harder ones."""
    share = partial(study.mean, OURS, "sharp_called_blurred_percent")
    goal = _at_most(f"sharp frames called blurred by 2 px or more <= {SHARP_PERCENT:g} %",
                    share(study.cases(length_px=0.0)), SHARP_PERCENT, "%")  # fmt: skip
    test = share(study.cases(length_px=0.0, use="test"))
    once = share(study.cases(length_px=0.0, use="test", periodic=False))
    if math.isnan(test) or math.isnan(once):
        return goal
    words = (
        f"{goal.found}; {shown(test)} % of the test textures, {shown(once)} % of those that do not repeat themselves"
    )
    return goal._replace(found=words)


def _gate(study: Study, moving: list[str]) -> list[Goal]:
    refused = study.mean(OURS, "refused_percent", moving)
    words = f"frames in motion that its verdict keeps >= {KEPT_PERCENT:g} %"
    kept = Goal(words, "-" if math.isnan(refused) else f"{shown(100 - refused)} %",
                None if math.isnan(refused) else 100 - refused >= KEPT_PERCENT)  # fmt: skip
    return [
        kept,
        _at_most(f"failures among those <= {KEPT_FAILURES_PERCENT:g} %",
                 study.mean(OURS, "kept_failure_percent", moving), KEPT_FAILURES_PERCENT, "%"),
    ]  # fmt: skip


def _to_bound(study: Study, quantity: str, limit: float) -> Goal:
    """Return the goal of the median error over the bound at every length."""
    found, cases = {}, pictures(study)
    for length in study.steps("length_px", cases):
        of_length = [case for case in cases if study.conditions[case]["length_px"] == length]
        found[length] = study.median(OURS, f"{quantity}_error_to_bound_ratio", of_length)
    text = f"{quantity}: median error / (0.6745 bound) <= {limit:g} at each length, pictures"
    if not found or any(map(math.isnan, found.values())):
        return Goal(text, "-", None)
    words = ", ".join(f"{length:g} px {value:.1f}" for length, value in found.items())
    return Goal(text, words, max(found.values()) <= limit)


def _on_fields(study: Study, quantity: str) -> Goal:
    cases = [case for case in study.cases(gaussian=True) if study.conditions[case]["length_px"] > 0]
    value = study.rms_to_bound(OURS, quantity, cases)
    text = f"{quantity}: root mean square error / bound <= {RMS_TO_BOUND}, Gaussian fields"
    goal = _at_most(text, value, RMS_TO_BOUND, "")
    by_length = {
        length: study.rms_to_bound(
            OURS, quantity, [case for case in cases if study.conditions[case]["length_px"] == length]
        )
        for length in study.steps("length_px", cases)
    }  # fmt: skip
    words = ", ".join(f"{length:g} px {ratio:.2f}" for length, ratio in by_length.items())
    return goal if goal.met is None else goal._replace(found=f"{goal.found}; {words}")


def coverage(study: Study, method: str = OURS) -> list[Goal]:
    """Return the goals of the 90 % intervals on test pictures after one scale, fitted on the tuning pictures."""
    low, high = COVERAGE_PERCENT
    metrics = {quantity: f"{quantity}_error_to_sd" for quantity in TO_BOUND}
    tuning = [study.values(method, metric, pictures(study, use="tuning")) for metric in metrics.values()]
    scale = blur_metrics.interval_scale(np.concatenate(tuning))
    goals = []
    for quantity, metric in metrics.items():
        ratios = study.values(method, metric, pictures(study, use="test"))
        text = f"{quantity}: 90 % intervals cover {low:g} to {high:g} %, test pictures"
        if math.isnan(scale) or not ratios.size:
            goals.append(Goal(text, "-", None))
            continue
        before, after = (100 * float(np.mean(blur_metrics.within_interval(ratios, scale=s))) for s in (1.0, scale))
        words = f"{after:.1f} % after the scale {scale:.2f}; {before:.1f} % as stated"
        goals.append(Goal(text, words, low <= after <= high))
    return goals


def of_deconvolution(study: Study) -> list[Goal]:
    """Return the goals of deconvolution with our estimate, and of the deconvolver with the true blur."""
    noisy = study.cases(noise_percent=GAINS_NOISE_PERCENT)
    goals = []
    for base, variant in pairs(study).items():
        lost = loss(study, base, variant, list(study.conditions))
        value = float(np.median(lost)) if lost.size else math.nan
        text = f"{base}: PSNR with the estimated blur above that with the true one >= {LOSS_DB:g} dB, median"
        goals.append(Goal(text, "-" if math.isnan(value) else f"{value:+.3f} dB",
                          None if math.isnan(value) else value >= LOSS_DB))  # fmt: skip
    if (chosen := f"{DECONVOLVER}_{OURS}") in study.methods:
        worse = study.mean(chosen, "made_worse_percent", noisy)
        goals.append(_at_most(f"{chosen}: frames made worse at {GAINS_NOISE_PERCENT:g} % noise: none", worse, 0.0, "%"))
    for length, goal in GAINS_DB.items():
        cases = study.cases(noise_percent=GAINS_NOISE_PERCENT, length_px=length)
        value = study.median(DECONVOLVER, "psnr_above_blurred", cases)
        text = f"{DECONVOLVER}, true blur of {length:g} px: gain >= {goal - GAIN_WITHIN_DB:.1f} dB"
        met = None if math.isnan(value) else value >= goal - GAIN_WITHIN_DB
        goals.append(Goal(text, "-" if met is None else f"{value:+.2f} dB", met))
    return goals


def pairs(study: Study, estimator: str = OURS) -> dict[str, str]:
    """Return {deconvolver with the true blur: the same with an estimator's}, of those that took part."""
    variants = study.definition.get("variants", {})
    found = {one["algorithm"]: name for name, one in variants.items() if one.get("blur_from") == estimator}
    return {base: name for base, name in found.items() if base in study.methods and name in study.methods}


def loss(study: Study, base: str, variant: str, cases: list[str], metric: str = "psnr_inner") -> np.ndarray:
    """Return by how much a variant is above its deconvolver with the true blur in each case [dB], without borders."""
    found = np.array([study.value(case, variant, metric) - study.value(case, base, metric) for case in cases])
    return found[~np.isnan(found)]
