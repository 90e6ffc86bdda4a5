"""A plant as body and monic pairs, the form that the program of before this bench reads, where it has one.

Zeros are the finite eigenvalues of the pencil ([A b; c 0], [I 0; 0 0]), each polished by Newton's rule on the fractions. Two real roots
on the same side make a pair with a damping beyond 1; a lone one gets a pole and a zero that cancel.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import eig

from plant import Plant

TAU = 2 * math.pi


def _at(p: Plant, s: complex) -> tuple[complex, complex]:
    """Value and slope without the delay."""
    v = p.double / s**2 + p.single / s
    d = -2 * p.double / s**3 - p.single / s**2
    fractions = [(q, r) for q, r in p.pairs] + [(q.conjugate(), r.conjugate()) for q, r in p.pairs] + list(p.reals)
    for q, r in fractions:
        v += r / (s - q)
        d -= r / (s - q) ** 2
    return v, d


def zeros(p: Plant) -> np.ndarray:
    """Finite zeros of the fractions."""
    scale = TAU * 3e3
    n = len(p.poles())
    a, b, c, i = np.zeros((n, n)), np.zeros(n), np.zeros(n), 0
    for q, r in p.pairs:
        q, r = q / scale, r / scale
        a[i : i + 2, i : i + 2] = [[q.real, -q.imag], [q.imag, q.real]]
        size = math.sqrt(abs(r))
        b[i], c[i : i + 2] = size, [2 * r.real / size, -2 * r.imag / size]
        i += 2
    for q, r in p.reals:
        a[i, i], b[i], c[i] = q / scale, 1.0, r / scale
        i += 1
    if p.double:
        a[i, i + 1], b[i + 1], c[i], c[i + 1] = 1.0, 1.0, p.double / scale**2, p.single / scale
    pencil = np.block([[a, b[:, None]], [c[None, :], np.zeros((1, 1))]])
    found = eig(pencil, np.diag([1.0] * n + [0.0]), right=False)
    found = found[np.isfinite(found) & (abs(found) < 1e4)] * scale
    for _ in range(30):
        found = np.array([z - np.divide(*_at(p, z)) for z in found])
    return found


def _pairs(roots: np.ndarray, allow_odd: float | None) -> list[tuple[float, float]] | None:
    """(w, damping) of every pair; None where real roots cannot be paired on one side."""
    out = [(abs(z), -z.real / abs(z)) for z in roots if z.imag > 1e-9 * abs(z)]
    real = sorted((z.real for z in roots if abs(z.imag) <= 1e-9 * abs(z)), key=lambda x: (x > 0, abs(x)))
    left, right = [x for x in real if x < 0], [x for x in real if x >= 0]
    if len(left) % 2 and allow_odd is not None:
        left.append(-allow_odd)
    if len(left) % 2 or len(right) % 2:
        return None
    for side in (left, right):
        for x, y in zip(side[::2], side[1::2]):
            w = math.sqrt(x * y)
            out.append((w, -(x + y) / (2 * w)))
    return sorted(out)


def product_toml(p: Plant) -> str | None:
    """plant.toml in the first form, or None where the plant has no such form."""
    top = zeros(p)
    poles = p.poles()
    others = np.array([q for q in poles if q != 0])
    at_rest = len(poles) - len(others)
    extra = TAU * 150e3
    bottom, above = _pairs(others, extra), _pairs(top, extra)
    if at_rest not in (0, 2) or p.unstable_poles() or bottom is None or above is None:
        return None
    if len(above) != len(bottom) - (0 if at_rest else 1):
        return None
    # The factor before the monic polynomials, where the response is largest in reach.
    lines = [f'position_unit = "{p.position_unit}"', f'command_unit = "{p.command_unit}"', "[plant]"]
    w = TAU * np.geomspace(10.0, 3000.0, 7)
    s = 1j * w
    shape = np.ones_like(s)
    for f, d in above:
        shape = shape * (s * s + 2 * d * f * s + f * f)
    for f, d in bottom:
        shape = shape / (s * s + 2 * d * f * s + f * f)
    if at_rest:
        shape = shape / s**2
    ratio = p.response(w) / np.exp(-s * p.delay_s) / shape
    gain = float(ratio.real.mean())
    if abs(ratio / gain - 1).max() > 1e-7:
        return None
    if at_rest:
        lines += ["natural_frequency_rad_s = 0.0", f"acceleration_gain = {gain!r}", "viscous_rate_per_s = 0.0"]
    else:
        f, d = bottom.pop(0)
        lines += [f"natural_frequency_rad_s = {f!r}", f"damping_ratio = {d!r}", f"dc_gain = {gain / f**2!r}"]
    lines.append(f"delay_s = {p.delay_s!r}")
    for (fz, dz), (fp, dp) in zip(above, bottom):
        lines += ["[[plant.modes]]", f"zero_rad_s = {float(fz)!r}", f"zero_damping_ratio = {float(dz)!r}"]
        lines += [f"pole_rad_s = {float(fp)!r}", f"pole_damping_ratio = {float(dp)!r}"]
    return "\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n"
