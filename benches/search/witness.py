"""Random stable controllers laid on a machine by rule: each proves that a spec made from its own figures can be met."""

from __future__ import annotations

import math

import numpy as np

import judge
import law as laws
from law import Law
from loop import close
from plant import Machine

TAU = 2 * math.pi


def _peaks(m: Machine, bench: judge.Bench) -> list[float]:
    """Resonances (Hz) below half the clock, the one that stands out most first."""
    found = []
    for p, _ in m.plant.pairs:
        hz = abs(p.imag) / TAU
        if 1.3 * m.crossover_hz[0] < hz < 0.4 / m.sample_time_s:
            w = np.array([abs(p.imag)])
            found.append((float(abs(bench.loop.s.response(w))[0] * w[0] ** 2), hz))
    return [hz for _, hz in sorted(found, reverse=True)]


def draw(
    rng: np.random.Generator,
    m: Machine,
    bench: judge.Bench,
    structure: str,
    notches: int,
    lowpasses: int,
    filter_s: float,
) -> Law | None:
    """One stable law with sound margins, or nothing after many tries."""
    t, nyquist, peaks = m.sample_time_s, 0.5 / m.sample_time_s, _peaks(m, bench)
    for _ in range(60):
        low, high = m.crossover_hz
        hz = float(np.exp(rng.uniform(math.log(low), math.log(high))))
        if structure == "pi":
            hz *= rng.uniform(0.01, 0.05)
        wc = TAU * hz
        filters = tuple((min(hz * rng.uniform(5, 14), 0.9 * nyquist), 0.7) for _ in range(lowpasses))
        holes = []
        for i in range(notches):
            at = peaks[i] * rng.uniform(0.97, 1.03) if i < len(peaks) else hz * rng.uniform(3, 8)
            wide = rng.uniform(0.2, 0.8)
            holes.append((min(at, 0.9 * nyquist), wide * rng.uniform(0.05, 0.5), wide))
        integral, lead = wc / rng.uniform(5, 25), wc / rng.uniform(1.8, 4.0)
        if structure == "lead":
            integral = 0.0
        if structure == "pi":
            integral, lead = wc * rng.uniform(0.5, 20.0), math.inf
        if structure == "p_pi":
            # (v + i T/(1 - q)) (p + (1 - q)/T): real zeros only, no filter of its own.
            velocity, inner = lead, wc / rng.uniform(4, 20)
            one = (velocity + inner, velocity * inner, 1.0)
            law = Law(t, one[0], one[1], one[2], 0.0, filters, tuple(holes))
        else:
            law = Law(
                t,
                1 + (integral / lead if lead < math.inf else 0.0),
                integral,
                1 / lead if lead < math.inf else 0.0,
                filter_s,
                filters,
                tuple(holes),
            )
        scale = (
            1
            / abs(bench.loop.s.response(np.array([wc])) * laws.response(law.rows(), np.exp(-1j * np.array([wc * t]))))[
                0
            ]
        )
        for _ in range(4):
            tried = Law(
                t,
                law.kp * scale,
                law.ki_per_s * scale,
                law.kd_s * scale,
                law.derivative_filter_s,
                filters,
                tuple(holes),
            )
            if close(bench.loop.s, tried.rows()).unstable() == 0:
                f = bench.loop.margins(tried)
                sound = f.max_sensitivity < 3.0 and (f.phase_margin_deg or 99) > 18 and (f.gain_margin_db or 99) > 3
                if sound and f.gain_crossings and f.bandwidth_hz:
                    return tried
            scale *= 0.8
    return None
