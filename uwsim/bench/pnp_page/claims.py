"""What the dissertation's text claims of pose, one by one: against its tables and what is found here."""

import math
from collections.abc import Callable
from typing import NamedTuple

from uwsim.bench.judged import NO, OPEN, PARTLY, YES, Verdict
from uwsim.bench.pnp_page.printed import Printed
from uwsim.bench.pnp_page.study import ERRORS, PARALLEL, PARTS, PRINTED, PoseStudy, name_of

_NOT_RUN = Verdict(OPEN, "no such run here")
_SAME = 0.05
"""Medians closer than this, as a share, count as alike."""
_SURELY_BETTER = 0.98
_IMPROVED = 3.5
_LINEAR_FROM = 0.5
"""Time that grows at least by this share of what n does is nearly linear in n."""


class Pair(NamedTuple):
    """Geometric means of ratios of median errors: rotation, translation."""

    rotation: float
    translation: float

    @property
    def text(self) -> str:
        return f"{self.rotation:.3f} / {self.translation:.3f}"

    @property
    def known(self) -> bool:
        return not any(map(math.isnan, self))


def verdicts(known: Printed, study: PoseStudy) -> dict[str, Verdict]:
    """Return the verdict on each claim of the file, in its order; KeyError for a claim without a rule."""
    return {name: _RULES[name](known, study) for name in known.claims}


def _pair(study: PoseStudy, first: str, second: str, cases: list[str]) -> Pair:
    return Pair(*(study.ratio(first, second, part, cases).value for part in PARTS))


def _word(flags: list[bool]) -> str:
    return YES if all(flags) else PARTLY if any(flags) else NO


def _less(study: PoseStudy, first: str, second: str, cases: list[str], words: str) -> Verdict:
    """Return whether a solver's median errors are below another's."""
    pair = _pair(study, first, second, cases)
    if not pair.known:
        return _NOT_RUN
    text = f"{words}: {name_of(first)} / {name_of(second)} {pair.text} (rotation / translation)"
    return Verdict(_word([ratio < 1 for ratio in pair]), text)


def _start(known: Printed, study: PoseStudy) -> Verdict:
    return _less(study, "paraperspective", "weak_perspective", study.scored(flat=False), "starts alone, solid")


def _start_near(known: Printed, study: PoseStudy) -> Verdict:
    """After Gauss-Newton from either start: in failures, near the camera and off the axis."""
    groups, flags, texts = study.groups(), [], []
    for words in ("near", "off axis"):
        shares = [study.mean(name, "fail_percent", groups.get(words, [])) for name in ("iepnp", PARALLEL)]
        if any(map(math.isnan, shares)):
            return _NOT_RUN
        flags.append(shares[1] < shares[0])
        texts.append(f"{words} {shares[0]:.2f} % with the weak-perspective start, {shares[1]:.2f} % with this one")
    return Verdict(_word(flags), f"failures after Gauss-Newton: {', '.join(texts)}")


def _iepnp_near(known: Printed, study: PoseStudy) -> Verdict:
    share = study.mean("iepnp", "fail_percent", study.groups().get("near", []))
    own = study.mean(PRINTED, "fail_percent", study.groups().get("near", []))
    if math.isnan(share) or math.isnan(own):
        return _NOT_RUN
    word = YES if share > max(5.0, 2 * own) else PARTLY if share > own else NO
    return Verdict(word, f"failures near the camera: IEPnP {share:.2f} %, {name_of(PRINTED)} {own:.2f} %")


def _few_points(known: Printed, study: PoseStudy) -> Verdict:
    flags, texts = [], []
    for layout, words in (("bi6", "six"), ("py5", "five"), ("st4", "four")):
        shares = [study.mean(name, "fail_percent", study.scored(layout=layout)) for name in ("epnp_gn", PRINTED)]
        if not any(map(math.isnan, shares)):
            flags.append(shares[1] < shares[0])
            texts.append(f"{words} points {shares[0]:.2f} % / {shares[1]:.2f} %")
    if not flags:
        return _NOT_RUN
    return Verdict(_word(flags), f"failures of EPnP+GN / {name_of(PRINTED)}: {', '.join(texts)}")


def _five_points(known: Printed, study: PoseStudy) -> Verdict:
    cases = [case for case in study.part("noise_five") if study.conditions[case]["noise_px"] > 0]
    pairs = {name: _pair(study, PRINTED, name, cases) for name in ("epnp_gn", "dls", "opnp")}
    if not all(pair.known for pair in pairs.values()):
        return _NOT_RUN
    words = ", ".join(f"{name_of(name)} {pair.text}" for name, pair in pairs.items())
    return Verdict(
        _word([ratio < 1 for pair in pairs.values() for ratio in pair]),
        f"five points, noise: {name_of(PRINTED)} by {words}",
    )


