"""The page of the motion-blur benchmarks: README.md, figures and JSON in one folder; its numbers are the records'.

Four benchmarks share the folder: each writes its figures and its JSON, and the page is made of the JSON of all that
lie there.
"""

from pathlib import Path

from uwsim.bench.blur_page import dissertation, goals, sections
from uwsim.bench.blur_page.claims import Found
from uwsim.bench.blur_page.printed import printed
from uwsim.bench.blur_page.study import Study
from uwsim.bench.judged import goal_table
from uwsim.bench.records import Result, read_result
from uwsim.files import write_text

TASKS = ("blur_controlled", "deconvolution", "blur", "deblurring")
_FIGURES = {
    "blur_controlled": sections.controlled_figures, "deconvolution": sections.deconvolution_figures,
    "blur": sections.rendered_figures,
}  # fmt: skip
_COMMANDS = {
    "blur_controlled": "blur_controlled", "deconvolution": "blur_deconvolution", "blur": "blur",
    "deblurring": "blur_undone",
}  # fmt: skip


def write(folder: Path, *, result: Result, dataset: object) -> Path:
    """Write the figures and the JSON of a result, then the page of all results that lie in the folder; return it."""
    folder, study = Path(folder), Study(result)
    task = study.definition["task"]
    folder.mkdir(exist_ok=True)
    if task in _FIGURES:
        _FIGURES[task](study, folder)
    result.write(folder / f"{task}.json.gz")
    page = folder / "README.md"
    write_text(page, text(folder))
    return page


def text(folder: Path) -> str:
    """Return the page of the results in a folder."""
    files = {task: Path(folder) / f"{task}.json.gz" for task in TASKS}
    studies = {task: Study(read_result(path)) for task, path in files.items() if path.is_file()}
    found = Found(controlled=studies.get("blur_controlled"), rendered=studies.get("blur"))
    sections_of = {
        "blur_controlled": sections.controlled, "deconvolution": sections.deconvolution, "blur": sections.rendered,
        "deblurring": sections.undone,
    }  # fmt: skip
    parts = [
        "# Motion blur", _INTRODUCTION, _absent(studies),
        "## Conclusions", *_conclusions(studies),
        *(sections_of[task](study) for task, study in studies.items()),
        "## The dissertation's tables",
        *dissertation.parts(printed(), found=found, deconvolution=studies.get("deconvolution"),
                             undone=studies.get("deblurring")),
        "## How it is measured", _METHOD,
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _absent(studies: dict[str, Study]) -> str:
    lines = [
        f"- Not run, so not on this page: `uwsim bench {_COMMANDS[task]} --out DIR`."
        for task in TASKS if task not in studies
    ]  # fmt: skip
    lines += [f"- A quick run: `{_COMMANDS[task]}`." for task, one in studies.items() if one.result.provenance["quick"]]
    return "\n".join(lines)


def _conclusions(studies: dict[str, Study]) -> list[str]:
    parts, asked = [], []
    if "blur_controlled" in studies:
        study = studies["blur_controlled"]
        test = goals.pictures(study, use="test")
        parts.append(f"On pictures that no method was set on. {sections.sentences(study, test)}")
        asked += goals.of_estimator(study)
    if "blur" in studies:
        parts.append(f"On rendered frames. {sections.sentences(studies['blur'], studies['blur'].cases())}")
    if "deconvolution" in studies:
        asked += goals.of_deconvolution(studies["deconvolution"])
    return [*parts, goal_table(asked) if asked else ""]


_INTRODUCTION = """How well the blur of one picture is estimated, how near that is to what can be known, and what it is
worth for undoing the blur. Made by `uwsim bench blur_controlled --out DIR`, `uwsim bench blur_deconvolution --out DIR`,
`uwsim bench blur --out DIR` and `uwsim bench blur_undone --out DIR`; all numbers are in the JSON files that these write
(one record per case, method and metric), the printed ones in `benchmarks/printed/blur.toml`. Angles: x right, y up,
modulo 180 degrees; lengths: of the path during the exposure."""

_METHOD = """- Failure: off by more than 2 px or 10 degrees, or no answer, whatever the method says of the frame.
  Refused: frames in motion that it does not call blurred uniformly (most methods say nothing); a small blur cannot be
  told from a lens. Kept failures: those among the rest.
- Frames made here: textures in linear light, a straight uniform motion, Gaussian noise in percent of white, 8 bits. The
  blurred crop is larger than the frame, so that what was outside before comes in. By the exact transfer function, which
  some estimators have for their model, or by sub-frames in the middle of equal parts of the exposure, four per pixel.
- Bound: Cramer-Rao's for the frame's own texture and noise, neither of them known to the method
  (`uwsim/motion_blur/bound.py`). The median of an error over 0.6745 of it is 1 for a method at the bound. Sound for
  Gaussian textures; for pictures a yardstick.
- 90 % intervals: of a method's own covariance, after one scale for length and angle, fitted on the tuning pictures.
- Deconvolution: PSNR and SSIM of the whole frame in linear light against the sharp one; without borders: 20 px less on
  each side. Made worse: less PSNR than the blurred frame.
- Rendered frames: the label is the median displacement over the pixels; the field is held against the displacement of
  every pixel that sees a body; its sign no picture tells. A method without a field answers with its one estimate.
- Rendered frames undone: 8-bit sRGB against a momentary exposure at mid-exposure without noise. With `whittle`, what it
  calls no blur is left alone, and what it calls not uniform is undone by tiles, as `uwsim deblur` does.
- UIQM and UCIQE are no evidence of deblurring: they stand at tables 6.5 and 6.6 as those print nothing else."""
