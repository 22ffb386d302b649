"""The dissertation's tables on motion blur beside the numbers found here, its claims, and what cannot be compared."""

import numpy as np

from uwsim.bench.blur_controlled import textures
from uwsim.bench.blur_page import claims
from uwsim.bench.blur_page.claims import Found
from uwsim.bench.blur_page.printed import PICTURES, Printed
from uwsim.bench.blur_page.study import DECONVOLVER, OURS, PRINTED, Study
from uwsim.bench.judged import NONE, shown
from uwsim.bench.records import markdown_table
from uwsim.bench.restoration_page.printed import Table
from uwsim.bench.restoration_page.printed import printed as printed_restoration
from uwsim.bench.study import title

_OF_SPEED = ("psnr", "ssim", "uiqm_f", "uciqe_o")
NOT_COMPARED = """- The two pictures of tables 4.1 and 4.2 are not published with their crops: here other pictures of
  the nearest standard deviation stand for them, so only the course over the length can be compared, no level.
- How they were blurred, whether noise was added, what was done at the borders, and whether the rows are means over
  the 12 angles of the set-up, is not said. The set-up has seven lengths, table 4.2 has six: 15 px is missing.
- Table 4.2 has no row of the blurred picture as it is: it cannot show that anything was restored. That row is here.
- No table has a length or an angle, so nothing printed answers to errors of the estimate; nor is the exposure time,
  the distance or the focal length given in chapter six, without which its speeds say nothing of a length in pixels.
- UIQM and UCIQE of tables 6.5 and 6.6 see no blur, and white noise scores well in them (see the restoration page):
  they stand here as printed, with ours of other pictures below, and are held against nothing. The robot is a UR5 in one
  section, an Aubo-i5 in another.
- UFPDeblur (UFPNET, UFPNet) is a network for motion blur in general, neither underwater nor a transformer; its weights
  come in no package. The weights of the dissertation's own network are not published."""


def parts(known: Printed, *, found: Found, deconvolution: Study | None, undone: Study | None) -> list[str]:
    """Return the tables with the numbers found here, the claims, and what cannot be compared."""
    return [
        "### Tables 4.1 and 4.2", _stand_ins(known),
        *(_restored(known, picture, deconvolution) for picture in PICTURES),
        "### Tables 6.5 and 6.6", _speeds_words(found.rendered),
        *(_speeds(table, found.rendered) for table in printed_restoration().tables("6.5", "6.6")),
        *(["Undone, at these speeds: PSNR and SSIM against the sharp twin, and the scores that the tables print, which "
           "see no truth; as it is, then undone.", _undone_speeds(undone)] if undone is not None else []),
        "### Claims, one by one", _claims(known, found),
        "### What cannot be compared, and why", f"{NOT_COMPARED}\n{_contrast(known, deconvolution)}",
    ]  # fmt: skip


def _stand_ins(known: Printed) -> str:
    rows = []
    for picture in PICTURES:
        one = known.pictures[picture]
        here = float(np.std(_middle(one.stands_for)))
        rows.append([f"Underwater {picture}", f"{one.standard_deviation:.2f}", one.stands_for, f"{here:.3f}"])
    return markdown_table(["picture", "standard deviation, printed", "stands for it here", "its own"], rows)


def _contrast(known: Printed, study: Study | None) -> str:
    """Return that the standard deviation of a picture is no measure of texture, with numbers if there are any."""
    text = (
        "- The standard deviation of table 4.1 is no measure of texture: what counts is how far the spectrum lies "
        "above the noise at 1 / length."
    )
    if study is None:
        return text
    names = [known.pictures[picture].stands_for for picture in PICTURES]
    cases = [study.cases(texture=name, noise_percent=0.0, length_px=2.0) for name in names]
    levels = [study.median(study.raw, "psnr", some) for some in cases]
    if np.isnan(levels).any():
        return text
    words = " and ".join(f"{level:.1f} dB (`{name}`)" for level, name in zip(levels, names, strict=True))
    return f"{text} Blurred by 2 px, the two textures here score {words} as they are."


