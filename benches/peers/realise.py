"""State-space forms built by hand, the best-conditioned way into scipy and python-control.

The plant is block-diagonal, one 2 x 2 block for each pair of poles; it is sampled by scipy's matrix exponential with
the fractional delay kept exact (Åström & Wittenmark, Computer-Controlled Systems, ch. 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, expm

from machine import Controller, Plant
from sections import bilinear, state_space


def poles_and_residues(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Upper poles and their residues, from the factors; never from expanded polynomials."""
    roots = [w * complex(-d, np.sqrt(1 - d * d)) for w, d in plant.denominators()]
    upper = np.array(roots)
    every = np.concatenate([upper, upper.conj()])
    residues = []
    for i, p in enumerate(upper):
        value = plant.leading_gain
        others = list(np.delete(every, i))
        for w, d in plant.numerators():
            value *= (p * p + 2 * d * w * p + w * w) / ((p - others.pop()) * (p - others.pop()))
        for other in others:
            value /= p - other
        residues.append(value)
    return upper, np.array(residues)


def modal_blocks(plant: Plant) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(A, B, C) of each pair of poles, delay left out."""
    blocks = []
    for p, r in zip(*poles_and_residues(plant)):
        a = np.array([[p.real, p.imag], [-p.imag, p.real]])
        # The size of the residue is shared between input and output.
        size = np.sqrt(2 * abs(r))
        turn = r / abs(r)
        blocks.append((a, np.array([[size], [0.0]]), size * np.array([[turn.real, turn.imag]])))
    return blocks


def modal_state_space(plant: Plant) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, C) of the whole plant, delay left out."""
    blocks = modal_blocks(plant)
    return (
        block_diag(*(a for a, _, _ in blocks)),
        np.vstack([b for _, b, _ in blocks]),
        np.hstack([c for _, _, c in blocks]),
    )


def held(a: np.ndarray, b: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """e^{A h} and the integral of e^{A t} B over h, by one exponential of the augmented matrix."""
    n = a.shape[0]
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n] = a
    augmented[:n, n:] = b
    e = expm(augmented * h)
    return e[:n, :n], e[:n, n:]


@dataclass(frozen=True)
class Sampled:
    """x' = phi x + now u[k-D] + before u[k-D-1], y = c x."""

    sample_time_s: float
    whole: int
    rest_s: float
    a: np.ndarray
    b: np.ndarray
    phi: np.ndarray
    now: np.ndarray
    before: np.ndarray
    c: np.ndarray

    def state_space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A, B, C) with u[k-1] ... u[k-D-1] as states after the plant's own; D is at least 1."""
        n, held_back = self.phi.shape[0], self.whole + 1
        a = np.zeros((n + held_back, n + held_back))
        a[:n, :n] = self.phi
        a[:n, n + self.whole - 1] = self.now[:, 0]
        a[:n, n + self.whole] = self.before[:, 0]
        for i in range(1, held_back):
            a[n + i, n + i - 1] = 1.0
        b = np.zeros((n + held_back, 1))
        b[n, 0] = 1.0
        return a, b, np.hstack([self.c, np.zeros((1, held_back))])

    def reading(self, offset_s: float) -> np.ndarray:
        """Row over the states of `state_space` that gives the position `offset_s` after a sample."""
        late, early = max(offset_s - self.rest_s, 0.0), min(offset_s, self.rest_s)
        over_late, now = held(self.a, self.b, late)
        over_early, before = held(self.a, self.b, early)
        row = np.zeros(self.phi.shape[0] + self.whole + 1)
        n = self.phi.shape[0]
        row[:n] = (self.c @ over_late @ over_early)[0]
        row[n + self.whole - 1] = (self.c @ now)[0, 0]
        row[n + self.whole] = (self.c @ over_late @ before)[0, 0]
        return row


def sampled(plant: Plant, t: float) -> Sampled:
    """Zero-order hold with the fractional part of the delay, exact up to rounding."""
    whole = int(np.floor(plant.delay_s / t))
    if whole < 1:
        raise ValueError("this comparison's plants are late by at least one sample")
    rest = plant.delay_s - whole * t
    a, b, c = modal_state_space(plant)
    over_now, now = held(a, b, t - rest)
    over_rest, early = held(a, b, rest)
    return Sampled(t, whole, rest, a, b, over_now @ over_rest, now, over_now @ early, c)


def sections(c: Controller) -> np.ndarray:
    """Rows b0 b1 b2 a1 a2: PID, low-passes, notches, as the contract defines them."""
    t, f = c.sample_time_s, c.derivative_filter_s
    a = t + f
    # Over the common denominator (1 - q)(a - f q), q = 1/z.
    proportional = c.kp * np.array([a, -(a + f), f])
    integral = c.ki_per_s * t * np.array([a, -f, 0.0])
    derivative = c.kd_s * np.array([1.0, -2.0, 1.0])
    rows = [np.concatenate([(proportional + integral + derivative) / a, [-(a + f) / a, f / a]])]
    rows += [bilinear(hz, t, (0.0, 0.0, 1.0), d) for hz, d in c.lowpasses]
    rows += [bilinear(hz, t, (1.0, 2 * zero, 1.0), pole) for hz, zero, pole in c.notches]
    return np.array(rows)


def closed_loop(plant: Sampled, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) of the loop; states: plant, delay, sections; inputs: reference less encoder noise, windage."""
    ap, bp, cp = plant.state_space()
    ac, bc, cc, dc = state_space(rows)
    bc, cc = bc.reshape(-1, 1), cc.reshape(1, -1)
    a = np.block([[ap - bp @ cp * dc, bp @ cc], [-bc @ cp, ac]])
    b = np.block([[bp * dc, bp], [bc, np.zeros_like(bc)]])
    return a, b
