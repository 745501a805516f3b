"""Runs a function on many tasks, on all processors, with a progress bar on a terminal."""

import multiprocessing
import os
import sys
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
        # A forked child would inherit the locks of the parent's BLAS threads.
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
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
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        try:
            for future in as_completed([pool.submit(function, task) for task in tasks]):
                yield future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
