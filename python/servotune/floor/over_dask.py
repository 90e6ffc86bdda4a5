"""Dask as an engine: one task for each batch of slots."""

from __future__ import annotations

from collections.abc import Iterator

from servotune.floor.task import Task


def spread(task: Task, batches: list[list[int]], workers: int) -> Iterator[list[tuple[int, str]]]:
    """Results of every batch, as they come. The client that the process already has is used; else a cluster starts on this machine."""
    from distributed import Client, LocalCluster, as_completed, get_client

    try:
        client, own = get_client(), None
    except ValueError:
        own = LocalCluster(n_workers=workers or None, threads_per_worker=1, dashboard_address=None)
        client = Client(own)
    try:
        # The library goes to every worker once.
        shared = client.scatter(task, broadcast=True)
        futures = client.map(call, batches, task=shared, pure=False, retries=10)
        for future in as_completed(futures):
            yield future.result()
    finally:
        if own is not None:
            client.close()
            own.close()


def call(batch: list[int], task: Task) -> list[tuple[int, str]]:
    """One batch on a worker."""
    return task(batch)
