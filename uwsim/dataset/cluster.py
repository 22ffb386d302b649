"""Frames of a dataset made by the workers of a Dask cluster (`uwsim[cluster]`), which share the dataset's folder.

Dask gives the frames of a lost worker to another one. Workers should be processes of their own (`dask worker
--nthreads 1 --nworkers 4`): one process makes one frame at a time.
"""

import functools
import platform
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from uwsim import provenance
from uwsim.dataset.runners import Records, prepare
from uwsim.dataset.task import Task, failed, finish

_CONNECT_S = 20
_ONE_AT_A_TIME = threading.Lock()  # Mitsuba's variant and Dr.Jit's thread count belong to the process


def on_cluster(
    tasks: Sequence[Task], *, address: str, dataset: Path, variant: str | None = None, threads: int | None = None
) -> Records:
    """Yield the record of each task as it is made by a worker of the cluster whose scheduler is at `address`.

    dataset: the folder, which the workers must see at the same path. threads: for rendering, of each worker; None:
    as many as Dask counts for it. A frame whose workers died (three, as Dask is set) gets the record of a failure; a
    worker whose processor is of another kind than this one gets a warning, `mixed` in its record.

    Raises ValueError where the package or the scheduler is missing or lost, and where a worker does not see the folder
    or has other versions of what makes the bytes.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ValueError('--cluster: needs the package distributed; type: pip install "uwsim[cluster]"') from None
    expected = {"dataset": str(Path(dataset).resolve()), "versions": _versions(), "processor": _processor()}
    try:
        client = Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise ValueError(f"--cluster: no scheduler at {address}: {' '.join(str(error).split())}") from None
    with client:
        yield from _records(client, tasks, address=address, args=(expected, variant, threads))


def _records(client, tasks: Sequence[Task], *, address: str, args: tuple) -> Iterator[dict]:
    from distributed import as_completed
    from distributed.client import FutureCancelledError
    from distributed.scheduler import KilledWorker

    of = {}
    for task in tasks:
        absolute = Task(**vars(task) | {"folder": task.folder.resolve()})
        # a key of its own for every run: the scheduler must not hand out what an earlier run said
        of[client.submit(_on_worker, absolute, *args, pure=False)] = task
    for future in as_completed(list(of)):
        task = of.pop(future)
        try:
            yield future.result()
        except KilledWorker as killed:
            yield failed(task, f"the workers that made it died; the last was {killed.last_worker.address}")
        except FutureCancelledError:
            raise ValueError(f"--cluster: the scheduler at {address} was lost; go on with --resume") from None
        future.release()


def _on_worker(task: Task, expected: dict, variant: str | None, threads: int | None) -> dict:
    """Make a frame in a worker of the cluster, if it would make it as the others do."""
    from distributed import get_worker

    worker = get_worker()
    if not (Path(expected["dataset"]) / "dataset.json").is_file():
        raise ValueError(
            f"--cluster: worker {worker.address} does not see {expected['dataset']}, allowed: a folder that "
            "all workers share, at the same path"
        )
    if (versions := _versions()) != expected["versions"]:
        here = expected["versions"]
        name = next(name for name in here if versions.get(name) != here[name])
        raise ValueError(
            f"--cluster: worker {worker.address} has {name} {versions.get(name)}, allowed: {here[name]}, as here"
        )
    with _ONE_AT_A_TIME:
        prepare(variant, threads or worker.state.nthreads)
        record = finish(task) | {"worker": worker.address}
    return record if _processor() == expected["processor"] else record | {"mixed": _processor()}


@functools.cache
def _versions() -> dict[str, str]:
    """Return the versions that the bytes of a frame depend on, that of libLLVM among them."""
    from uwsim.render import llvm

    found = provenance.versions()
    names = ("uwsim", "python", *provenance.PACKAGES)
    return {name: found[name] for name in names if name in found} | {"libLLVM": str(llvm.choose().version)}


@functools.cache
def _processor() -> str:
    """Return what of the processor the bytes depend on, as text."""
    features = provenance.cpu_features()
    return f"{platform.machine()}, vectors of {provenance.vector_width(features)}, {' '.join(features)}"