def _as_opnp(known: Printed, study: PoseStudy) -> Verdict:
    pairs = {name: _pair(study, PRINTED, name, study.groups().get("noise", [])) for name in ("opnp", PARALLEL)}
    if not all(pair.known for pair in pairs.values()):
        return _NOT_RUN
    words = ", ".join(f"{name_of(name)} {pair.text}" for name, pair in pairs.items())
    alike = [abs(ratio - 1) <= _SAME for pair in pairs.values() for ratio in pair]
    return Verdict(_word(alike), f"noise: {name_of(PRINTED)} by {words}; alike: within {100 * _SAME:g} %")


def _weights_near(known: Printed, study: PoseStudy) -> Verdict:
    ratios = {case: study.conditions[case]["depth_ratio"] for case in study.scored(sweep="depth_m", flat=False)}
    pair = _pair(study, PRINTED, PARALLEL, [case for case, ratio in ratios.items() if ratio is not None and ratio < 3])
    if not pair.known:
        return _NOT_RUN
    better = [ratio < _SURELY_BETTER for ratio in pair]
    return Verdict(_word(better), f"below 3 edges, solid: with weights / without {pair.text}; better: below 0.98")


def _weights_off_axis(known: Printed, study: PoseStudy) -> Verdict:
    gains = {}
    for case in study.scored(placed="off_axis", flat=False):
        errors = [study.value(case, name, ERRORS["rotation"]) for name in (PARALLEL, PRINTED)]
        if all(error > 0 for error in errors):
            gains[case] = errors[0] / errors[1]
    if not gains:
        return _NOT_RUN
    most = max(gains, key=gains.get)
    word = YES if gains[most] >= _IMPROVED else NO
    return Verdict(word, f"the most the weights gain in rotation: {gains[most]:.2f}-fold ({most})")


def _weights_plane(known: Printed, study: PoseStudy) -> Verdict:
    pair = _pair(study, PRINTED, PARALLEL, study.scored(flat=True))
    if not pair.known:
        return _NOT_RUN
    alike = [abs(ratio - 1) < 0.005 for ratio in pair]
    return Verdict(_word(alike), f"flat: with weights / without {pair.text}: three betas meet three distances")


def _times(study: PoseStudy, method: str) -> dict[int, float]:
    found = {study.conditions[case]["points"]: study.value(case, method, "microseconds_per_problem")
             for case in study.part("time")}  # fmt: skip
    return {points: time for points, time in found.items() if not math.isnan(time)}


def _faster(known: Printed, study: PoseStudy) -> Verdict:
    own = _times(study, PRINTED)
    ratios = {}
    for name in ("epnp_gn", "iepnp"):
        other = _times(study, name)
        shared = sorted(set(own) & set(other))
        if not shared:
            return _NOT_RUN
        ratios[name] = sum(own[n] / other[n] for n in shared) / len(shared)
    words = ", ".join(f"{ratio:.2f} of {name_of(name)}'s" for name, ratio in ratios.items())
    return Verdict(_word([ratio < 1 - _SAME for ratio in ratios.values()]), f"CPU time in batches: {words}")


def _growth(study: PoseStudy, method: str) -> float:
    """Return the growth of time as a share of that of n, from the fewest points to the most."""
    times = _times(study, method)
    if len(times) < 2:
        return math.nan
    few, many = min(times), max(times)
    return (times[many] / times[few]) / (many / few)


def _linear_time(known: Printed, study: PoseStudy) -> Verdict:
    shares = {name: _growth(study, name) for name in ("lhm", "dls", "epnp", "rpnp", "opnp", PRINTED)}
    if any(map(math.isnan, shares.values())):
        return _NOT_RUN
    linear = {name: share >= _LINEAR_FROM for name, share in shares.items()}
    flags = [linear[name] == (name in ("lhm", "dls")) for name in shares]
    words = ", ".join(f"{name_of(name)} {share:.2f}" for name, share in shares.items())
    return Verdict(
        _word(flags), f"growth of time / growth of n, in batches: {words}; here cores see sums over the points alone"
    )


def _opnp_time(known: Printed, study: PoseStudy) -> Verdict:
    own = _times(study, "opnp")
    others = {name: _times(study, name) for name in ("epnp", "epnp_gn", "rpnp", "dls", PARALLEL, PRINTED)}
    ratios = {name: sum(own[n] / time for n, time in other.items() if n in own) / len(other)
              for name, other in others.items() if other and own}  # fmt: skip
    if not ratios:
        return _NOT_RUN
    words = ", ".join(f"{ratio:.1f} times {name_of(name)}'s" for name, ratio in ratios.items())
    return Verdict(
        _word([2.5 <= ratio <= 10 for ratio in ratios.values()]), f"in batches, a search from 12 starts: {words}"
    )


def _double_u(known: Printed, study: PoseStudy) -> Verdict:
    """Largest over least median rotation error over the angles."""
    flags, texts = [], []
    for name, varies in (("dlt", True), ("epnp", True), ("epnp_gn", True), (PARALLEL, False), ("opnp", False)):
        spans = []
        for part in ("angle_six", "angle_five", "angle_four"):
            errors = [study.value(case, name, ERRORS["rotation"]) for case in study.part(part)]
            known_errors = [error for error in errors if error > 0]
            if len(known_errors) >= 3:
                spans.append(max(known_errors) / min(known_errors))
        if not spans:
            return _NOT_RUN
        flags.append((max(spans) > 1.5) == varies)
        texts.append(f"{name_of(name)} {max(spans):.2f}")
    return Verdict(
        _word(flags), f"largest / least median over the angle, solid, the layout of most: {', '.join(texts)}"
    )


