"""Runs a fleet's flights on a Dask cluster; finished flights are not repeated."""

import itertools
import logging
import secrets
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import dask
import orjson
from distributed import Client, KilledWorker, LocalCluster, as_completed

from h2nav.airframes.odometer import ComponentChange
from h2nav.errors import BadInput
from h2nav.fleet.index import write_index
from h2nav.fleet.sources import FlightSource
from h2nav.fleet.store import Store
from h2nav.fleet.tables import TableRow, write_tables
from h2nav.fleet.work import MIB, RESULTS, Limits, Review, Task, do_flight

# Flights known to the scheduler per worker: enough to keep all workers busy, few enough for any
# number of flights.
_AHEAD = 4
# The scheduler also counts deaths of workers at which a flight was only queued.
_MAX_TRIES = 10
_CONNECT_S = 10.0
# Memory of a worker's process beyond the limit of a flight, before its nanny kills it.
_NANNY_SHARE = 1.1

OnFinished = Callable[[Task, Mapping[str, Any]], object]


class Work(NamedTuple):
    """What to do with each flight."""

    review: Review  # the function; importable on the workers
    version: str  # changes when its results would: digest of the program, and options
    limits: Limits  # per flight


class TaskOutcome(NamedTuple):
    """The result of a fleet run."""

    rows: list[TableRow]  # one per flight, in the order of their addresses
    done_before: int  # flights whose results existed already
    # ``wall_s``, ``cpu_s`` and ``peak_mib`` of the flights done in this run
    costs: list[dict[str, float]]


@contextmanager
def cluster(scheduler: str | None, workers: int, memory_mib: int) -> Iterator[Client]:
    """Connects to an existing cluster, or starts a local one.

    Args:
        scheduler: address of an existing one, such as ``tcp://host:8786``; None = a local one.
        workers: processes of the local cluster, each with one thread.
        memory_mib: of each.

    Raises:
        BadInput: no scheduler answers at `scheduler`.
    """
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            said = " ".join(str(error).split())
            raise BadInput(f"{scheduler}: {said}; start one with: dask scheduler") from None
        with client:
            yield client
        return
    settings = {
        "distributed.scheduler.worker-saturation": 1.0,  # queued flights stay free to be assigned
        # Pausing or spilling workers does not help: a flight fits, or its watch gives it up.
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": 1.0,
        "distributed.comm.timeouts.connect": "60s",
        # On a busy machine a worker restarts slowly; the cluster must not drop it.
        "distributed.deploy.lost-worker-timeout": "600s",
    }
    with (
        dask.config.set(settings),
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            memory_limit=round(memory_mib * MIB * _NANNY_SHARE),
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            preload=["h2nav.fleet.interrupts"],
            silence_logs=logging.CRITICAL,
        ) as own,
        Client(own, set_as_default=False) as client,  # type: ignore[no-untyped-call]
    ):
        yield client


def run_fleet(
    client: Client,
    sources: Sequence[FlightSource],
    work: Work,
    store: Store,
    on_finished: OnFinished,
    changes: Sequence[ComponentChange] = (),
) -> TaskOutcome:
    """Reviews every flight without a result, and writes tables and index of all flights.

    Args:
        sources: in the order of their addresses.
        store: receives the results; the workers must be able to write to it.
        on_finished: called with each finished flight, earlier ones first.
        changes: components that were put in, for the odometer.

    Raises:
        BadInput: the workers' results do not arrive in `store`.
    """
    limits = f"{work.limits.time_s:g} s {work.limits.memory_mib} MiB"
    run = secrets.token_hex(8)
    tasks = [Task(source, source.key(work.version, limits), run) for source in sources]
    there = store.names(RESULTS)
    waiting = [task for task in tasks if f"{task.key}.json" not in there]
    for task in tasks:
        if f"{task.key}.json" in there:
            on_finished(task, {})
    passing: dict[str, Mapping[str, Any]] = {}
    costs: list[dict[str, float]] = []
    for task, result in _results(client, waiting, work, store):
        if result.get("transient"):
            passing[task.key] = result
        elif not costs:
            _require_shared(store, task)
        if "cost" in result:
            costs.append(result["cost"])
        on_finished(task, result)
    with tempfile.TemporaryDirectory(prefix="h2nav-fleet-") as name:
        rows = write_tables(_in_order(tasks, passing, store), Path(name), store, changes)
    write_index(rows, store)
    return TaskOutcome(rows, len(tasks) - len(waiting), costs)


def _results(
    client: Client, tasks: Sequence[Task], work: Work, store: Store
) -> Iterator[tuple[Task, Mapping[str, Any]]]:
    """Yields results as they come; the scheduler holds only a few tasks at a time."""
    upcoming = iter(tasks)
    running: dict[str, tuple[Task, int]] = {}

    def submit(task: Task, tries: int = 1) -> Any:
        # The same name in every run, so that a task left at the scheduler is joined.
        key = f"flight-{task.key}-{tries}"
        running[key] = (task, tries)
        return client.submit(do_flight, task, work.review, store, work.limits, key=key, pure=False)

    ahead = _AHEAD * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    first = [submit(task) for task in itertools.islice(upcoming, ahead)]
    completed = as_completed(first, loop=client.loop)  # type: ignore[no-untyped-call]
    for future in completed:
        task, tries = running.pop(future.key)
        result = _result(future)
        future.release()
        if result is None and tries < _MAX_TRIES:
            completed.add(submit(task, tries + 1))  # type: ignore[no-untyped-call]
            continue
        yield task, result or {"error": "workers died at every attempt", "transient": True}
        following = next(upcoming, None)
        if following is not None:
            completed.add(submit(following))  # type: ignore[no-untyped-call]


def _result(future: Any) -> Mapping[str, Any] | None:
    """The result of a task; None where the scheduler gave up because workers died."""
    try:
        result: Mapping[str, Any] = future.result()
    except KilledWorker:
        return None
    except Exception as error:  # the store's, on the worker
        said = " ".join(str(error).split())
        return {"error": f"no result: {type(error).__name__}: {said}", "transient": True}
    return result


def _require_shared(store: Store, task: Task) -> None:
    """Raises BadInput if a worker's result is not visible here."""
    if store.read(task.result_name) is None:
        raise BadInput(
            f"{store.address}: the workers' results do not arrive there; name a folder that all "
            "machines share, or an address such as s3://bucket/fleet"
        )


def _in_order(
    tasks: Sequence[Task], passing: Mapping[str, Mapping[str, Any]], store: Store
) -> Iterator[tuple[Task, Mapping[str, Any]]]:
    written = store.read_all(task.result_name for task in tasks if task.key not in passing)
    stored = iter(written)
    for task in tasks:
        yield task, passing[task.key] if task.key in passing else orjson.loads(next(stored)[1])
