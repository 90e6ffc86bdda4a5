"""What a worker does: places in, pilots or rows out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from servotune import _core


@dataclass(frozen=True)
class Task:
    """Work on the slots of a FLEET.toml; it goes to a worker whole.

    fleet   : path of the FLEET.toml, readable where the worker runs
    library : the library (JSON); without one the work is on pilots
    """

    fleet: str
    library: str | None = None

    def __call__(self, places: list[int]) -> list[tuple[int, str]]:
        """Place and JSON of each, on the calling thread."""
        made = hand(self.fleet, self.library)
        one = made.pilot if self.library is None else made.row
        return [(int(place), one(int(place), 1)) for place in places]


@lru_cache(maxsize=2)
def hand(fleet: str, library: str | None) -> _core.FloorHand:
    """Settings, slots and library, read once in each process."""
    return _core.FloorHand(fleet, library)
