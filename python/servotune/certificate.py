"""A gain table proved again, independently of the search."""

from __future__ import annotations

import html
from typing import Any

from servotune import _core
from servotune.document import text_of
from servotune.frf import is_sweep, sweep_of
from servotune.plant import plant_of
from servotune.result import Result
from servotune.spec import spec_of
from servotune.tuning import Tuned


class Certificate(Result):
    """The document of `servotune verify --json`."""

    __slots__ = ("words",)

    proved: bool
    cases: list[dict[str, Any]]
    findings: list[dict[str, Any]]

    def __init__(self, answer: Any, words: str) -> None:
        super().__init__(answer)
        self.words = words

    def __str__(self) -> str:
        return self.words

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.words)}</pre>"


def verify(
    gains: Any,
    plant: Any,
    spec: Any,
    uncertainty: dict[str, float] | None = None,
    *,
    min_damping: float = 0.005,
    hold_included: bool = False,
    fixed_point: tuple[int, int] | None = None,
    single: bool = False,
) -> Certificate:
    """Proves a gain table at every frequency, on every machine given.

    gains       : path or text of a gains.toml, or a `Tuned`
    plant       : a plant, a sweep, or a list of them that must all pass
    uncertainty : shares of a box around every plant: gain, frequency, damping, delay
    min_damping : of a sweep: no mode has less
    fixed_point : coefficients are held in words of (bits, bits behind the point)
    single      : coefficients are held in single precision
    """
    text, name = (gains.gains, "gains.toml") if isinstance(gains, Tuned) else text_of(gains, "gains")
    machines = plant if isinstance(plant, (list, tuple)) else [plant]
    plants = [plant_of(m)._core for m in machines if not is_sweep(m)]
    sweeps = [sweep_of(m)._core for m in machines if is_sweep(m)]
    of = spec_of(spec)._core
    return Certificate(
        *_core.verify(text, name, plants, sweeps, of, uncertainty, min_damping, hold_included, fixed_point, single)
    )
