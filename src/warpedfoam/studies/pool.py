"""Where members of an ensemble are computed: in this process, or by dask on workers near or far."""

from __future__ import annotations

import importlib.util
import logging
import os
import secrets
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from warpedfoam.studies.member import MACHINE_FAULTS, Outcome, Task, compute, lost

#: Tasks handed out at a time, for each thread and at least.
AHEAD, LEAST_AHEAD = 3, 16
#: Packages of the extra ``ensemble``.
NEEDED = ("distributed", "pyarrow", "threadpoolctl")
#: Environment of local workers: numpy is imported after this is set.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "VECLIB", "NUMEXPR")}


def require_packages() -> None:
    """Say which extra is missing, before any work.

    Raises
    ------
    ModuleNotFoundError
        If a package of the extra ``ensemble`` is not installed.
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise ModuleNotFoundError(
            f"ensembles need {', '.join(missing)}: pip install 'warpedfoam[ensemble]'", name=missing[0]
        )


def computed(tasks: Iterable[Task], *, workers: int | None, scheduler: str | None) -> Generator[Outcome]:
    """Compute tasks and yield their outcomes in the order in which they finish.

    Parameters
    ----------
    tasks : iterable of Task
    workers : int or None
        Processes on this machine, one per available processor by default; 0 computes here.
    scheduler : str or None
        Address of a dask scheduler whose workers are used instead.

    Raises
    ------
    OSError
        If the scheduler cannot be reached, or is lost.
    RuntimeError
        If a worker cannot run tasks at all, such as one without warpedfoam.
    """
    if scheduler is None and workers == 0:
        for task in tasks:
            try:
                outcome = compute(task)
            except MACHINE_FAULTS as fault:
                outcome = lost(task, fault)
            yield outcome
        return
    with _client(workers, scheduler) as client:
        yield from _gathered(client, iter(tasks))


def available_processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    import dask
    from distributed import Client

    alone = {"set_as_default": False}
    settings = {
        # without dask's own MALLOC_TRIM_THRESHOLD_: giving memory back all the time costs a third of it
        "distributed.nanny.pre-spawn-environ": ONE_THREAD,
        # memory is the system's affair: a worker paused or ended at some share of it would change the table
        "distributed.worker.memory.terminate": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.target": False,
    }
    with _quiet("distributed"), dask.config.set(settings):
        if scheduler is not None:
            with Client(scheduler, timeout=20, **alone) as client:
                yield client
            return
        with _local(workers or available_processors()) as cluster, Client(cluster, **alone) as client:
            yield client


def _local(workers: int) -> Any:
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        )
    except RuntimeError as fault:
        raise ChildProcessError(
            f"the worker processes did not start ({fault}); a script that uses them must guard its calls by "
            "if __name__ == '__main__'; what was finished before is kept"
        ) from fault


def _gathered(client: Any, tasks: Iterator[Task]) -> Iterator[Outcome]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    # a name of its own: another client of the same scheduler may compute the same study
    token = secrets.token_hex(4)
    waiting: dict[str, Task] = {}
    done = as_completed(loop=client.loop, raise_errors=False)

    def fill() -> None:
        ahead = max(LEAST_AHEAD, AHEAD * sum(client.nthreads().values()))
        while len(waiting) < ahead and (task := next(tasks, None)) is not None:
            future = client.submit(compute, task, key=f"warpedfoam-{task.key}-{token}", pure=False)
            waiting[future.key] = task
            done.add(future)

    fill()
    while waiting:
        future = next(done)
        task = waiting.pop(future.key)
        yield _outcome(future, task, KilledWorker)
        future.release()
        fill()


def _outcome(future: Any, task: Task, killed: type[Exception]) -> Outcome:
    if future.status in ("cancelled", "lost"):
        raise ConnectionError("the scheduler is lost; what is finished is kept: start again to go on")
    if future.status != "error":
        outcome: Outcome = future.result()
        return outcome
    fault = future.exception()
    if isinstance(fault, killed):
        return lost(task, "its worker died again and again")
    if isinstance(fault, MACHINE_FAULTS):
        return lost(task, fault)
    raise RuntimeError(
        f"a worker cannot compute foams: {type(fault).__name__}: {fault}; workers need the warpedfoam of "
        "this machine with its extra ensemble"
    )


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keep dask's log of workers that come and go off the terminal."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
