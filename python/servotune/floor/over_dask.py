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
            # Each batch carries the library: a batch that waits for anything of another worker was seen to wait for ever once that worker had died.
            for future in as_completed(client.map(task, batches, key="slots", pure=False, retries=TRIES)):
                yield future.result()
                # What came back is in the store: neither side keeps it.
                future.release()

        yield spread
