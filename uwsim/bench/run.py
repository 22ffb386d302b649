"""Run a benchmark: every algorithm on every case, scores into one Result."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

from uwsim import provenance
from uwsim.bench import blur, blur_undone, pose, restoration, runner
from uwsim.bench import blur_deconvolution as deconvolution
from uwsim.bench.blur_controlled import task as blur_controlled
from uwsim.bench.definition import Definition, Variant, read_definition
from uwsim.bench.kept import Kept, Scores
from uwsim.bench.pnp import task as pnp
from uwsim.bench.pnp_outliers import task as pnp_outliers
from uwsim.bench.records import Record, Result, record_from_score, summarise
from uwsim.bench.scoring import Job, by_workers, scores_of
from uwsim.bench.task import Task, spread
from uwsim.bench.validity import task as validity
from uwsim.dataset import store
from uwsim.dataset.store import Dataset
from uwsim.discovery import find, names
from uwsim.files import sha256
from uwsim.metrics import METRICS

_TASKS = (
    restoration.TASK, blur.TASK, blur_controlled.TASK, deconvolution.TASK, blur_undone.TASK, pose.TASK, pnp.TASK,
    pnp_outliers.TASK, validity.TASK,
)  # fmt: skip
TASKS: dict[str, Task] = {task.name: task for task in _TASKS}
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Algorithm:
    """An algorithm file that takes part; `missing`: the packages it needs that are not installed."""

    name: str
    module: ModuleType
    given: tuple[str, ...]
    missing: tuple[str, ...]


def run(
    name: str, dataset: Dataset | None = None, *, algorithms: list[str] | None = None, quick: bool = False,
    progress: Progress | None = None, checkpoint: Path | None = None, resume: bool = False,
    workers: int = 1,
) -> Result:  # fmt: skip
    """Score algorithms on a dataset; `name`: a shipped benchmark, or the path of its TOML file.

    `dataset`: None for benchmarks that make their frames, and for these alone.

    `algorithms`: names choose among the definition's (the do-nothing entry and the oracle stay), paths of
    `.py` files are added to it. `quick`: only `quick_cases` cases, spread over the dataset.
    `progress(text, done, total)` is called at the start and after each case. `checkpoint`: file that keeps the scores
    of finished cases; `resume` goes on from it. `workers`: processes that score cases side by side, one thread each;
    times of algorithms are then those on a busy machine.
    Raises ValueError in one line: unknown names, broken algorithms, a dataset without a usable frame.
    """
    title, definition = read_definition(name)
    task = TASKS[definition.task]
    choices = select(task, definition, algorithms)
    chosen = [load(task, choice, definition.variants) for choice in choices]
    dataset, open_dataset = source(title, task, definition, dataset, quick=quick)
    cases = task.case_names(dataset)
    if quick:
        cases = spread(cases, definition.quick_cases)
    if resume and checkpoint is None:
        raise ValueError("--resume: got no --checkpoint, allowed: with the --checkpoint FILE to go on from")
    kept = None
    if checkpoint is not None:
        kept = Kept(checkpoint, identity=_identity(title, definition, dataset, chosen), resume=resume)
    job = Job(task.name, open_dataset, tuple(choices), definition.variants)
    found = {} if kept is None else {name: scores for name in cases if (scores := kept.scores(name)) is not None}
    left = [name for name in cases if name not in found]
    report = progress or (lambda *_: None)
    report(title, len(found), len(cases))
    for name, scores in _scored(task, dataset, left, chosen, job, workers):
        found[name] = scores
        if kept is not None:
            kept.add(name, scores)
        report(f"{title}: {name}", len(found), len(cases))
    return _result(title, task, definition, dataset, chosen, {name: found[name] for name in cases}, quick=quick)


def source(
    title: str, task: Task, definition: Definition, dataset: Dataset | None, *, quick: bool
) -> tuple[object, Callable[[], object]]:
    """Return the dataset, or what stands for it where a benchmark makes its frames, and what opens it elsewhere."""
    if (task.frames is None) != (dataset is not None):
        got, allowed = ("a dataset", "none: it makes its frames") if dataset else ("none", "a dataset")
        raise ValueError(f"{title}: dataset: got {got}, allowed: {allowed}")
    if dataset is not None:
        return dataset, partial(store.open, dataset.folder)
    open_dataset = partial(task.frames, definition.made_from, quick=quick)
    return open_dataset(), open_dataset


def _result(
    title: str, task: Task, definition: Definition, dataset: Dataset, chosen: list[Algorithm],
    found: dict[str, Scores], *, quick: bool,
) -> Result:  # fmt: skip
    """Return the result of the scores of all cases."""
    cases, found = list(found), _related(task, definition, found)
    statistics = {key: how for key, how in task.statistics.items() if definition.oracle or key not in task.relative}
    present = [algorithm for algorithm in chosen if not algorithm.missing]
    records = [
        record
        for name in cases
        for algorithm in present
        for record in case_records(name, algorithm, found[name][algorithm.name], (*statistics, *task.details))
    ]
    summaries = task.summaries(dataset, cases)
    for summary, members in summaries.items():
        for algorithm in chosen:
            scores = [] if algorithm.missing else [found[name][algorithm.name] for name in members]
            records += summary_records(statistics, summary, algorithm, scores)
    origin = _provenance(definition, dataset, quick=quick, cases=len(cases)) | {"statistics": statistics}
    origin |= {"summaries": list(summaries), "cameras": task.notes(dataset, cases) + unscored_notes(found)}
    extra = {
        "conditions": task.conditions(dataset, cases), "further": list(task.further),
        "findings": task.findings(dataset, found),
    }  # fmt: skip
    origin |= {key: value for key, value in extra.items() if value}
    return Result(benchmark=title, provenance=origin, records=tuple(records))


def _related(task: Task, definition: Definition, found: dict[str, Scores]) -> dict[str, Scores]:
    """Return the scores of all cases with the metrics that compare algorithms with each other."""
    if definition.oracle is None:
        return found
    return {name: task.relate(scores, definition.do_nothing, definition.oracle) for name, scores in found.items()}


def case_records(case: str, algorithm: Algorithm, scores: dict, metrics: Iterable[str]) -> list[Record]:
    """Return the records of an algorithm's scores of a case; a `note` of the scores goes with the first metric."""
    notes = {next(iter(metrics)): scores.get("note", "")}
    return [
        record_from_score(_blank(case, algorithm, metric, notes.get(metric, "")), scores[metric]) for metric in metrics
    ]


