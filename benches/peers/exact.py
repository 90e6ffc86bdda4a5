"""References that neither the peers nor servotune compute: high precision, an aliasing sum, a million points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mpmath
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from machine import Plant
from realise import Sampled
from sections import response as chain_response

DIGITS = 50


def sampled_response(plant: Plant, t: float, w_rad_s: np.ndarray) -> np.ndarray:
    """P(e^{jwT}) with zero-order hold and delay, by partial fractions in 50 digits, rounded at the end."""
    with mpmath.workdps(DIGITS):
        terms = _terms(plant)
        period, delay = mpmath.mpf(t), mpmath.mpf(plant.delay_s)
        whole = int(mpmath.floor(delay / period))
        rest = delay - whole * period
        prepared = []
        for p, r in terms:
            now = r * mpmath.expm1(p * (period - rest)) / p
            before = r * mpmath.exp(p * (period - rest)) * mpmath.expm1(p * rest) / p
            prepared.append((mpmath.exp(p * period), now, before))
        out = []
        for w in w_rad_s:
            z = mpmath.expj(mpmath.mpf(float(w)) * period)
            value = mpmath.fsum((now + before / z) / (z - pole) for pole, now, before in prepared)
            out.append(complex(value * z ** (-whole)))
    return np.array(out)


def _terms(plant: Plant) -> list[tuple[mpmath.mpc, mpmath.mpc]]:
    """Every pole with its residue."""

    def roots(w: float, d: float) -> list[mpmath.mpc]:
        w, d = mpmath.mpf(w), mpmath.mpf(d)
        upper = w * mpmath.mpc(-d, mpmath.sqrt(1 - d * d))
        return [upper, mpmath.conj(upper)]

    poles = [p for w, d in plant.denominators() for p in roots(w, d)]
    zeros = [z for w, d in plant.numerators() for z in roots(w, d)]
    w0 = mpmath.mpf(plant.natural_frequency_rad_s)
    gain = mpmath.mpf(plant.resonance_gain) * mpmath.mpf(plant.dc_gain) * w0 * w0
    terms = []
    for i, p in enumerate(poles):
        top = mpmath.fprod(p - z for z in zeros)
        bottom = mpmath.fprod(p - other for k, other in enumerate(poles) if k != i)
        terms.append((p, gain * top / bottom))
    return terms


def aliased_response(plant: Plant, t: float, w_rad_s: np.ndarray, images: int = 400_000) -> np.ndarray:
    """The same by its definition: the sum of all images of hold times plant, from the product form alone.

    P_d(e^{jwT}) = sum over k of P(j v) (1 - e^{-jvT})/(jvT), v = w + 2 pi k/T. The terms fall with the cube of k.
    """
    k = np.arange(-images, images + 1)
    out = []
    for w in w_rad_s:
        v = w + 2 * np.pi * k / t
        out.append(np.sum(plant.response(v) * (1 - np.exp(-1j * w * t)) / (1j * v * t)))
    return np.array(out)


def block_response(s: Sampled, w_rad_s: np.ndarray) -> np.ndarray:
    """The same in double precision from scipy's matrix exponential, block by block."""
    z = np.exp(1j * np.asarray(w_rad_s) * s.sample_time_s)
    value = np.zeros_like(z)
    for i in range(0, s.phi.shape[0], 2):
        a, b = s.phi[i : i + 2, i : i + 2], s.now[i : i + 2, 0]
        c, late = s.c[0, i : i + 2], s.before[i : i + 2, 0]
        determinant = (z - a[0, 0]) * (z - a[1, 1]) - a[0, 1] * a[1, 0]
        u0, u1 = b[0] + late[0] / z, b[1] + late[1] / z
        x0 = (z - a[1, 1]) * u0 + a[0, 1] * u1
        x1 = a[1, 0] * u0 + (z - a[0, 0]) * u1
        value += (c[0] * x0 + c[1] * x1) / determinant
    return value * z ** (-s.whole)


@dataclass(frozen=True)
class ReferenceMargins:
    gain_crossings: list[tuple[float, float]]  # Hz, deg
    phase_crossings: list[tuple[float, float]]  # Hz, dB
    max_sensitivity: float
    max_sensitivity_hz: float
    disk_margin: float
    disk_margin_hz: float


def margins(s: Sampled, rows: np.ndarray, points: int = 1_000_000) -> ReferenceMargins:
    """Every crossing and both maxima: a million points, half even in frequency, half in its logarithm; then roots."""

    def loop(w: np.ndarray) -> np.ndarray:
        return block_response(s, w) * chain_response(rows, np.exp(-1j * w * s.sample_time_s))

    def at(w: float) -> complex:
        return complex(loop(np.array([w]))[0])

    end = np.pi / s.sample_time_s
    half = points // 2
    w = np.union1d(np.linspace(end / half, end * (1 - 1e-9), half), np.geomspace(1.0, end * (1 - 1e-9), half))
    value = loop(w)
    gain = [(x, _angle(at(x))) for x in _roots(lambda x: np.log(abs(at(x))), w, np.log(abs(value)))]
    real_axis = _roots(lambda x: at(x).imag, w, value.imag)
    phase = [(x, -20 * np.log10(-at(x).real)) for x in real_axis if at(x).real < 0]
    ms_w, distance = _minimum(lambda x: abs(1 + at(x)), w, abs(1 + value))
    disk_w, disk = _minimum(lambda x: 2 * abs((1 + at(x)) / (1 - at(x))), w, 2 * abs((1 + value) / (1 - value)))
    hz = 1 / (2 * np.pi)
    return ReferenceMargins(
        [(x * hz, d) for x, d in gain], [(x * hz, d) for x, d in phase], 1 / distance, ms_w * hz, disk, disk_w * hz
    )


def _angle(value: complex) -> float:
    """From -180 deg to the value, in (-180, 180] deg."""
    return float(np.degrees(np.angle(-value)))


def _roots(f: Callable[[float], float], w: np.ndarray, value: np.ndarray) -> list[float]:
    turns = np.nonzero(np.sign(value[:-1]) != np.sign(value[1:]))[0]
    return [float(brentq(f, w[i], w[i + 1], xtol=1e-12, rtol=1e-15)) for i in turns]


def _minimum(f: Callable[[float], float], w: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    i = int(np.clip(np.argmin(value), 1, len(w) - 2))
    found = minimize_scalar(f, bounds=(w[i - 1], w[i + 1]), method="bounded", options={"xatol": 1e-9 * w[i]})
    return (float(found.x), float(found.fun)) if found.fun < value[i] else (float(w[i]), float(value[i]))
