"""The sampled plant (hold and fractional delay exact), the closed loop, and margins from a dense grid with refinement.

Shares no code with the program: the plant is sampled fraction by fraction in closed form, stability is read off the closed loop's
eigenvalues, crossings are bracketed on 1e5 points and found by Brent's method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, minimize_scalar

import law as laws
from law import Law
from plant import Plant

POINTS = 100_000
EDGE = 10 ** (-3 / 20)
"""|T| at the edge of the bandwidth, -3 dB."""


def phi(p: complex, h: float) -> complex:
    """Integral of exp(p t) over h."""
    return h if p == 0 else np.expm1(p * h) / p


@dataclass(frozen=True)
class Sampled:
    """x' = A x + now s[k-D] + before s[k-D-1]; y `offset` after a sample is a row of x and of both commands."""

    plant: Plant
    t: float

    @cached_property
    def whole(self) -> int:
        return int(np.floor(self.plant.delay_s / self.t * (1 + 1e-12)))

    @cached_property
    def rest(self) -> float:
        return max(self.plant.delay_s - self.whole * self.t, 0.0)

    @cached_property
    def order(self) -> int:
        return len(self.plant.poles())

    def advance(self, h: float) -> np.ndarray:
        """Free motion over h."""
        a, i = np.zeros((self.order, self.order)), 0
        for p, _ in self.plant.pairs:
            e = np.exp(p * h)
            a[i : i + 2, i : i + 2] = [[e.real, -e.imag], [e.imag, e.real]]
            i += 2
        for p, _ in self.plant.reals:
            a[i, i] = np.exp(p * h)
            i += 1
        if self.plant.double:
            a[i : i + 2, i : i + 2] = [[1.0, h], [0.0, 1.0]]
        return a

    def pushed(self, h: float) -> np.ndarray:
        """State after a command of 1 held over h."""
        b = []
        for p, _ in self.plant.pairs:
            f = phi(p, h)
            b += [f.real, f.imag]
        b += [phi(p, h) for p, _ in self.plant.reals]
        if self.plant.double:
            b += [h * h / 2, h]
        return np.array(b, float)

    @cached_property
    def c(self) -> np.ndarray:
        row = []
        for _, r in self.plant.pairs:
            row += [2 * r.real, -2 * r.imag]
        row += [r for _, r in self.plant.reals]
        return np.array(row + ([self.plant.double, self.plant.single] if self.plant.double else []))

    @cached_property
    def step(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A, now, before)."""
        late = self.t - self.rest
        return self.advance(self.t), self.pushed(late), self.advance(late) @ self.pushed(self.rest)

    def reading(self, offset: float) -> tuple[np.ndarray, float, float]:
        """Position `offset` after sample k: row of x[k], factors of s[k-D] and s[k-D-1]."""
        early, late = min(offset, self.rest), max(offset - self.rest, 0.0)
        before = self.advance(late) @ self.pushed(early)
        return self.c @ self.advance(offset), float(self.c @ self.pushed(late)), float(self.c @ before)

    def response(self, w: np.ndarray) -> np.ndarray:
        """P(e^{jwT}) fraction by fraction."""
        q = np.exp(-1j * np.asarray(w, float) * self.t)
        value, late = 0.0, self.t - self.rest
        pairs = self.plant.pairs
        for p, r in [*pairs, *((p.conjugate(), r.conjugate()) for p, r in pairs), *self.plant.reals]:
            top = phi(p, late) + np.exp(p * late) * phi(p, self.rest) * q
            # z - e^{pT} without cancellation near z = 1.
            value = value + r * top / (np.expm1(1j * w * self.t) - np.expm1(p * self.t))
        if self.plant.double:
            zm = np.expm1(1j * w * self.t)
            b1, b2 = late * late / 2 + (self.rest**2 / 2 + self.rest * late) * q, late + self.rest * q
            value = value + self.plant.double * (b1 / zm + self.t * b2 / zm**2) + self.plant.single * b2 / zm
        return value * q**self.whole


@dataclass(frozen=True)
class Closed:
    """X' = A X + b_r (r - v) + b_w w; s = u + w is what enters the plant, u = k X + d (r - v)."""

    a: np.ndarray
    b_r: np.ndarray
    b_w: np.ndarray
    k: np.ndarray
    d: float
    n: int
    """States of the plant; then s[k-1] ... s[k-D-1]; then the sections'."""

    def unstable(self) -> int:
        return int(np.sum(abs(np.linalg.eigvals(self.a)) >= 1.0))