def _middle(name: str) -> np.ndarray:
    grey = textures.picture(name)
    top, left = ((side - 256) // 2 for side in grey.shape)
    return grey[top : top + 256, left : left + 256]


def _restored(known: Printed, picture: str, study: Study | None) -> str:
    """Return table 4.2 of a picture: printed, and here on its stand-in without noise, by length."""
    texture = known.pictures[picture].stands_for
    columns = _columns(study)
    head = ["length [px]", "UFPDeblur, printed", "Proposed, printed", *(f"{words}, here" for words in columns.values())]
    psnr, ssim = known.of("psnr", picture), known.of("ssim", picture)
    rows = []
    for length in [*psnr.rows, "15"]:
        cells = [
            f"{psnr.rows[length][n]:.2f} / {ssim.rows[length][n]:.2f}" if length in psnr.rows else NONE for n in (0, 1)
        ]
        for method in columns:
            cases = study.cases(texture=texture, noise_percent=0.0, length_px=float(length))
            found = [study.median(method, metric, cases) for metric in ("psnr", "ssim")]
            cells.append(NONE if np.isnan(found).any() else f"{found[0]:.2f} / {found[1]:.2f}")
        rows.append([length, *cells])
    rows.sort(key=lambda row: int(row[0]))
    head_text = f"**Table 4.2**, underwater {picture}: PSNR [dB] / SSIM, here on `{texture}` without noise, in 8 bits"
    return f"{head_text}\n\n{markdown_table(head, rows)}"


def _columns(study: Study | None) -> dict[str, str]:
    """Return {method: words} of what stands beside table 4.2, of what took part."""
    wanted = {
        f"wiener_{PRINTED}": "the dissertation's", f"wiener_{OURS}": f"Wiener, {OURS}",
        f"{DECONVOLVER}_{OURS}": f"{DECONVOLVER}, {OURS}", DECONVOLVER: f"{DECONVOLVER}, true blur",
    }  # fmt: skip
    if study is None:
        return {}
    return {study.raw: "as it is"} | {name: words for name, words in wanted.items() if name in study.methods}


def _speeds_words(study: Study | None) -> str:
    if study is None:
        return "Printed: UIQM and UCIQE by speed [% of 0.1 m/s]. Nothing rendered was scored here."
    return (
        "Printed: UIQM and UCIQE by speed [% of 0.1 m/s]. Here, on the simulated platform at such speeds, what they "
        "were taken for: the length of the blur, and by how much it is missed [px]; failures [%]."
    )


def _speeds(table: Table, study: Study | None) -> str:
    methods = [name for name in (PRINTED, OURS) if study is not None and name in study.methods]
    head = ["speed [%]", *(f"{name}, printed" for name in table.columns)]
    head += ["length, here"] if study is not None else []
    head += [f"{title(name)}, here" for name in methods]
    rows = []
    for speed, numbers in table.rows.items():
        cells = [f"{value:.2f}" for value in numbers]
        if study is not None:
            cases = study.cases(speed_percent=float(speed), motion="arm_linear")
            lengths = [study.conditions[case]["length_px"] for case in cases]
            cells.append(shown(float(np.median(lengths)), 1) if lengths else NONE)
            cells += [_errors(study, name, cases) for name in methods]
        rows.append([speed, *cells])
    return f"**Table {table.number}**, {table.title}\n\n{markdown_table(head, rows)}"


def _undone_speeds(study: Study) -> str:
    """Return scores by speed of the pictures as they are and undone, with their label and with `whittle`'s word."""
    methods = [name for name in (study.raw, DECONVOLVER, f"{DECONVOLVER}_{OURS}", f"wiener_{PRINTED}")
               if name in study.methods]  # fmt: skip
    rows = []
    for motion in sorted({one["motion"] for one in study.conditions.values() if one["speed_percent"] is not None}):
        for speed in study.steps("speed_percent", study.cases(motion=motion)):
            cases = study.cases(motion=motion, speed_percent=speed)
            for method in methods:
                scores = [shown(study.summary(method, metric, cases), 2) for metric in _OF_SPEED]
                rows.append([f"{title(motion)}, {speed:g} %", str(len(cases)), title(method), *scores])
    return markdown_table(["motion, speed", "frames", "method", "PSNR [dB]", "SSIM", "UIQM", "UCIQE"], rows, texts=1)


def _errors(study: Study, method: str, cases: list[str]) -> str:
    length, failed = study.median(method, "length_error_px", cases), study.mean(method, "failure_percent", cases)
    return NONE if np.isnan(failed) else f"{shown(length, 2)}; {failed:.0f} %"


def _claims(known: Printed, found: Found) -> str:
    verdicts = claims.verdicts(known, found)
    rows = [
        [f'"{claim.text}" ({claim.place})', f"**{verdicts[name].word}**", verdicts[name].numbers]
        for name, claim in known.claims.items()
    ]
    return markdown_table(["claim", "verdict", "numbers"], rows, texts=3)
