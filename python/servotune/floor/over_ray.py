"""Ray Data as an engine: one block for each batch of slots."""

from __future__ import annotations

from collections.abc import Iterator

import pyarrow as pa

from servotune.floor.task import Task


def spread(task: Task, batches: list[list[int]], workers: int) -> Iterator[list[tuple[int, str]]]:
    """Results of every batch, as they come. A cluster that the process is already part of is used; else one starts on this machine."""
    import ray
    import ray.data

    if not ray.is_initialized():
        ray.init(num_cpus=workers or None, include_dashboard=False, log_to_driver=False)
    ray.data.DataContext.get_current().enable_progress_bars = False

    def work(batch: pa.Table) -> pa.Table:
        found = task(batch.column("place").to_pylist())
        return pa.table({"place": [place for place, _ in found], "text": [text for _, text in found]})

    # Ray Data gives a task that lost its worker to another one, as often as it takes.
    blocks = [pa.table({"place": batch}) for batch in batches]
    slots = ray.data.from_arrow(blocks).map_batches(work, batch_format="pyarrow", batch_size=None)
    for part in slots.iter_batches(batch_size=None, batch_format="pyarrow"):
        yield list(zip(part.column("place").to_pylist(), part.column("text").to_pylist()))
