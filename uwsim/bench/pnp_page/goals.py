"""What was asked of this project's solvers, and whether the numbers meet it."""

import math
from collections.abc import Iterable

from uwsim.bench.judged import Goal, shown
from uwsim.bench.pnp_page import loop
from uwsim.bench.pnp_page.study import BEST, PARALLEL, PARTS, PRINTED, PoseStudy, Ratio
from uwsim.bench.pnp_page.tables import ratio_text

TO_ML, HOLD_OUT_TO_ML, NEAR_TO_ML = 1.02, 1.03, 1.05
PARALLEL_TO_ML = {"rotation": (1.05, 1.10), "translation": (1.15, 1.35)}
PARALLEL_WITHIN = 0.05
WEIGHTED_TO_PARALLEL = (0.98, 1.06)
TO_OPNP = {"all": (1.00, 1.00), "near": (0.92, 0.93), "noise": (0.98, 0.99)}
TRANSLATION_TO_PRINTED = {"solid": 0.80, "near": 0.65}
MISSED_PERCENT, FAIL_ABOVE_OPNP_PERCENT, FLIPS_ABOVE_PERCENT = 0.1, 0.2, 0.5
TILTS_DEG = (5.0, 80.0)
TO_SQPNP = {"paraperspective_lm": 0.7, "parallel_covariance": 4.0, "best_without_rpnp": 4.0, "best_with_rpnp": 8.0}
RMS_TO_BOUND = (0.9, 1.08)
SMALL_BOUND_DEG = 5.0
"""Where the bound is larger, errors are not normal and it does not hold."""
EXACT_PERCENT = 99.9
EXACT = (BEST, "dlt", "epnp", "rpnp", "dls", "opnp")
_EPNP_FOUR = (
    "`epnp` has none of the stereo layout of four points (st4): four solid points leave four vectors, whose ten "
    "products six distances cannot give, and those that its linear equations leave out are not zero there; `epnp_gn` "
    "goes on from it over all betas."
)
_NEAR_FOUR = "best_with_rpnp"


def of_solvers(study: PoseStudy, by_loop: dict[str, float] | None = None) -> list[Goal]:
    """Return the goals, in the order of what they are about; `by_loop`: `loop.times_by_loop`."""
    near = {few: [case for case in study.scored(near=True, flat=False)
                  if (study.conditions[case]["points"] < 5) == few] for few in (False, True)}  # fmt: skip
    return [
        *_exact(study), *_reproduced(study),
        _to_ml(study, BEST, TO_ML, study.far_enough(), "solid, from 1.5 edges on"),
        _to_ml(study, BEST, HOLD_OUT_TO_ML, study.far_enough(use="hold_out"), "solid, layouts apart"),
        _to_ml(study, BEST, NEAR_TO_ML, near[False], "near the camera, five points and more"),
        _to_ml(study, _NEAR_FOUR, NEAR_TO_ML, near[True], "near the camera, four points"),
        *_to_opnp(study), *_to_printed(study), *_robust(study), *_fast(study),
        *loop.goals(TO_SQPNP, by_loop or {}), _at_bound(study),
    ]  # fmt: skip


def judged(text: str, ratios: Iterable[Ratio], limits: Iterable[tuple[float, float]]) -> Goal:
    """Return the goal that each ratio lies within its limits (low, high)."""
    ratios = list(ratios)
    if any(math.isnan(ratio.value) for ratio in ratios):
        return Goal(text, "-", None)
    met = all(low <= ratio.value <= high for ratio, (low, high) in zip(ratios, limits, strict=True))
    return Goal(text, " / ".join(map(ratio_text, ratios)), met)


def _both(study: PoseStudy, first: str, second: str, cases: list[str]) -> list[Ratio]:
    return [study.ratio(first, second, part, cases) for part in PARTS]


def _to_ml(study: PoseStudy, method: str, limit: float, cases: list[str], words: str) -> Goal:
    """Return the goal of the geometric mean of the ratios to ML*, with the largest of a setting."""
    text = f"{method} / ML* <= {limit:g}, rotation / translation, {words}"
    goal = judged(text, _both(study, method, study.oracle, cases), [(0, limit)] * 2)
    if goal.met is None:
        return goal
    worst = {
        case: max(study.value(case, method, f"{part}_ratio_to_ml") for part in PARTS)
        for case in cases if not math.isnan(study.value(case, method, "rotation_ratio_to_ml"))
    }  # fmt: skip
    place = max(worst, key=worst.get)
    surely = [case for case in worst if any(study.value(case, method, f"{part}_ratio_low") > limit for part in PARTS)]
    found = f"{goal.found}; largest {worst[place]:.3f} ({place}); {len(surely)} of {len(worst)} settings surely above"
    return goal._replace(found=found)


def _exact(study: PoseStudy) -> list[Goal]:
    cases = [case for case in study.cases() if study.conditions[case]["noise_px"] == 0]
    goals = []
    for method in EXACT:
        shares = {case: study.value(case, method, "exact_percent") for case in cases}
        known = {case: share for case, share in shares.items() if not math.isnan(share)}
        text = f"{method}: without noise exact on >= {EXACT_PERCENT:g} % in each setting"
        if not known:
            goals.append(Goal(text, "-", None))
            continue
        least = min(known, key=known.get)
        goals.append(Goal(text, f"least {known[least]:.2f} % ({least})", known[least] >= EXACT_PERCENT))
    return goals