def _angle_54(known: Printed, study: PoseStudy) -> Verdict:
    errors = {study.conditions[case]["angle_deg"]: study.bound(case, "rotation")
              for case in study.part("angle_plane_large")}  # fmt: skip
    errors = {angle: error for angle, error in errors.items() if angle >= 15 and not math.isnan(error)}
    if len(errors) < 3:
        return _NOT_RUN
    least = min(errors, key=errors.get)
    law = [error * math.sin(math.radians(angle)) for angle, error in errors.items()]
    return Verdict(
        YES if abs(least - 54.7) <= 5 else NO,
        f"flat, edge 100 mm: the bound is least at {least:g} deg; bound x sin(angle) varies by a factor of "
        f"{max(law) / min(law):.2f}. 54.7 deg is the minimum of a misprinted function",
    )


def _solid_better(known: Printed, study: PoseStudy) -> Verdict:
    errors = {}
    for words, part in (("five", "angle_five"), ("four", "angle_four"), ("plane", "angle_plane")):
        errors[words] = study.median(PRINTED, "mean_rotation_error_deg", study.part(part))
    if any(map(math.isnan, errors.values())):
        return _NOT_RUN
    words = ", ".join(f"{name} {error:.2f}" for name, error in errors.items())
    return Verdict(
        _word([errors[name] < errors["plane"] for name in ("five", "four")]),
        f"mean rotation error over the angles [deg]: {words}",
    )


def _slightly_higher(known: Printed, study: PoseStudy) -> Verdict:
    flags, texts = [], []
    for quantity, words in (("rotation_deg", "rotation"), ("translation_percent", "translation")):
        rows = known.rows(quantity)
        for name in ("LHM", "OPnP"):
            wins, losses = (sum(sign * (row["Ours"] - row[name]) < -1e-9 for row in rows) for sign in (1, -1))
            flags.append(wins > losses)
            texts.append(f"{words}: {wins} better than {name}, {losses} worse, of {len(rows)} rows")
    pair = _pair(study, PRINTED, "opnp", study.scored(flat=False))
    if pair.known:
        flags += [ratio < 1 for ratio in pair]
        texts.append(f"here {name_of(PRINTED)} / OPnP {pair.text}, solid")
    return Verdict(_word(flags), f"tables 5.1 to 5.5, {'; '.join(texts)}")


def _consistent(known: Printed, study: PoseStudy) -> Verdict:
    flags, texts = [], []
    for quantity, unit in (("rotation_deg", "deg"), ("translation_percent", "%")):
        means = {name: known.mean(quantity, name) for name in ("Ours", "Parallel", "LHM", "RPnP", "DLS", "OPnP")}
        flags += [means["Ours"] <= 1.05 * mean for mean in means.values()]
        texts.append(", ".join(f"{name} {mean:.2f}" for name, mean in means.items()) + f" {unit}")
    same = sum(row["Ours"] == row["Parallel"] for key in ("rotation_deg", "translation_percent")
               for row in known.rows(key))  # fmt: skip
    return Verdict(
        _word(flags),
        f"means of tables 5.1 to 5.5: {'; '.join(texts)} (OPnP with one entry of 214.86); Ours and Parallel are equal "
        f"in {same} of {len(known.rows('rotation_deg')) + len(known.rows('translation_percent'))} entries",
    )


def _off_axis_real(known: Printed, study: PoseStudy) -> Verdict:
    spans = {}
    place = known.columns.index("Ours")
    for quantity in ("rotation_deg", "translation_percent"):
        rows = [[row[place] for row in getattr(table, quantity).values()] for table in known.table]
        spans[quantity] = max(max(row) - min(row) for row in rows)
    turn, shift = spans["rotation_deg"], spans["translation_percent"]
    return Verdict(
        _word([turn <= 0.7, shift <= 1.0]), f"tables 5.1 to 5.5: at most {turn:.2f} deg and {shift:.2f} % by offset"
    )


_RULES: dict[str, Callable[[Printed, PoseStudy], Verdict]] = {
    "start": _start, "start_near": _start_near, "iepnp_near": _iepnp_near, "few_points": _few_points,
    "five_points": _five_points, "as_opnp": _as_opnp, "weights_near": _weights_near,
    "weights_off_axis": _weights_off_axis, "weights_plane": _weights_plane, "faster": _faster,
    "linear_time": _linear_time, "opnp_time": _opnp_time, "double_u": _double_u, "angle_54": _angle_54,
    "solid_better": _solid_better, "slightly_higher": _slightly_higher, "consistent": _consistent,
    "off_axis_real": _off_axis_real,
}  # fmt: skip