def close(s: Sampled, rows: np.ndarray) -> Closed:
    """The loop u = C (r - v - y)."""
    ac, bc, cc, dc = laws.state_space(rows)
    a0, now, before = s.step
    n, held, m = s.order, s.whole + 1, len(bc)
    a, b = np.zeros((n + held + m,) * 2), np.zeros(n + held + m)
    a[:n, :n] = a0
    a[:n, n + s.whole] = before
    if s.whole:
        a[:n, n + s.whole - 1] = now
    else:
        b[:n] = now
    for i in range(1, held):
        a[n + i, n + i - 1] = 1.0
    b[n] = 1.0
    y = np.concatenate([s.c, np.zeros(held + m)])
    k = np.concatenate([-dc * s.c, np.zeros(held), cc])
    bc_all = np.concatenate([np.zeros(n + held), bc])
    a[n + held :, n + held :] = ac
    a = a + np.outer(b, k) - np.outer(bc_all, y)
    return Closed(a, b * dc + bc_all, b, k, dc, n)


def modes_of(s: Sampled) -> list[tuple[float, float]]:
    """Frequency and half width (rad/s) of every resonance."""
    return [(abs(p.imag), abs(p.real)) for p, _ in s.plant.pairs]


def grid(s: Sampled, points: int = POINTS) -> np.ndarray:
    """Half even in the logarithm, a quarter even, a quarter crowded at the resonances."""
    end = np.pi / s.t
    w = [
        np.geomspace(end * 1e-6, end * (1 - 1e-9), points // 2),
        np.linspace(end / points, end * (1 - 1e-9), points // 4),
    ]
    modes = [(f, h) for f, h in modes_of(s) if f < end]
    if modes:
        each = points // 4 // len(modes) // 2
        near = np.geomspace(1e-3, 300.0, each)
        for f, h in modes:
            w += [f + near * h, f - near * h]
    w = np.unique(np.concatenate(w))
    return w[(w > 0) & (w < end)]


@dataclass(frozen=True)
class Margins:
    stable: bool
    gain_crossings: list[tuple[float, float]]
    """Hz, deg."""
    phase_crossings: list[tuple[float, float]]
    """Hz, dB."""
    max_sensitivity: float
    max_sensitivity_hz: float
    bandwidth_hz: float | None

    @property
    def phase_margin_deg(self) -> float | None:
        return min((v for _, v in self.gain_crossings), key=abs, default=None)

    @property
    def gain_margin_db(self) -> float | None:
        return min((v for _, v in self.phase_crossings), key=abs, default=None)


class Bench:
    """A sampled plant with its response on the grid, for many laws."""

    def __init__(self, plant: Plant, t: float, points: int = POINTS) -> None:
        self.s = Sampled(plant, t)
        self.w = grid(self.s, points)
        self.q = np.exp(-1j * self.w * t)
        self.p = self.s.response(self.w)

    def loop(self, rows: np.ndarray) -> np.ndarray:
        value = self.p * laws.response(rows, self.q)
        # A low-pass is 0 at half the clock; its logarithm is wanted.
        return np.where(value == 0, 1e-300, value)

    def margins(self, law: Law) -> Margins:
        """Every crossing and the largest sensitivity, refined."""
        rows = law.rows()
        value = self.loop(rows)

        def at(w: float) -> complex:
            w = np.array([w])
            return complex((self.s.response(w) * laws.response(rows, np.exp(-1j * w * self.s.t)))[0])

        gains = [
            (x, float(np.degrees(np.angle(-at(x)))))
            for x in self._roots(lambda x: np.log(abs(at(x))), np.log(abs(value)))
        ]
        axis = self._roots(lambda x: at(x).imag, value.imag)
        phases = [(x, -20 * np.log10(-at(x).real)) for x in axis if at(x).real < 0]
        i = int(np.clip(np.argmin(abs(1 + value)), 1, len(self.w) - 2))
        found = minimize_scalar(
            lambda x: abs(1 + at(x)),
            bounds=(self.w[i - 1], self.w[i + 1]),
            method="bounded",
            options={"xatol": 1e-10 * self.w[i]},
        )
        far = min(float(found.fun), float(abs(1 + value[i])))
        t = abs(value / (1 + value))
        falls = self._roots(lambda x: np.log(abs(at(x) / (1 + at(x))) / EDGE), np.log(t / EDGE), 1)
        hz = 1 / (2 * np.pi)
        return Margins(
            close(self.s, rows).unstable() == 0,
            [(x * hz, v) for x, v in gains],
            [(x * hz, float(v)) for x, v in phases],
            1 / far,
            float(self.w[i] * hz),
            falls[0] * hz if falls else None,
        )

    def _roots(self, f, value: np.ndarray, most: int = 1000) -> list[float]:
        turns = np.nonzero(np.sign(value[:-1]) != np.sign(value[1:]))[0][:most]
        out = []
        for i in turns:
            a, b = f(self.w[i]), f(self.w[i + 1])
            if a * b < 0:
                out.append(float(brentq(f, self.w[i], self.w[i + 1], xtol=1e-12 * self.w[i], rtol=1e-14)))
            else:
                out.append(float(self.w[i]))
        return out
