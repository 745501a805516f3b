"""Runs a function on many tasks, on all processors, with a progress bar on a terminal."""

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from tqdm import tqdm

Task = TypeVar("Task")
Result = TypeVar("Result")


def results(function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[Result]:
    """Returns the results in the order of the tasks.

    Args:
        function: at module level, for other processes.
        tasks: its arguments.
    """
    workers = min(len(tasks), os.cpu_count() or 1)
    with tqdm(total=len(tasks), unit="run", disable=not sys.stderr.isatty()) as bar:
        if workers < 2:
            for task in tasks:
                yield function(task)
                bar.update()
            return
        with _pool(workers) as pool:
            for result in pool.map(function, tasks):
                yield result
                bar.update()


def finished(
    function: Callable[[Task], Result], tasks: Sequence[Task], workers: int
) -> Iterator[Result]:
    """Yields the results as they come, so that an interrupted run keeps those it has.

    Args:
        function: at module level, for other processes.
        tasks: its arguments.
        workers: processes; 1 = this one.
    """
    if workers == 1:
        yield from map(function, tasks)
        return
    with _pool(workers) as pool:
        try:
            for future in as_completed([pool.submit(function, task) for task in tasks]):
                yield future.result()
        except BaseException:
            # Nobody waits for what has begun. At the end the pool is waited for: a thread of it
            # that was left behind found its pipe closed when the program ended.
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _pool(workers: int) -> ProcessPoolExecutor:
    # A forked child would inherit the locks of the parent's BLAS threads.
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, spawn, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """Ends this process when the one that started it is gone, however that ended.

    A worker holds both ends of the queue of its tasks, and would wait for ever.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
