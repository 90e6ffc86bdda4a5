"""What a worker does: places in, pilots or rows out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

from servotune import _core

#: Place and JSON of each slot of a batch.
Found = list[tuple[int, str]]


@dataclass(frozen=True)
class Task:
    """Work on the slots of a FLEET.toml; it goes to a worker whole.

    fleet   : path of the FLEET.toml, readable where the worker runs
    library : the library (JSON); without one the work is on pilots
    """

    fleet: str
    library: str | None = None

    def __call__(self, places: list[int]) -> Found:
        """Place and JSON of each, on the calling thread."""
        made = hand(self.fleet, self.library)
        one = made.pilot if self.library is None else made.row
        return [(int(place), one(int(place), 1)) for place in places]


#: An engine that was started: what a task finds for each of some batches of places, as it comes, in any order, some of it twice if need be.
Spread = Callable[[Task, list[list[int]]], Iterator[Found]]


@lru_cache(maxsize=2)
def hand(fleet: str, library: str | None) -> _core.FloorHand:
    """Settings, slots and library, read once in each process."""
    return _core.FloorHand(fleet, library)
