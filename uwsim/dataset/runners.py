"""Who makes the frames of a dataset: this process, or worker processes of this machine (`cluster`: of many)."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from uwsim import workers
from uwsim.dataset.task import Task, failed, finish

Records = Iterator[dict]
Progress = Callable[[int, int, str, int, int], None]  # frames begun before, frames, picture, done, total
_KILLED = "its process was killed (out of memory?), twice"


def here(tasks: Sequence[Task], *, progress: Progress | None = None) -> Records:
    """Yield the record of each task, made one after the other in this process."""
    for number, task in enumerate(tasks):
        yield finish(task, progress=None if progress is None else partial(progress, number, len(tasks)))


def by_processes(
    tasks: Sequence[Task], *, processes: int, threads: int, variant: str | None = None,
    make: Callable[[Task], dict] = finish,
) -> Records:  # fmt: skip
    """Yield the record of each task as it is made by one of several processes of `threads` rendering threads each.

    Frames that were in the making when a process was killed are made again, each in a process of its own; one that is
    killed there too gets the record of a failure. `make`: what a process does with a task.
    """
    pool = partial(workers.results, make, option="--workers", prepare=(prepare, variant, threads))
    left = dict(enumerate(tasks))
    while left:
        numbers = list(left)
        try:
            for place, record in pool([(left[number],) for number in numbers], processes=min(processes, len(left))):
                yield record
                del left[numbers[place]]
        except workers.Killed as killed:
            for place in killed.unfinished:
                yield _alone(pool, left.pop(numbers[place]))


def _alone(pool: Callable, task: Task) -> dict:
    try:
        return next(record for _, record in pool([(task,)], processes=1))
    except workers.Killed:
        return failed(task, _KILLED)


def prepare(variant: str | None, threads: int) -> None:
    """Make this process ready to render: a variant of Mitsuba, and a number of threads."""
    from uwsim.render import variants

    variants.use(variant)
    variants.set_threads(threads)
