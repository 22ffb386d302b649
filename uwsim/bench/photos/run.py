"""Run every method that needs no truth on a folder of photographs and videos, scores into one Result."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from uwsim import provenance
from uwsim.bench import restoration
from uwsim.bench.definition import Definition, read_definition
from uwsim.bench.photos import tables
from uwsim.bench.photos.folder import Content, Photograph, Video, frames_of, read_folder
from uwsim.bench.photos.sheets import Sheets, with_tags
from uwsim.bench.photos.tags import Found, verified_tags
from uwsim.bench.records import Record, Result, read_result
from uwsim.bench.restoration.scores import no_reference_scores
from uwsim.bench.run import Algorithm, case_records, load, select, summary_records
from uwsim.bench.task import Case, spread
from uwsim.files import sha256
from uwsim.images import read_srgb
from uwsim.metrics import image as image_metrics

Progress = Callable[[str, int, int], None]
SHOWN_FRAMES = 4


@dataclass
class _Scores:
    """Scores as they come: `cases` for the records, `summaries` {summary: {method: scores of its cases}}."""

    cases: list[tuple[str, Algorithm, dict[str, float]]] = field(default_factory=list)
    summaries: dict[str, dict[str, list[dict[str, float]]]] = field(default_factory=dict)

    def add(self, case: str, method: Algorithm, parts: dict[str, dict[str, float]]) -> None:
        """Take in the scores of a method on a case, by the summary that they belong to."""
        self.cases.append((case, method, {key: value for scores in parts.values() for key, value in scores.items()}))
        for summary, scores in parts.items():
            self.summaries.setdefault(summary, {}).setdefault(method.name, []).append(scores)


def run(
    name: str, folder: Path, *, algorithms: list[str] | None = None, every: int | None = None,
    simulated: Path | None = None, out: Path | None = None, progress: Progress | None = None,
) -> Result:  # fmt: skip
    """Score methods on the photographs and videos of a folder; `name`: a benchmark of restorations, as in `bench.run`.

    `algorithms`: as in `bench.run.run`, of methods whose NEEDS is empty. `every`: every n-th frame of videos, instead
    of what their layouts say. `simulated`: a result on simulated pictures whose ranking is compared with that on the
    videos. `out`: folder for contact sheets, outside of `folder`. Summaries: "photograph" (all), "pair" (those with a
    pseudo-reference), and each layout by its name (frames of its videos); means, of times medians.
    Raises ValueError in one line: what `folder.read_folder` refuses, a method that needs the truth, a simulated
    result without verified tags or with fewer than 3 of the methods, broken methods.
    """
    title, definition = read_definition(name)
    methods = _methods(definition, algorithms)
    content, present = read_folder(folder), [method for method in methods if not method.missing]
    columns = [method.name for method in present]
    rival = None if simulated is None else tables.simulated_tags(read_result(simulated), content, columns)
    if out is not None and out.resolve().is_relative_to(Path(folder).resolve()):
        raise ValueError(f"--out {out}: lies in the folder of the photographs, allowed: another folder")
    scores = _Scores()
    sheets = {"photographs": Sheets([*columns, "pseudo-reference"])} if content.photographs else {}
    sheets |= {layout: Sheets(columns) for layout in content.layouts}
    report = progress or (lambda *_: None)
    for done, photograph in enumerate(content.photographs):
        report(photograph.name, done, len(content.photographs))
        _score_photograph(photograph, present, scores, sheets["photographs"])
    steps = {layout: every or one.every_nth_frame for layout, one in content.layouts.items()}
    for video in content.videos:
        _score_video(video, content, steps[video.layout], present, scores, sheets[video.layout], report)
    records = _records(scores, methods)
    origin = _provenance(definition, content, steps) | {"summaries": list(scores.summaries)}
    origin |= {"findings": tables.findings(content, records, rival)}
    origin |= {} if simulated is None else {"simulated": {"name": simulated.name, "sha256": sha256(simulated)}}
    if out is not None:
        out.mkdir(exist_ok=True)
        for stem, sheet in sheets.items():
            sheet.write(out, stem)
    return Result(f"{title}_photos", origin, tuple(records))


def _methods(definition: Definition, algorithms: list[str] | None) -> list[Algorithm]:
    """Return the methods that need no truth; ValueError if one was asked for that does."""
    if definition.task != "restoration":
        raise ValueError(f"--photos: got a benchmark of {definition.task}, allowed: of restoration")
    found = []
    for choice in select(restoration.TASK, definition, algorithms):
        method = load(restoration.TASK, choice, definition.variants)
        if method.given and choice in (algorithms or ()):
            raise ValueError(f"{method.name}: needs {', '.join(method.given)}, which a photograph does not come with")
        if not method.given:
            found.append(method)
    return found


def _score_photograph(photograph: Photograph, methods: list[Algorithm], scores: _Scores, sheets: Sheets) -> None:
    image = read_srgb(photograph.path)
    reference = None if photograph.reference is None else read_srgb(photograph.reference)
    pictures = []
    for method in methods:
        picture, _ = restoration.restored(method.module, method.name, (), Case(photograph.name, image, {}, None))
        parts = {"photograph": no_reference_scores(picture)}
        if reference is not None:
            parts["pair"] = {
                "psnr_pseudo": image_metrics.psnr(reference, picture),
                "ssim_pseudo": image_metrics.ssim(reference, picture),
            }
        scores.add(photograph.name, method, parts)
        pictures.append(picture)
    sheets.add(photograph.name, [*pictures, reference])


def _score_video(
    video: Video, content: Content, every: int, methods: list[Algorithm], scores: _Scores, sheets: Sheets,
    report: Progress,
) -> None:  # fmt: skip
    layout = content.layouts[video.layout]
    numbers = list(range(0, video.frames, every))
    shown = spread(numbers, SHOWN_FRAMES)
    for done, (number, image) in enumerate(frames_of(video, every)):
        report(video.name, done, len(numbers))
        name, pictures = f"{video.name}/{number:06d}", []
        for method in methods:
            picture, elapsed_ms = restoration.restored(method.module, method.name, (), Case(name, image, {}, None))
            found = verified_tags(picture, layout)
            pose = {} if layout.intrinsics_px is None else {"pose_error_px": found.pose_error_px}
            scores.add(name, method, {video.layout: tag_scores(found) | pose | {"milliseconds": elapsed_ms}})
            if number in shown:
                pictures.append(with_tags(picture, found))
        if number in shown:
            sheets.add(name, pictures)


def tag_scores(found: Found) -> dict[str, float]:
    """Return the scores of the tags of one frame; no error where nothing is verified (NaN)."""
    return {
        "tags_verified": float(len(found.verified)),
        "frames_with_two_tags_percent": 100.0 * (len(found.verified) >= 2),
        "tags_rejected": float(found.rejected),
        "homography_error_px": found.homography_error_px,
    }


def _records(scores: _Scores, methods: list[Algorithm]) -> list[Record]:
    records = [record for case, method, found in scores.cases for record in case_records(case, method, found, found)]
    for summary, found in scores.summaries.items():
        statistics = {metric: _statistic(metric) for metric in next(iter(found.values()))[0]}
        for method in methods:
            records += summary_records(statistics, summary, method, found.get(method.name, []))
    return records


def _statistic(metric: str) -> str:
    return "median" if metric == "milliseconds" else "mean"


def _provenance(definition: Definition, content: Content, steps: dict[str, int]) -> dict:
    photographs = [
        {"name": one.name, "sha256": sha256(one.path)}
        | ({} if one.reference is None else {"pseudo_reference_sha256": sha256(one.reference)})
        for one in content.photographs
    ]
    videos = [
        {
            "name": one.name, "sha256": sha256(one.path), "layout": one.layout, "frames": one.frames,
            "every_nth_frame": steps[one.layout], "scored_frames": len(range(0, one.frames, steps[one.layout])),
        }
        for one in content.videos
    ]  # fmt: skip
    layouts = {
        name: one.model_dump(mode="json") | {"sha256": sha256(content.layout_files[name])}
        for name, one in content.layouts.items()
    }
    return {
        "definition": {
            "description": "Methods on real photographs and videos: pseudo-references and tags, no truth",
            "do_nothing": definition.do_nothing,
        },
        "photographs": photographs, "videos": videos, "layouts": layouts,
        "cameras": _notes(content),
        "versions": provenance.versions(), "commit": provenance.commit(),
    }  # fmt: skip


def _notes(content: Content) -> list[str]:
    """Return what to know about the files beside the numbers, in sentences."""
    found = []
    if any(one.reference for one in content.photographs):
        found.append(
            "a pseudo-reference is the pick of a person or the work of another method: it ranks, it measures no physics"
        )
    if content.videos:
        found.append(
            "errors of tags are over those that a method finds: who finds more of the hard ones may have the larger"
        )
    found += [f"{name}: left out, no layout describes it" for name in content.left_out]
    found += [
        f"{one.name}: of {one.stated_frames} frames stated in the file, {one.frames} can be read"
        for one in content.videos if one.stated_frames != one.frames
    ]  # fmt: skip
    return found
