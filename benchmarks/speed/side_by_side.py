"""Several calls timed in turns, so that what else the machine does hits all of them alike."""

import statistics
import time
from collections.abc import Callable
from typing import NamedTuple


class Times(NamedTuple):
    """Medians over the turns: CPU and wall seconds, and the CPU time over that of the reference in the same turn."""

    cpu_s: float
    wall_s: float
    times_reference: float


def timed(calls: dict[str, tuple[Callable[[], object], int]], *, reference: str, turns: int) -> dict[str, Times]:
    """Return the times of each call, {name: (call, into how many its time is divided)}; `reference` is one of them.

    The first of the turns, at least 2, fills caches and does not count.
    """
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for turn in range(turns):
        for name, (call, count) in calls.items():
            wall, cpu = time.perf_counter(), time.process_time()
            call()
            taken = (time.process_time() - cpu) / count, (time.perf_counter() - wall) / count
            if turn > 0:
                found[name].append(taken)
    return {
        name: Times(
            statistics.median(cpu for cpu, _ in taken),
            statistics.median(wall for _, wall in taken),
            statistics.median(mine[0] / other[0] for mine, other in zip(taken, found[reference], strict=True)),
        )
        for name, taken in found.items()
    }
