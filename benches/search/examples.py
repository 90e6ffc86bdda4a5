"""The three worked machines under examples/: their made-up truth, and the sweeps an analyser would have written of them.

python examples.py --out examples        writes NAME/sweep.csv (1 % noise, seeded); controller, spec and README stand beside them, by hand
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

import machines
from machines import TAU, held_body, product_toml
from plant import Plant, from_document, from_roots, pair_roots

SEED = 41


def stage() -> Plant:
    """12 kg on air bearings, linear motor, 10 kHz: base on its feet at 28 Hz, frame at 148 Hz, carriage at 395 Hz, current loop at 1.5 kHz."""
    zeros, poles, gain = [], [], 5.0e6 * TAU * 1500.0
    for fz, dz, fp, dp in ((28.0, 0.04, 28.9, 0.04), (140.0, 0.011, 148.0, 0.010), (372.0, 0.014, 395.0, 0.012)):
        zeros += pair_roots(TAU * fz, dz)
        poles += pair_roots(TAU * fp, dp)
    return from_roots(zeros, [0j, complex(-1.2), complex(-TAU * 1500.0)] + poles, gain, 150e-6, ("um", "A"))


def galvo() -> Plant:
    """Scan mirror, 100 kHz: torsion bar at 60 Hz, shaft at 2.6 kHz, mirror at 11 kHz."""
    import tomllib

    modes = [(2310.0, 0.008, 2600.0, 0.006), (11_600.0, 0.012, 11_000.0, 0.010)]
    return from_document(tomllib.loads(product_toml(("rad", "V"), held_body(0.35, 60.0, 0.4), 12e-6, modes)))


def vcm() -> Plant:
    """Voice coil of a disk drive, 20 kHz: pivot at 55 Hz and six modes, every second one measured beyond its node."""
    terms = [
        (55.0, 0.25, 3.2e8),
        (910.0, 0.015, 1.1e7),
        (2250.0, 0.014, -3.0e7),
        (3550.0, 0.012, 2.8e7),
        (4900.0, 0.012, -1.5e8),
        (7150.0, 0.015, -5.5e7),
        (9050.0, 0.014, 4.0e7),
    ]
    pairs = []
    for hz, d, gain in terms:
        p = pair_roots(TAU * hz, d)[0]
        pairs.append((p, gain / (2j * p.imag)))
    return Plant(tuple(pairs), (), 0.0, 0.0, 24e-6, "track", "A")


EXAMPLES = {"stage": (stage, 3.0, 2500.0, 480), "galvo": (galvo, 10.0, 45_000.0, 520), "vcm": (vcm, 15.0, 9_800.0, 560)}


def sweep(p: Plant, low: float, high: float, points: int, rng: np.random.Generator) -> str:
    """Magnitude and phase of the plant itself, the hold divided out, 1 % complex noise."""
    hz = np.array([float(f"{f:.6g}") for f in np.geomspace(low, high, points)])
    value = p.response(TAU * hz) * (1 + 0.01 / math.sqrt(2) * (rng.normal(size=points) + 1j * rng.normal(size=points)))
    db, deg = 20 * np.log10(abs(value)), np.degrees(np.angle(value))
    head = f"# Swept sine, position ({p.position_unit}) over command ({p.command_unit}), hold divided out\nfrequency_hz,magnitude_db,phase_deg\n"
    return head + "".join(f"{f:.6g},{a:.4f},{b:.3f}\n" for f, a, b in zip(hz, db, deg))


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--out", type=Path, default=machines.ROOT / "examples")
    w = a.parse_args()
    for i, (name, (make, low, high, points)) in enumerate(EXAMPLES.items()):
        (w.out / name).mkdir(parents=True, exist_ok=True)
        (w.out / name / "sweep.csv").write_text(
            sweep(make(), low, high, points, np.random.default_rng((SEED, i))), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
