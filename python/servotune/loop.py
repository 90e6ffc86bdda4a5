"""Margins of the open loop, cut at the plant's input."""

from __future__ import annotations

from typing import Any

from servotune import _core
from servotune.controller import controller_of
from servotune.frf import is_sweep, sweep_of
from servotune.numbers import pair
from servotune.plant import plant_of
from servotune.result import Result


class Margins(Result):
    """Crossings and margins of one loop, named and with units as in `servotune margins --json`.

    Of a sweep there are `verdict`, `intervals` (95 %), `band_hz` and `end_gain` beside them; of a plant with physics the margins are the worst over the
    amplitudes, with `linear` beside them.
    """

    __slots__ = ()

    stable: bool
    phase_margin_deg: float | None
    gain_crossover_hz: float | None
    gain_margin_db: float | None
    phase_crossover_hz: float | None
    max_sensitivity: float
    max_sensitivity_hz: float
    modulus_margin: float
    delay_margin_s: float | None
    disk_margin: float
    disk_margin_hz: float
    gain_crossings: list[dict[str, float]]
    phase_crossings: list[dict[str, float]]
    unstable_poles: int

    def __repr__(self) -> str:
        word = "stable" if self.stable else "UNSTABLE"
        return f"Margins({word}, {self.phase_margin_deg} deg, {self.gain_margin_db} dB, Ms {self.max_sensitivity})"


def margins(
    plant_or_frf: Any,
    controller: Any,
    *,
    amplitudes: tuple[float, float] = (0.15, 15.0),
    hold_included: bool = False,
) -> Margins:
    """Margins of a plant model's or of a measured response's loop.

    plant_or_frf  : `Plant`, `Frf`, a path of a plant.toml, or a python-control system or `FRD`
    amplitudes    : position_unit, where physics beyond linear is described
    hold_included : the sweep was taken through the controller's own hold
    """
    law = controller_of(controller)._core
    if is_sweep(plant_or_frf):
        return Margins(_core.margins_of_sweep(sweep_of(plant_or_frf)._core, law, hold_included))
    return Margins(_core.margins_of_model(plant_of(plant_or_frf)._core, law, *pair(amplitudes, "amplitudes")))
