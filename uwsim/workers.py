"""Worker processes that do independent tasks side by side, end with their parent, and fail in one line."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process


class Killed(ValueError):
    """A worker process was killed; `unfinished`: numbers of the tasks that were begun, or about to be."""

    def __init__(self, message: str, unfinished: list[int]):
        super().__init__(message)
        self.unfinished = unfinished


def results(
    function: Callable, tasks: Sequence[tuple], *, processes: int, option: str, prepare: tuple = ()
) -> Iterator[tuple[int, object]]:
    """Yield (number of the task, what `function(*task)` returns) as the tasks are done, in any order.

    `prepare`: a function and its arguments, called once in each process before its first task. Function, tasks and
    results are pickled. Raises what a task raises, and `Killed` where a process was killed; `option`: the name that the
    command line has for `processes`, for that message.
    """
    # spawn: a fork would copy the threads' locks of OpenCV and OpenEXR
    with ProcessPoolExecutor(
        processes, mp_context=get_context("spawn"), initializer=_begin, initargs=(prepare,)
    ) as pool:  # fmt: skip
        waiting, running = iter(enumerate(tasks)), {}
        try:
            while True:
                # a few ahead only: what was not begun need not be called off after an error
                while len(running) < 2 * processes and (task := next(waiting, None)):
                    running[pool.submit(function, *task[1])] = task[0]
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    result = future.result()
                    yield running.pop(future), result
        except BrokenProcessPool:
            raise Killed(
                f"{option} {processes}: a process was killed (out of memory?); what was done so far is kept",
                sorted(running.values()),
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _begin(prepare: tuple) -> None:
    """In a worker: one thread; an interrupt is the parent's to answer, and the worker ends with its parent."""
    import signal
    import threading

    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare:
        prepare[0](*prepare[1:])


def _end_with_parent() -> None:
    """Leave at once when the parent was killed: else a new run would meet a worker that still writes."""
    parent_process().join()
    os._exit(1)
