"""The dissertation's printed numbers beside ours, its claims, its tables of real pictures, and what cannot be had."""

import math

from uwsim.bench.judged import NONE, shown
from uwsim.bench.pnp_page import claims
from uwsim.bench.pnp_page.printed import Number, Printed, Span
from uwsim.bench.pnp_page.study import MEANS, PARTS, PRINTED, PoseStudy, name_of
from uwsim.bench.records import markdown_table

FACTOR = 1.25
"""A printed number is matched by one within this factor: curves are read off, and trials were 100 to 500."""
_LARGE = 1e4
NOT_COMPARED = """- Figures are printed as pictures without numbers: beside ours stands what the text says of them.
- Which statistic its curves are, it does not say: its numbers of the noise fit means, not medians.
- Noise: "variance" in the text; its numbers fit a standard deviation in pixels, in all four experiments.
- Focal length: 5.32 has 1301 px; the experiments state 80, 500, 80 and 500, and their numbers fit those as pixels.
- Layouts: the height of the pyramid, the edges in depth and eccentricity and which four points are the stereo four are
  not said; here equal edges, 100 mm in the noise, 50 mm in depth (ten metres are 200 of them) and eccentricity, 25 mm
  in the angle, two adjacent base corners and both tops.
- Eccentricity: up to 1500 mm at 200 mm is 82 degrees off the axis, far outside its picture of 1306 x 1016 pixels; no
  test of the field of view is made there or here.
- Depth 0: no target fits; left out. Of ten random points the box begins 10 mm before the camera.
- The weights 5.30 as printed are 0 / 0 where the origin lies on the axis, as in its experiment on the angle: here the
  reading by pairs of control points, in which common factors cancel.
- Running time is of one problem at a time, of programs and on a machine that are not stated; here CPU time of batches.
- Tables 5.1 to 5.5 are of real pictures that are not published, of a layout that is not stated. In the last row one
  line is missing, and OPnP's 3.96 deg beside 214.86 % repeats the value of EPnP+GN."""


def parts(known: Printed, study: PoseStudy) -> list[str]:
    """Return the printed numbers with ours, the claims, the tables, and what cannot be compared."""
    return [
        "### Numbers in the text", _words(), _numbers(known, study),
        "### Claims, one by one", _claims(known, study),
        "### Tables 5.1 to 5.5, means", _tables(known),
        "### What cannot be compared, and why", NOT_COMPARED,
    ]  # fmt: skip


def _words() -> str:
    return (
        f"Rotation [deg] / translation [%]. Here: means of {name_of(PRINTED)}, and of ML*. Matched: within a factor of "
        f"{FACTOR:g}, of ranges at both ends."
    )


def ours(study: PoseStudy, number: Number, method: str) -> list[Span | None]:
    """Return the least and the largest mean error of a solver in the settings of a number: rotation, translation."""
    cases = study.cases(part=number.part) if number.value is None else study.cases(
        part=number.part, value=number.value)  # fmt: skip
    if number.part == "angle_plane":
        cases = [case for case in cases if abs(study.conditions[case]["angle_deg"]) <= 54]
    found: list[Span | None] = []
    for part in PARTS:
        values = study.values(method, MEANS[part], cases)
        found.append((float(values.min()), float(values.max())) if values.size else None)
    return found


def matched(printed: Span, found: Span) -> bool:
    """Return whether both ends of a span are those printed, within FACTOR."""
    return all(abs(math.log(mine / theirs)) <= math.log(FACTOR) for mine, theirs in zip(found, printed, strict=True))


def _numbers(known: Printed, study: PoseStudy) -> str:
    rows = []
    for number in known.number:
        printed = number.rotation_deg, number.translation_percent
        found = ours(study, number, PRINTED)
        verdict = NONE
        if None not in found:
            flags = [matched(*pair) for pair in zip(printed, found, strict=True)]
            verdict = "yes" if all(flags) else "in part" if any(flags) else "no"
        at = "" if number.value is None else f" at {number.value:g}"
        rows.append([
            f"{number.figure}, `{number.part}`{at}", number.place, " / ".join(map(_span, printed)),
            " / ".join(map(_span, found)), " / ".join(map(_span, ours(study, number, study.oracle))), verdict,
        ])  # fmt: skip
    return markdown_table(["figure, part", "where", "printed", "here", "ML*", "matched"], rows, texts=2)


def _span(span: Span | None) -> str:
    if span is None:
        return NONE
    # a mean is that large where a pose has run away to infinity
    low, high = (shown(value, 2) if value < _LARGE else f"{value:.0e}" for value in span)
    return low if low == high else f"{low} to {high}"


def _claims(known: Printed, study: PoseStudy) -> str:
    found = claims.verdicts(known, study)
    rows = [
        [f'"{claim.text}" ({claim.place})', f"**{found[name].word}**", found[name].numbers]
        for name, claim in known.claims.items()
    ]
    return markdown_table(["claim", "verdict", "numbers"], rows, texts=3)


def _tables(known: Printed) -> str:
    rows = []
    for quantity, words in (("rotation_deg", "rotation [deg]"), ("translation_percent", "translation [%]")):
        rows.append([words, *(f"{known.mean(quantity, name):.2f}" for name in known.columns)])
    return markdown_table(["mean error over the rows", *known.columns], rows)
