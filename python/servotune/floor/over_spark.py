"""Spark as an engine: `mapInArrow` over one partition for each batch of slots."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager

import pyarrow as pa

from servotune.floor.task import Found, Spread, Task

#: Batches for each core in one job of Spark: what comes back of a job is held by the driver at once.
DEPTH = 4
#: Workers that a batch may lose before it is given up; Spark on one machine gives up at the first, unless it is told.
TRIES = 10


@contextmanager
def engine(workers: int) -> Iterator[Spread]:
    """The session that the process already has; else one of so many cores on this machine, as long as the run lasts."""
    from pyspark.sql import SparkSession

    with ExitStack() as stack:
        session = SparkSession.getActiveSession()
        if session is None:
            # Workers run the interpreter of the driver, unless another one is named.
            os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
            quiet = {"spark.ui.enabled": "false", "spark.ui.showConsoleProgress": "false"}
            master = f"local[{workers or '*'},{TRIES}]"
            session = SparkSession.builder.master(master).appName("servotune").config(map=quiet).getOrCreate()
            stack.callback(session.stop)

        def spread(task: Task, batches: list[list[int]]) -> Iterator[Found]:
            size = DEPTH * session.sparkContext.defaultParallelism
            jobs = [batches[i : i + size] for i in range(0, len(batches), size)]
            # The second job fills the cores that the last batches of the first one leave.
            with ThreadPoolExecutor(2) as pool:
                for done in as_completed([pool.submit(job, session, task, part) for part in jobs]):
                    yield done.result()

        yield spread


def job(session, task: Task, batches: list[list[int]]) -> Found:
    """One job of Spark: a partition for each batch, found by its number."""

    def work(parts: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        for part in parts:
            for number in part.column("id").to_pylist():
                found = task(batches[number])
                yield pa.record_batch({"place": [place for place, _ in found], "text": [text for _, text in found]})

    numbers = session.range(0, len(batches), 1, len(batches))
    rows = numbers.mapInArrow(work, "place long, text string").toArrow()
    return list(zip(rows.column("place").to_pylist(), rows.column("text").to_pylist()))
