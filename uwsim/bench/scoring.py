"""Score the cases of a benchmark one after the other, or in worker processes."""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

from uwsim import workers
from uwsim.bench.definition import Variant
from uwsim.bench.kept import Scores
from uwsim.bench.task import Case, Task

# of the libraries that algorithms call: in worker processes one each, or they stand in each other's way
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """What a worker process must know: the task's name, what opens the dataset, and which algorithms take part."""

    task: str
    open_dataset: Callable[[], object]
    choices: tuple[str, ...]
    variants: Mapping[str, Variant]


def scores_of(task: Task, case: Case, algorithms: list, *, warm: bool) -> Scores:
    """Return the scores of a case by algorithm; not `warm`: each is called once before, off the clock."""
    found = {}
    for algorithm in algorithms:
        score = partial(task.score, algorithm.module, algorithm.name, algorithm.given, case)
        if not warm:  # lazy imports and caches are not the method's time
            score()
        found[algorithm.name] = score()
    return found


def by_workers(job: Job, cases: list[str], *, processes: int) -> Iterator[tuple[str, Scores]]:
    """Yield (case, its scores) as they are done, scored by processes of one thread each."""
    tasks = [(case,) for case in cases]
    with _one_thread_each():
        for number, scores in workers.results(
            _score, tasks, processes=processes, option="--workers", prepare=(_begin, job)
        ):
            yield cases[number], scores


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class _Worker:
    """What a worker process has loaded."""

    def __init__(self, job: Job):
        from uwsim.bench.run import TASKS, load

        self.task, self.dataset, self.warm = TASKS[job.task], job.open_dataset(), False
        loaded = [load(self.task, choice, job.variants) for choice in job.choices]
        self.algorithms = [algorithm for algorithm in loaded if not algorithm.missing]


_worker: _Worker | None = None


def _begin(job: Job) -> None:
    global _worker
    _worker = _Worker(job)


def _score(case: str) -> Scores:
    found = scores_of(_worker.task, _worker.task.case(_worker.dataset, case), _worker.algorithms, warm=_worker.warm)
    _worker.warm = True
    return found
