"""What the dissertation's text claims of motion blur, one by one: against its tables and what is found here."""

import math
from collections.abc import Callable
from statistics import fmean
from typing import NamedTuple

from uwsim.bench.blur_page.printed import PICTURES, Printed
from uwsim.bench.blur_page.study import MENDED, PRINTED, Study
from uwsim.bench.judged import NO, OPEN, PARTLY, YES, Verdict, shown
from uwsim.bench.restoration_page.printed import printed as printed_restoration
from uwsim.bench.study import title

_CONVENTIONAL = ("radon", "hough", "cepstrum_minimum")
_WEAK = ("gravel_low", "retina", "tissue")
"""Textures here of little contrast."""
_NO_TABLE = "the dissertation has no table of lengths or angles, nor a truth for them"


class Found(NamedTuple):
    """The results here that claims are held against; None where there is none."""

    controlled: Study | None
    rendered: Study | None


def verdicts(known: Printed, found: Found) -> dict[str, Verdict]:
    """Return the verdict on each claim of the file, in its order; KeyError for a claim without a rule."""
    return {name: _RULES[name](known, found) for name in known.claims}


def _all_lengths(known: Printed, found: Found) -> Verdict:
    wins = {metric: sum(part.wins("Proposed") for part in known.parts(metric)) for metric in ("psnr", "ssim")}
    rows = sum(len(part.rows) for part in known.parts("psnr"))
    mean = {metric: fmean(g for part in known.parts(metric) for g in part.gains.values()) for metric in wins}
    return Verdict(
        YES if set(wins.values()) == {rows} else NO,
        f"table 4.2: larger PSNR in {wins['psnr']} of {rows} rows, larger SSIM in {wins['ssim']}; mean difference "
        f"{mean['psnr']:+.2f} dB, {mean['ssim']:+.3f}",
    )


def _short_lengths(known: Printed, found: Found) -> Verdict:
    parts = known.parts("psnr")
    short, long = (
        fmean(gain for part in parts for length, gain in part.gains.items() if chosen(length))
        for chosen in (lambda length: length <= 6, lambda length: length > 6)
    )
    at_2 = " and ".join(f"{part.gains[2]:+.2f}" for part in parts)
    return Verdict(
        YES if short > max(0.0, long) else NO,
        f"table 4.2, mean difference in PSNR: {short:+.2f} dB at 2 to 6 px, {long:+.2f} dB above; at 2 px {at_2} dB",
    )


def _ssim_at_2_px(known: Printed, found: Found) -> Verdict:
    gains = {part.picture: part.gains[2] for part in known.parts("ssim")}
    words = ", ".join(f"{picture} {gain:+.2f}" for picture, gain in gains.items())
    close = [abs(gain) <= 0.02 or gain > 0 for gain in gains.values()]
    return Verdict(YES if all(close) else PARTLY if any(close) else NO, f"table 4.2, difference in SSIM: {words}")


def _pebbles_increase(known: Printed, found: Found) -> Verdict:
    gains = known.of("psnr", "pebbles").gains
    most = max(gains, key=gains.get)
    at_least = gains[most] >= known.claims["pebbles_increase"].value
    return Verdict(
        YES if at_least else NO,
        f"table 4.2, pebbles: {gains[2]:+.2f} dB at 2 px; the most is {gains[most]:+.2f} dB, at {most} px",
    )


def _at_6_px(known: Printed, found: Found) -> Verdict:
    gains = {part.picture: part.gains[6] for part in known.parts("psnr")}
    wins = [gain > 0 for gain in gains.values()]
    words = ", ".join(f"{picture} {gain:+.2f} dB" for picture, gain in gains.items())
    return Verdict(YES if all(wins) else PARTLY if any(wins) else NO, f"table 4.2: {words}")


