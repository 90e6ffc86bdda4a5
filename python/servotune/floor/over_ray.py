"""Ray Data as an engine: one block for each batch of slots."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pyarrow as pa

from servotune.floor.task import Found, Spread, Task

#: Workers that a batch may lose before it is given up; Ray Data by itself goes on for ever.
TRIES = 10


@contextmanager
def engine(workers: int) -> Iterator[Spread]:
    """The cluster that the process is already part of; else a new one of so many cores on this machine, or of 0 the one that Ray finds or starts."""
    import ray
    import ray.data

    own = not ray.is_initialized()
    if own:
        # A number of workers asks for a cluster of that size, whatever else runs on this machine.
        asked = {"address": "local", "num_cpus": workers, "include_dashboard": False} if workers else {}
        ray.init(**asked, log_to_driver=False)
    ray.data.DataContext.get_current().enable_progress_bars = False

    def spread(task: Task, batches: list[list[int]]) -> Iterator[Found]:
        def work(batch: pa.Table) -> pa.Table:
            found = task(batch.column("place").to_pylist())
            return pa.table({"place": [place for place, _ in found], "text": [text for _, text in found]})

        blocks = [pa.table({"place": batch}) for batch in batches]
        slots = ray.data.from_arrow(blocks).map_batches(
            work, batch_format="pyarrow", batch_size=None, ray_remote_args_fn=lambda: {"max_retries": TRIES}
        )
        # Nothing is held back here: what has come is in the store when a later batch is given up.
        for part in slots.iter_batches(batch_size=None, batch_format="pyarrow", prefetch_batches=0):
            yield list(zip(part.column("place").to_pylist(), part.column("text").to_pylist()))

    try:
        yield spread
    finally:
        if own:
            ray.shutdown()
