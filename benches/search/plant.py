"""A linear plant as a sum of simple fractions, and the plant.toml that says the same.

P(s) = exp(-delay s) [ sum r_i/(s - p_i) + c2/s^2 + c1/s ]; every pole but a double one at 0 is simple. Written from the file contract alone.
"""

from __future__ import annotations

import cmath
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Plant:
    """Poles and residues: upper halves of pairs, real poles, and the factor of 1/s^2."""

    pairs: tuple[tuple[complex, complex], ...]
    reals: tuple[tuple[float, float], ...]
    double: float = 0.0
    single: float = 0.0
    """Factor of 1/s beside a double pole at rest; 0 where there is none."""
    delay_s: float = 0.0
    position_unit: str = "track"
    command_unit: str = "V"

    def poles(self) -> np.ndarray:
        """Every pole, both halves."""
        upper = [p for p, _ in self.pairs]
        both = upper + [p.conjugate() for p in upper] + [complex(p) for p, _ in self.reals]
        return np.array(both + ([0.0, 0.0] if self.double else []), complex)

    def unstable_poles(self) -> list[complex]:
        """Poles to the right of the axis."""
        return [p for p in self.poles() if p.real > 1e-9]

    def response(self, w_rad_s: np.ndarray) -> np.ndarray:
        """P(j w), delay included, hold not."""
        s = 1j * np.asarray(w_rad_s, float)
        value = self.double / (s * s) + self.single / s
        for p, r in self.pairs:
            value = value + r / (s - p) + r.conjugate() / (s - p.conjugate())
        for p, r in self.reals:
            value = value + r / (s - p)
        return value * np.exp(-s * self.delay_s)


def pair_roots(w: float, d: float) -> list[complex]:
    """Roots of s^2 + 2 d w s + w^2."""
    root = cmath.sqrt(complex(d * d - 1.0))
    return [w * (-d + root), w * (-d - root)]


def from_roots(
    zeros: list[complex], poles: list[complex], gain: float, delay_s: float, units: tuple[str, str]
) -> Plant:
    """gain prod(s - z)/prod(s - p): two poles at 0 at most, every other one simple."""
    at_rest = [p for p in poles if p == 0]
    others = [complex(p) for p in poles if p != 0]
    if len(at_rest) > 2 or len(zeros) >= len(poles):
        raise ValueError("strictly proper, with two poles at rest at most")

    def factors(s: complex, without: int | None) -> complex:
        """gain prod(s - z)/prod(s - p) without the poles at rest and the one named, in an order that keeps it in range."""
        value, up, down = (
            complex(gain),
            sorted(zeros, key=abs),
            sorted((p for i, p in enumerate(others) if i != without), key=abs),
        )
        for i in range(max(len(up), len(down))):
            if i < len(up):
                value *= s - up[i]
            if i < len(down):
                value /= s - down[i]
        return value

    pairs, reals, double, single = [], [], 0.0, 0.0
    for i, p in enumerate(others):
        near = min((abs(p - q) / abs(p) for k, q in enumerate(others) if k != i), default=1.0)
        if near < 1e-9:
            raise ValueError(f"pole {p} stands twice")
        r = factors(p, i) / p ** len(at_rest)
        if abs(p.imag) < 1e-12 * abs(p):
            reals.append((p.real, r.real))
        elif p.imag > 0:
            pairs.append((p, r))
    if at_rest:
        g = factors(0.0, None)
        if len(at_rest) == 1:
            reals.append((0.0, g.real))
        else:
            slope = g * (sum(-1 / z for z in zeros) - sum(-1 / p for p in others))
            double, single = g.real, slope.real
    return Plant(tuple(pairs), tuple(reals), double, single, delay_s, *units)


def from_document(d: dict) -> Plant:
    """The document plant.toml in any of its forms that the machines here use."""
    units, t = (d["position_unit"], d["command_unit"]), d["plant"]
    if t.get("physics"):
        raise ValueError("linear plants only")
    delay = t.get("delay_s", 0.0)
    if "residue" in t:
        return _from_residues(t["residue"], delay, units)
    if "poles_rad_s" in t:
        zeros = [complex(*z) for z in t.get("zeros_rad_s", [])]
        return from_roots(zeros, [complex(*p) for p in t["poles_rad_s"]], t["gain"], delay, units)
    gain = t.get("resonance_gain", 1.0)
    if t["natural_frequency_rad_s"] == 0.0:
        gain *= t["acceleration_gain"]
        poles = [0j, complex(-t["viscous_rate_per_s"])]
    else:
        w0 = t["natural_frequency_rad_s"]
        gain *= t["dc_gain"] * w0 * w0
        poles = pair_roots(w0, t["damping_ratio"])
    zeros = []
    for m in t.get("modes", []):
        zeros += pair_roots(m["zero_rad_s"], m["zero_damping_ratio"])
        poles += pair_roots(m["pole_rad_s"], m["pole_damping_ratio"])
    return from_roots(zeros, poles, gain, delay, units)


def _from_residues(terms: list[dict], delay: float, units: tuple[str, str]) -> Plant:
    """Sum of gain/(s^2 + 2 d w s + w^2), every term a light mode."""
    pairs = []
    for term in terms:
        pole = pair_roots(term["frequency_rad_s"], term["damping_ratio"])[0]
        pairs.append((pole, term["gain"] / (2j * pole.imag)))
    return Plant(tuple(pairs), (), 0.0, 0.0, delay, *units)


def read(path: Path) -> Plant:
    """A plant.toml."""
    return from_document(tomllib.loads(path.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class Machine:
    """A plant, its clock, and what a sensible loop on it looks like."""

    name: str
    kind: str
    plant: Plant
    toml: str
    sample_time_s: float
    crossover_hz: tuple[float, float]
    """Crossovers between which a random controller is laid."""
    profile: dict = field(default_factory=dict)
    before: str | None = None
    """The plant in the first form of plant.toml, where it has one and the fixed bands of the first edition make sense on it."""

    @property
    def first_edition(self) -> bool:
        return self.before is not None
