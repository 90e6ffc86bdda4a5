"""Dask as an engine: one task for each batch of slots."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from servotune.floor.task import Found, Spread, Task

#: Workers that a batch may lose before it is given up.
TRIES = 10


@contextmanager
def engine(workers: int) -> Iterator[Spread]:
    """The client that the process already has; else a cluster of so many processes on this machine, as long as the run lasts."""
    import dask
    from distributed import Client, LocalCluster, as_completed, get_client

    with ExitStack() as stack:
        try:
            client = get_client()
        except ValueError:
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": TRIES}))
            cluster = LocalCluster(n_workers=workers or None, threads_per_worker=1, dashboard_address=None)
            client = stack.enter_context(Client(stack.enter_context(cluster)))

        def spread(task: Task, batches: list[list[int]]) -> Iterator[Found]:
            # The library goes to every worker once. It is a task of its own, not scattered: what is scattered is gone with the workers that hold it.
            shared = client.submit(handed, task, pure=False, retries=TRIES)
            for future in as_completed(client.map(call, batches, task=shared, pure=False, retries=TRIES)):
                yield future.result()
                # What came back is in the store: neither side keeps it.
                future.release()

        yield spread


def handed(task: Task) -> Task:
    """The task itself."""
    return task


def call(batch: list[int], task: Task) -> Found:
    """One batch on a worker."""
    return task(batch)
