"""A spiral write and its position error."""

from __future__ import annotations

from typing import Any

import numpy as np

from servotune import _core
from servotune.controller import controller_of
from servotune.document import PathLike, text_of
from servotune.plant import plant_of
from servotune.result import Result


class Simulation(Result):
    """PES of a write at the servo clock, and its DFT, as in `servotune simulate --json`."""

    __slots__ = ()

    stable: bool
    limited: bool
    position_unit: str
    sample_rate_hz: float
    harmonics: list[dict[str, float]]
    pes_range: float
    pes_std: float

    @property
    def pes(self) -> np.ndarray:
        """PES (position_unit), one value a servo sample; empty where it did not stay finite."""
        return np.array(self._read()["pes"])

    @property
    def time_s(self) -> np.ndarray:
        """Times of the PES (s)."""
        return np.arange(len(self._read()["pes"])) / self.sample_rate_hz


def simulate(plant: Any, controller: Any, profile: PathLike) -> Simulation:
    """Simulates the write of a profile.toml (a path, or its text)."""
    text, name = text_of(profile, "profile")
    return Simulation(_core.simulate(plant_of(plant)._core, controller_of(controller)._core, text, name))