def exact_note(study: PoseStudy) -> str:
    """Return which solvers are not exact without noise and where, in a sentence each; "" if all are."""
    cases = [case for case in study.cases() if study.conditions[case]["noise_px"] == 0]
    found = []
    for method in study.methods:
        shares = {case: study.value(case, method, "exact_percent") for case in cases}
        least = {}
        for case, share in shares.items():
            if share < EXACT_PERCENT:
                layout = study.conditions[case]["layout"]
                least[layout] = min(share, least.get(layout, share))
        # a start is exact nowhere
        if least and max((share for share in shares.values() if not math.isnan(share)), default=0) > 0:
            words = ", ".join(f"{share:.2f} % of {layout}" for layout, share in least.items())
            found.append(f"`{method}` {words}")
    if not found:
        return ""
    text = f"Without noise below {EXACT_PERCENT:g} % (least of a layout's settings): {'; '.join(found)}."
    if any(one.startswith("`epnp` 0.00 % of st4") for one in found):
        text += " " + _EPNP_FOUR
    return text


def _reproduced(study: PoseStudy) -> list[Goal]:
    cases = [case for case in study.part("k_noise_six", "k_noise_five", "k_noise_four")
             if study.conditions[case]["noise_px"] > 0]  # fmt: skip
    limits = [
        (low * (1 - PARALLEL_WITHIN), high * (1 + PARALLEL_WITHIN))
        for low, high in (PARALLEL_TO_ML[part] for part in PARTS)
    ]
    words = " / ".join(f"{low:.2f} to {high:.2f}" for low, high in limits)
    low, high = WEIGHTED_TO_PARALLEL
    return [
        judged(f"{PARALLEL} / ML* {words}, noise on six, five and four points",
               _both(study, PARALLEL, study.oracle, cases), limits),
        judged(f"{PRINTED} / {PARALLEL} {low:g} to {high:g}, solid",
               _both(study, PRINTED, PARALLEL, study.scored(flat=False)), [WEIGHTED_TO_PARALLEL] * 2),
    ]  # fmt: skip


def _to_opnp(study: PoseStudy) -> list[Goal]:
    groups = study.groups() | {"all": study.scored()}
    return [
        judged(f"{BEST} / OPnP <= {turn:.2f} / {shift:.2f}, {words}",
               _both(study, BEST, "opnp", groups.get(words, [])), [(0, turn), (0, shift)])
        for words, (turn, shift) in TO_OPNP.items()
    ]  # fmt: skip


def _to_printed(study: PoseStudy) -> list[Goal]:
    groups = study.groups()
    return [
        judged(f"{BEST} / {PRINTED} <= {limit:.2f}, translation, {words}",
               [study.ratio(BEST, PRINTED, "translation", groups.get(words, []))], [(0, limit)])
        for words, limit in TRANSLATION_TO_PRINTED.items()
    ]  # fmt: skip


def _robust(study: PoseStudy) -> list[Goal]:
    cases = study.scored()
    missed = study.mean(BEST, "missed_minimum_percent", cases)
    above = study.mean(BEST, "fail_percent", cases) - study.mean("opnp", "fail_percent", cases)
    low, high = TILTS_DEG
    tilted = [case for case in study.scored(flat=True, placed="angle")
              if low <= abs(study.conditions[case]["angle_deg"]) <= high]  # fmt: skip
    flips = study.mean(BEST, "fail_above_best_known_percent", tilted)
    return [
        _at_most(f"{BEST}: misses of the best known minimum <= {MISSED_PERCENT:g} %", missed, MISSED_PERCENT, "%"),
        _at_most(f"{BEST}: failures above OPnP's <= {FAIL_ABOVE_OPNP_PERCENT:g} points", above,
                 FAIL_ABOVE_OPNP_PERCENT, "points"),
        _at_most(f"{BEST}: flips of planes tilted by {low:g} to {high:g} deg above those of the least minimum "
                 f"<= {FLIPS_ABOVE_PERCENT:g} points", flips, FLIPS_ABOVE_PERCENT, "points"),
    ]  # fmt: skip


def _fast(study: PoseStudy) -> list[Goal]:
    peer = study.speed("opencv_sqpnp")
    goals = []
    for method, limit in TO_SQPNP.items():
        text = f"{method}: CPU time by problem <= {limit:g} of `opencv_sqpnp`'s, n = 6"
        goals.append(_at_most(text, study.speed(method) / peer, limit, f"({study.speed(method):.1f} us)"))
    return goals


def _at_bound(study: PoseStudy) -> Goal:
    low, high = RMS_TO_BOUND
    text = f"{BEST}: root mean square error / bound {low:g} to {high:g}, solid, five points and more, bound below 5 deg"
    ratios = [
        study.value(case, BEST, f"{part}_rms_to_bound_ratio")
        for case in study.scored(flat=False)
        if study.conditions[case]["points"] >= 5 and study.bound(case, "rotation") < SMALL_BOUND_DEG
        for part in PARTS
    ]  # fmt: skip
    known = sorted(ratio for ratio in ratios if not math.isnan(ratio))
    if not known:
        return Goal(text, "-", None)
    outside = sum(not low <= ratio <= high for ratio in known)
    middle = known[len(known) // 2]
    found = f"median {middle:.3f}, {known[0]:.3f} to {known[-1]:.3f}; {outside} of {len(known)} outside"
    return Goal(text, found, outside == 0)


def _at_most(text: str, value: float, limit: float, unit: str) -> Goal:
    if math.isnan(value):
        return Goal(text, "-", None)
    return Goal(text, f"{shown(value, 3)} {unit}".rstrip(), value <= limit)
