"""The kind kept out of sight while the search is built: piezo scanners on flexures, stiff at rest, driven to an integral loop below a light resonance."""

from __future__ import annotations

import numpy as np

from machines import held_body, machine, product_toml, roots_toml, _pairs, TAU
from plant import Machine, pair_roots

SEED = 77


def every() -> list[Machine]:
    """Four scanners: flexure resonance at 350 to 1200 Hz, damping 0.02, a mode of the platform above it; two with their amplifier as a real pole."""
    out = []
    for i, rate in enumerate((20_000.0, 40_000.0, 25_000.0, 50_000.0)):
        u = np.random.default_rng((SEED, i)).uniform
        flexure, at_rest, delay = u(350.0, 1200.0), u(8.0, 25.0), u(0.8, 1.8) / rate
        second = flexure * u(2.6, 4.0)
        modes = [(second * u(0.86, 1.1), 0.015, second, 0.012)]
        units, w0 = ("um", "V"), TAU * flexure
        if i % 2 == 0:
            text = product_toml(units, held_body(at_rest, flexure, u(0.015, 0.04)), delay, modes)
        else:
            amplifier, (zeros, poles) = TAU * u(1500.0, 4000.0), _pairs(modes)
            text = roots_toml(
                units,
                zeros,
                pair_roots(w0, u(0.015, 0.04)) + [complex(-amplifier)] + poles,
                at_rest * w0 * w0 * amplifier,
                delay,
            )
        out.append(machine(f"piezo_{i + 1}", "piezo scanner", text, rate, (flexure / 6, flexure / 2), 10.0, False))
    return out
