"""The dissertation's tables on the restoration page, with the numbers found here, and what cannot be had again."""

from uwsim.bench.restoration_page import tables
from uwsim.bench.restoration_page.printed import Printed, Table
from uwsim.bench.restoration_page.study import Study, joined
from uwsim.bench.study import title


def parts(study: Study, known: Printed, noise: dict[str, float]) -> list[str]:
    """Return the tables with the numbers found here, what is not measured, and what cannot be reproduced."""
    by_method, ablation = known.tables("3.1", "3.2"), known.tables("3.3", "3.4")
    scenes = known.tables("6.1", "6.2", "6.3", "6.4")
    found = [
        "### UIQM and UCIQE by method", _PHOTOGRAPHS,
        *(_captioned(table, tables.by_method(study, table, known, noise), known) for table in by_method),
        tables.remarks(study, by_method, known),
        "### Ablation",
        *(_captioned(table, tables.by_method(study, table, known, noise), known) for table in ablation),
        "The same rows against the truth, which the dissertation did not have:",
        tables.ablation_truth(study, ablation[0], known),
        tables.remarks(study, ablation, known),
        "### PSNR and SSIM by scene", _scenes_words(study, scenes),
    ]  # fmt: skip
    for table in scenes:
        if table.water in study.waters:
            found.append(_captioned(table, tables.scenes(study, table, known), known))
    found += [tables.remarks(study, scenes, known), "### Not measured", tables.not_measured(known), *_blur(known)]
    return [*found, "### What cannot be reproduced, and why", _irreproducible(study, known)]


_PHOTOGRAPHS = """Printed: means over photographs (60 of UIEB, 330 of EUVP). Here: means over the rendered frames of
each water, by variant: other pictures, so only the order of the methods can be compared."""


def _captioned(table: Table, content: str, known: Printed) -> str:
    head = f"**Table {table.number}**, {table.title}"
    return "\n\n".join(part for part in (head, content, tables.notes(table, known)) if part)


def _scenes_words(study: Study, scenes: list[Table]) -> str:
    waters = joined([f"{table.number}: {title(table.water)}" for table in scenes])
    return (
        "Twelve images of a real tank in print, scenes of the simulated tank here: a row pairs their numbers, not "
        f"their pictures. The turbidity is told in words only; it stands here for {waters}."
    )


def _blur(known: Printed) -> list[str]:
    """Return the tables of pictures in motion, to which no number here answers."""
    found = [_captioned(table, tables.as_printed(table, known), known) for table in known.tables("6.5", "6.6")]
    return ["Tables 6.5 and 6.6 are of pictures in motion, by speed [%]; only printed numbers.", *found]


def _irreproducible(study: Study, known: Printed) -> str:
    """Return why tables of the dissertation cannot be had again, with the numbers that say so."""
    by_number = {table.number: table for table in known.table}
    psnr, ssim = ([by_number[number] for number in numbers] for numbers in (("6.1", "6.3"), ("6.2", "6.4")))
    means = [sum(table.mean("Proposed") for table in found) / len(found) for found in (psnr, ssim)]
    wins = [sum(table.wins("Proposed") for table in found) for found in (psnr, ssim)]
    rows = sum(len(table.rows) for table in psnr)
    lowest = min(min(table.column(column)) for table in ssim for column in table.columns)
    claim = known.claimed
    uiqm = max(value for number in ("3.1", "3.3", "6.5") for row in by_number[number].rows.values() for value in row)
    variants = [name for name in tables.VARIANTS["uiqm"] if name in study.of_metric]
    names = [name for name in (study.raw, *study.restorers) if len(study.unscored(name)) < len(study.cases)]
    largest = {metric: max(study.mean(name, metric) for name in names) for metric in variants}
    here = joined([f"{value:.2f} ({title(metric)})" for metric, value in largest.items()]) or "not measured"
    return "\n".join((
        "- Tables 6.1 to 6.4 have PSNR and SSIM, but no registered reference: the same chapter says that a matching "
        "sharp picture is hard to get in the real tank, so that PSNR and SSIM cannot be directly applied. What they "
        "were taken against is not named.",
        f"- Their SSIM goes down to {lowest:.2f}: a reference that does not lie on the picture, or is inverted.",
        f"- The text claims {claim.psnr:.2f} dB and {claim.ssim:.2f} for the proposed method ({claim.place}). The "
        f"means of the tables are {means[0]:.2f} dB and {means[1]:.3f}; the mean of WGIF at moderate turbidity is "
        f"{by_number['6.1'].mean('WIGF'):.2f} dB.",
        f"- The text has it outperform {claim.rivals} methods in UIQM, PSNR and SSIM. The tables have "
        f"{len(psnr[0].columns) - 1}; it has the largest PSNR in {wins[0]} of {rows} rows, the largest SSIM in "
        f"{wins[1]}; no UIQM of that experiment is given.",
        f"- Its mean SSIM is {by_number['6.4'].mean('Proposed'):.3f} at high and "
        f"{by_number['6.2'].mean('Proposed'):.3f} at moderate turbidity: more where less is to be seen.",
        f"- Which UIQM was taken is not said. Printed values reach {uiqm:.2f}; the largest mean of a method here is "
        f"{here}. One picture scores differently by a factor of several in the variants in use.",
        "- The constants of the method (exponent of the fusion, p of Shades of Gray, windows, CLAHE) and the weights "
        "of the networks are not printed.",
    ))  # fmt: skip