def _scored(
    task: Task, dataset: Dataset, cases: list[str], chosen: list[Algorithm], job: Job, workers: int
) -> Iterator[tuple[str, Scores]]:
    """Yield (case, its scores), one after the other or by worker processes."""
    if workers > 1 and len(cases) > 1:
        yield from by_workers(job, cases, processes=workers)
        return
    present = [algorithm for algorithm in chosen if not algorithm.missing]
    for done, name in enumerate(cases):
        yield name, scores_of(task, task.case(dataset, name), present, warm=done > 0)


def _identity(title: str, definition: Definition, dataset: Dataset, chosen: list[Algorithm]) -> dict:
    """Return what two runs must share for their scores to be parts of one result."""
    return {
        "benchmark": title,
        "definition": definition.model_dump(mode="json"),
        "dataset": dataset.sha256,
        "algorithms": {algorithm.name: sha256(Path(algorithm.module.__file__)) for algorithm in chosen},
        "versions": provenance.versions(),
        "commit": provenance.commit(),
    }


def select(task: Task, definition: Definition, algorithms: list[str] | None) -> list[str]:
    """Return what takes part, in table order: do-nothing, the others, the oracle, added files."""
    shipped = definition.algorithms
    if shipped is None:
        shipped = [*names(task.package), *definition.variants]
    fixed = [definition.do_nothing, definition.oracle]
    asked = list(dict.fromkeys(algorithms or []))
    files = [name for name in asked if name.endswith(".py")]
    wanted = [name for name in asked if name not in files]
    unknown = [name for name in wanted if name not in shipped]
    if unknown:
        raise ValueError(
            f"{task.name}: got algorithm {unknown[0]!r}, allowed: {', '.join(shipped)}, or the path of a .py file"
        )
    middle = [name for name in shipped if name not in fixed and (not wanted or name in wanted)]
    return [
        definition.do_nothing,
        *middle,
        *([definition.oracle] if definition.oracle else []),
        *_files(files, shipped),
    ]


