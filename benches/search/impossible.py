"""Specs that cannot be met, each with the argument that says so."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from plant import Machine

if TYPE_CHECKING:
    from specs import Maker

KINDS = ("sensitivity", "phase", "sensitivity", "phase", "complement")


def draw(rng: np.random.Generator, maker: Maker, index: int) -> tuple[Machine, dict, str]:
    """A machine, a spec that no controller of its structure can meet on it, and why."""
    make = {"sensitivity": sensitivity, "phase": phase, "complement": complement}[KINDS[index % len(KINDS)]]
    names = list(maker.every)
    while True:
        m = maker.every[str(rng.choice(names))]
        crossing = math.sqrt(m.crossover_hz[0] * m.crossover_hz[1])
        spec: dict = {"sample_time_s": m.sample_time_s, "guard": 0.0}
        spec["objective"] = {"minimise": str(rng.choice(["disturbance", "bandwidth", "integral", "room"]))}
        if spec["objective"]["minimise"] == "disturbance":
            spec["disturbance"] = {"rms": 1.0, "corner_hz": 0.1 * crossing}
        why = make(rng, maker, m, spec, crossing)
        if why:
            return m, spec, why


def complement(rng: np.random.Generator, maker: Maker, m: Machine, spec: dict, crossing: float) -> str | None:
    """T is 1 at an unstable pole and carries the plant's delay of whole samples: its largest value has a floor above 1."""
    unstable, nyquist = m.plant.unstable_poles(), 0.5 / m.sample_time_s
    if not unstable:
        return None
    late = maker.bench(m).loop.s.whole + 1
    floor = 20 * sum(p.real for p in unstable) * m.sample_time_s * late / math.log(10)
    db = floor - rng.uniform(0.2, 0.8)
    spec["margins"] = {"max_sensitivity": 4.0}
    hz = [crossing * 1e-4, 0.999999 * nyquist]
    spec["limits"] = {"curve": [{"of": "T", "side": "at_most", "hz": hz, "db": [db, db]}]}
    spec["search"] = {"seed": 1, "notches": 1, "lowpasses": 1}
    return f"T is 1 at the unstable pole and late by {late} samples: its largest value is at least {floor:.4f} dB"


def sensitivity(rng: np.random.Generator, _maker: Maker, m: Machine, spec: dict, _crossing: float) -> str | None:
    """The integral of ln|S| over (0, half the clock) is 0 for a stable law on a stable plant: a floor that is too deep and too wide."""
    if m.plant.unstable_poles():
        return None
    nyquist = 0.5 / m.sample_time_s
    most, depth = rng.uniform(1.2, 1.7), rng.uniform(12.0, 30.0)
    down = depth / 20 * math.log(10)
    high = 1.15 * math.log(most) / (down + math.log(most)) * nyquist
    low = 0.02 * high
    if high > 0.8 * nyquist or down * (high - low) <= math.log(most) * (nyquist - (high - low)):
        return None
    spec["margins"] = {"max_sensitivity": most}
    spec["limits"] = {"curve": [{"of": "S", "side": "at_most", "hz": [low, high], "db": [-depth, -depth]}]}
    spec["search"] = {"seed": 1, "notches": 2, "lowpasses": 1}
    return "the integral of ln|S| up to half the clock is 0; this limit needs it below 0"


def phase(rng: np.random.Generator, maker: Maker, m: Machine, spec: dict, crossing: float) -> str | None:
    """A PID turns the phase by more than -90 and less than 90 deg - wT/2, and without filters nothing else does."""
    if m.plant.unstable_poles():
        return None
    low, high = crossing, 1.8 * crossing
    b = maker.bench(m).loop
    w = 2 * math.pi * np.geomspace(low, high, 20_000)
    w = np.unique(np.concatenate([w, b.w[(b.w >= w[0]) & (b.w <= w[-1])]]))
    alone = np.degrees(np.angle(-b.s.response(w)))
    most = np.where(abs(alone) >= 90, 180.0, alone + 90 - np.degrees(w * m.sample_time_s / 2)).max()
    asked = float(most) + rng.uniform(2.0, 6.0)
    if not 25 <= asked <= 100:
        return None
    spec["margins"] = {"phase_margin_deg": asked, "gain_crossover_hz": [low, high]}
    spec["search"] = {"seed": 1, "notches": 0, "lowpasses": 0}
    spec["structure"] = {"controller": "pid"}
    return f"no PID without filters has more than {most:.2f} deg with a crossover between {low:.4g} and {high:.4g} Hz"