def _at_20_px(known: Printed, found: Found) -> Verdict:
    gains = {metric: {part.picture: part.gains[20] for part in known.parts(metric)} for metric in ("psnr", "ssim")}
    words = "; ".join(
        f"{title(metric)}: " + ", ".join(f"{picture} {gain:+.2f}" for picture, gain in one.items())
        for metric, one in gains.items()
    )
    wins = [gain > 0 for one in gains.values() for gain in one.values()]
    return Verdict(YES if all(wins) else PARTLY if any(wins) else NO, f"table 4.2, differences: {words}")


def _runtime(known: Printed, found: Found) -> Verdict:
    own, other = known.runtime_s["Proposed"], known.runtime_s["UFPDeblur"]
    ratios = [other[picture] / own[picture] for picture in PICTURES]
    time = _here(found.controlled, lambda study: study.median(PRINTED, "milliseconds", study.cases()))
    here = "" if math.isnan(time) else f"; here its estimator alone takes {shown(time)} ms"
    return Verdict(
        YES if min(ratios) > 8 else PARTLY if max(ratios) > 8 else NO,
        f"table 4.2: {own['boulder']:.2f} s, {min(ratios):.1f} and {max(ratios):.1f} times as fast; hardware, size of "
        f"the picture and stages are not said{here}",
    )


def _from_6_px(known: Printed, found: Found) -> Verdict:
    gains = {
        metric: [gain for part in known.parts(metric) for length, gain in part.gains.items() if length >= 6]
        for metric in ("psnr", "ssim")
    }
    wins = {metric: sum(gain > 0 for gain in one) for metric, one in gains.items()}
    rows = len(gains["psnr"])
    return Verdict(
        YES if set(wins.values()) == {rows} else NO,
        f"table 4.2 from 6 px on: larger PSNR in {wins['psnr']} of {rows} rows, larger SSIM in {wins['ssim']}",
    )


def _weak_texture(known: Printed, found: Found) -> Verdict:
    return _compared(found.controlled, "failures on textures of little contrast", texture=_WEAK)


def _small_blurs(known: Printed, found: Found) -> Verdict:
    below = known.claims["small_blurs"].value
    lengths = tuple(x for x in _here(found.controlled, lambda s: s.steps("length_px"), ()) if 0 < x < below)
    return _compared(found.controlled, f"failures below {below:g} px", length_px=lengths)


def _length_and_angle(known: Printed, found: Found) -> Verdict:
    study = found.controlled
    if study is None or PRINTED not in study.methods:
        return Verdict(OPEN, _NO_TABLE)
    cases = [case for case in study.cases() if study.conditions[case]["length_px"] > 0]
    rivals = [name for name in _CONVENTIONAL if name in study.methods]
    errors = {
        name: (study.median(name, "length_error_px", cases), study.median(name, "angle_error_deg", cases))
        for name in (PRINTED, *rivals)
    }
    words = ", ".join(f"{title(name)} {length:.2f} px / {angle:.1f} deg" for name, (length, angle) in errors.items())
    own = errors.pop(PRINTED)
    better = [own[k] < min(error[k] for error in errors.values()) for k in (0, 1)] if errors else []
    word = OPEN if not better else YES if all(better) else PARTLY if any(better) else NO
    mended = study.mean(MENDED, "failure_percent", cases)
    without = "" if math.isnan(mended) else (
        f"; without equalisation and median it fails on {mended:.0f} % instead of "
        f"{study.mean(PRINTED, 'failure_percent', cases):.0f} %"
    )  # fmt: skip
    return Verdict(word, f"{_NO_TABLE}; here, medians: {words}{without}")


def _compared(study: Study | None, text: str, **wanted: object) -> Verdict:
    """Return whether the dissertation's estimator fails less often than the conventional ones on these cases."""
    if study is None or PRINTED not in study.methods:
        return Verdict(OPEN, "no such run here")
    cases = [case for case in study.cases(**wanted) if study.conditions[case]["length_px"] > 0]
    names = [name for name in (PRINTED, *_CONVENTIONAL) if name in study.methods]
    failed = {name: study.mean(name, "failure_percent", cases) for name in names}
    if len(failed) < 2 or any(map(math.isnan, failed.values())):
        return Verdict(OPEN, "no such run here")
    words = ", ".join(f"{title(name)} {share:.0f} %" for name, share in failed.items())
    own = failed.pop(PRINTED)
    beaten = [own < share for share in failed.values()]
    return Verdict(YES if all(beaten) else PARTLY if any(beaten) else NO, f"{text}, here: {words}")