def _files(files: list[str], shipped: list[str]) -> list[str]:
    taken = set(shipped)
    for file in files:
        stem = file.replace("\\", "/").rpartition("/")[2].removesuffix(".py")
        if stem in taken:
            raise ValueError(f"{file}: an algorithm named {stem!r} takes part already, allowed: another file name")
        taken.add(stem)
    return files


def load(task: Task, choice: str, variants: Mapping[str, Variant] | None = None) -> Algorithm:
    """Import an algorithm file, or that of a variant, and check what it states; ValueError in one line."""
    variant = (variants or {}).get(choice)
    module = find(task.package, choice if variant is None else variant.algorithm)
    name = module.__name__.rpartition(".")[2] if variant is None else choice
    given = runner.needs(module, name, task.inputs)
    runner.entry(module, name, task.function)
    runner.input_kind(module, name)
    if variant is not None:
        module = _varied(module, task.function, variant)
    return Algorithm(name=name, module=module, given=given, missing=tuple(runner.prepare(module)))


def _varied(module: ModuleType, function: str, variant: Variant) -> ModuleType:
    """Return a copy of a module whose function has the variant's keywords; FITTED as the variant says."""
    made = ModuleType(module.__name__, module.__doc__)
    made.__dict__.update(vars(module))
    setattr(made, function, partial(getattr(module, function), **variant.keywords))
    made.FITTED, made.BLUR_FROM = variant.fitted, variant.blur_from
    made.RESTORED_BY, made.DEBLURRED_BY, made.LABELS = variant.restored_by, variant.deblurred_by, variant.labels
    return made


def _blank(case: str, algorithm: Algorithm, metric: str, note: str = "") -> Record:
    unit, better = METRICS[metric].unit, METRICS[metric].better
    return Record(case, algorithm.name, algorithm.given, metric, None, unit, better, note)


def summary_records(statistics: dict[str, str], case: str, algorithm: Algorithm, scores: list[dict]) -> list[Record]:
    """Return the records of a summary of an algorithm's scores: {metric: "median" or "mean"} over its cases."""
    if algorithm.missing:
        reason = f"not installed: {', '.join(algorithm.missing)}"
    else:
        reason = "" if any(map(scored, scores)) else "; ".join(dict.fromkeys(score.get("note", "") for score in scores))
    if reason:
        return [_blank(case, algorithm, metric, reason) for metric in statistics]
    records = []
    for metric, statistic in statistics.items():
        value, note = summarise([score[metric] for score in scores], statistic)
        record = record_from_score(_blank(case, algorithm, metric, note), value)
        records.append(record)
    return records


def scored(scores: dict) -> bool:
    """Return whether an algorithm has any score in a case."""
    return not all(math.isnan(value) for metric, value in scores.items() if metric != "note")


def unscored_notes(found: dict[str, Scores]) -> list[str]:
    """Return in sentences which algorithms have no score at all in some cases, and why."""
    cases: dict[tuple[str, str], list[str]] = {}
    for case, scores in found.items():
        for name, one in scores.items():
            if not scored(one):
                cases.setdefault((name, one.get("note", "no estimate")), []).append(case)
    return [
        f"{name} has no scores in {len(names)} of {len(found)} cases ({', '.join(names)}): {reason}"
        for (name, reason), names in cases.items()
    ]


def _provenance(definition: Definition, dataset: Dataset, *, quick: bool, cases: int) -> dict:
    unused = {
        key
        for key in ("dataset", "frames", "problems", "outliers", "quick_dataset", "variants")
        if not getattr(definition, key)
    }
    return {
        "definition": definition.model_dump(mode="json", exclude=unused),
        "dataset": {"name": dataset.name, "seed": dataset.seed, "sha256": dataset.sha256},
        "cases": cases,
        "quick": quick,
        "versions": provenance.versions(),
        "commit": provenance.commit(),
    }
