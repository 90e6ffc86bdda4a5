"""Second-order sections b0 b1 b2 a1 a2: prewarped filters, the response of a chain, its states."""

from __future__ import annotations

import numpy as np


def bilinear(hz: float, t: float, numerator: tuple[float, float, float], damping: float) -> np.ndarray:
    """(n2 s^2 + n1 s + n0)/(s^2 + 2 d s + 1), s in units of its corner, prewarped there."""
    n2, n1, n0 = numerator
    c = 1 / np.tan(np.pi * hz * t)
    a0 = c * c + 2 * damping * c + 1
    top = [n2 * c * c + n1 * c + n0, 2 * (n0 - n2 * c * c), n2 * c * c - n1 * c + n0]
    return np.array(top + [2 * (1 - c * c), c * c - 2 * damping * c + 1]) / a0


def response(rows: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product of the sections at q = 1/z."""
    value = np.ones_like(q)
    for b0, b1, b2, a1, a2 in rows:
        value = value * (b0 + q * (b1 + q * b2)) / (1 + q * (a1 + q * a2))
    return value


def state_space(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """(A, b, c, d) of the sections in series, two states each (transposed direct form II)."""
    n = 2 * len(rows)
    a, b = np.zeros((n, n)), np.zeros(n)
    row, through = np.zeros(n), 1.0  # what enters the next section: row x + through u
    for i, (b0, b1, b2, a1, a2) in enumerate(rows):
        j = 2 * i
        out, out_through = b0 * row, b0 * through
        out[j] += 1.0
        a[j] = b1 * row - a1 * out
        a[j, j + 1] += 1.0
        a[j + 1] = b2 * row - a2 * out
        b[j], b[j + 1] = b1 * through - a1 * out_through, b2 * through - a2 * out_through
        row, through = out, out_through
    return a, b, row, through
