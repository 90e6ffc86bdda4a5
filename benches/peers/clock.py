"""Times of a call: wall time, and processor time, which other programs on the machine do not lengthen."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Timing:
    median_s: float
    fastest_s: float
    cpu_s: float
    repeats: int


def timing(call: Callable[[], Any], repeats: int) -> Timing:
    """Median and fastest of `repeats` calls and their mean processor time, one call before as a warm-up."""
    call()
    seconds = []
    cpu = time.process_time()
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    cpu = (time.process_time() - cpu) / repeats
    return Timing(median(seconds), min(seconds), cpu, repeats)


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """What one call gives, and its time (s)."""
    start = time.perf_counter()
    return call(), time.perf_counter() - start
