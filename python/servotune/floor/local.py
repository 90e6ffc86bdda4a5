"""The threads of this process as an engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager

from servotune.floor.task import Found, Spread, Task


@contextmanager
def engine(workers: int) -> Iterator[Spread]:
    """So many threads; 0 for as many as there are cores."""
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:

        def spread(task: Task, batches: list[list[int]]) -> Iterator[Found]:
            # The interpreter is free while a slot is worked on.
            for done in as_completed([pool.submit(task, batch) for batch in batches]):
                yield done.result()

        yield spread
