"""Dask as an engine: one task for each batch of slots."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from servotune.floor.task import Found, Spread, Task

#: Workers that a batch may lose before it is given up.
TRIES = 10
#: A worker's process that dies is started again by its nanny. Dask looks for it so long after each death, and gives its place up for good where it is
#: just starting again: under many deaths it has no worker left after a while. So long as a floor lasts it does not look.
LOOKS_AFTER = "30 days"


@contextmanager
def engine(workers: int) -> Iterator[Spread]:
    """The client that the process already has; else a cluster of so many processes on this machine, as long as the run lasts."""
    import dask
    from distributed import Client, LocalCluster, as_completed, get_client

    with ExitStack() as stack:
        try:
            client = get_client()
        except ValueError:
            own = {
                "scheduler.allowed-failures": TRIES,
                # A death is charged to every batch that the worker has: it has the one that it works on.
                "scheduler.worker-saturation": 1.0,
                "deploy.lost-worker-timeout": LOOKS_AFTER,
            }
            stack.enter_context(dask.config.set({f"distributed.{key}": value for key, value in own.items()}))
            cluster = LocalCluster(n_workers=workers or None, threads_per_worker=1, dashboard_address=None)
            client = stack.enter_context(Client(stack.enter_context(cluster)))

        def spread(task: Task, batches: list[list[int]]) -> Iterator[Found]:
            # Each batch carries the library: a batch that waits for anything of another worker was seen to wait for ever once that worker had died.
            for future in as_completed(client.map(task, batches, key="slots", pure=False, retries=TRIES)):
                yield future.result()
                # What came back is in the store: neither side keeps it.
                future.release()

        yield spread