def _uiqm_superior(known: Printed, found: Found) -> Verdict:
    table = printed_restoration().tables("6.5")[0]
    wins, largest = table.wins("TRANSATT-NET"), max(table.column("TRANSATT-NET"))
    peak = largest == known.claims["uiqm_superior"].value
    return Verdict(
        YES if wins == len(table.rows) and peak else PARTLY if peak else NO,
        f"table 6.5: largest at {wins} of {len(table.rows)} speeds, peak {largest:.2f}; UIQM is no evidence of "
        f"deblurring: the columns of UFPNET and MODEL-BASED vary by {_range(table, 'UFPNET'):.2f} and "
        f"{_range(table, 'MODEL-BASED'):.2f} from 20 to 100 % of the speed",
    )


def _uciqe_largest(known: Printed, found: Found) -> Verdict:
    table, value = printed_restoration().tables("6.6")[0], known.claims["uciqe_largest"].value
    largest = {name: max(table.column(name)) for name in ("TRANSATT-NET", "Phaseformer")}
    reached = [one == value for one in largest.values()]
    words = ", ".join(f"{name} {one:.2f}" for name, one in largest.items())
    return Verdict(YES if all(reached) else PARTLY if any(reached) else NO, f"table 6.6, largest: {words}")


def _uciqe_decline(known: Printed, found: Found) -> Verdict:
    table = printed_restoration().tables("6.6")[0]
    changes = {name: dict(zip(table.rows, table.column(name), strict=True)) for name in table.columns}
    falls = {name: one["50"] - one["100"] for name, one in changes.items()}
    words = ", ".join(f"{name} {0.0 - fall:+.2f}" for name, fall in falls.items())
    fallen = [fall > 0.005 for fall in falls.values()]
    return Verdict(
        YES if all(fallen) else PARTLY if any(fallen) else NO, f"table 6.6, change from 50 to 100 %: {words}"
    )


def _range(table, column: str) -> float:
    return max(table.column(column)) - min(table.column(column))


def _turbid_water(known: Printed, found: Found) -> Verdict:
    study = found.rendered
    if study is None or PRINTED not in study.methods:
        return Verdict(OPEN, "no rendered run with it here; the dissertation has no truth for the length in its tank")
    waters = {water: study.mean(PRINTED, "failure_percent", study.cases(water=water)) for water in study.steps("water")}
    words = ", ".join(f"{title(water)} {share:.0f} %" for water, share in waters.items())
    length = study.median(PRINTED, "length_error_px", study.cases())
    return Verdict(
        YES if max(waters.values()) <= 10 else PARTLY if min(waters.values()) <= 10 else NO,
        f"failures on rendered frames, here: {words}; length error {shown(length)} px, median",
    )


def _here(study: Study | None, of: Callable, otherwise: object = math.nan):
    return otherwise if study is None else of(study)


_RULES: dict[str, Callable[[Printed, Found], Verdict]] = {
    "all_lengths": _all_lengths, "short_lengths": _short_lengths, "ssim_at_2_px": _ssim_at_2_px,
    "pebbles_increase": _pebbles_increase, "at_6_px": _at_6_px, "at_20_px": _at_20_px, "runtime": _runtime,
    "from_6_px": _from_6_px, "weak_texture": _weak_texture, "small_blurs": _small_blurs,
    "length_and_angle": _length_and_angle, "uiqm_superior": _uiqm_superior, "uciqe_largest": _uciqe_largest,
    "uciqe_decline": _uciqe_decline, "turbid_water": _turbid_water,
}  # fmt: skip
