"""The threads of this process as an engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed

from servotune.floor.task import Task


def spread(task: Task, batches: list[list[int]], workers: int) -> Iterator[list[tuple[int, str]]]:
    """Results of every batch, as they come."""
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        # The interpreter is free while a slot is worked on.
        for done in as_completed([pool.submit(task, batch) for batch in batches]):
            yield done.result()
