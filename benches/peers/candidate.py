"""What one candidate of a search costs by each route: margins and DFT of a controller on a plant that stays.

All that does not depend on the gains is prepared outside the clock for every route.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import control
import numpy as np

import write
from machine import Controller, Profile
from realise import Sampled, closed_loop, sections
from sections import response as chain_response
from sections import state_space

GRID_POINTS = 1000
GRID_HZ = (10.0, 12_500.0)


@dataclass(frozen=True)
class Figures:
    """What a route says about a loop; none where it gives no such figure."""

    phase_margin_deg: float | None
    gain_crossover_hz: float | None
    gain_margin_db: float | None
    phase_crossover_hz: float | None
    max_sensitivity: float | None = None
    disk_margin: float | None = None
    stable: bool | None = None


@dataclass(frozen=True)
class Prepared:
    """The plant on a grid and as a system."""

    plant: Sampled
    w_rad_s: np.ndarray
    q: np.ndarray
    response: np.ndarray
    system: control.StateSpace


def prepare(plant: Sampled, response: np.ndarray, w_rad_s: np.ndarray) -> Prepared:
    a, b, c = plant.state_space()
    q = np.exp(-1j * w_rad_s * plant.sample_time_s)
    return Prepared(plant, w_rad_s, q, response, control.ss(a, b, c, 0.0, plant.sample_time_s))


def grid() -> np.ndarray:
    """1000 points, even in the logarithm (rad/s)."""
    return 2 * np.pi * np.geomspace(*GRID_HZ, GRID_POINTS)


def control_frd(p: Prepared, c: Controller) -> Figures:
    """python-control on a sampled response: every crossing by its interpolation, Ms read off the points."""
    value = p.response * chain_response(sections(c), p.q)
    loop = control.frd(value, p.w_rad_s, smooth=True)
    return _figures(control.stability_margins(loop, returnall=True), 1 / np.min(abs(1 + value)))


def control_state_space(p: Prepared, c: Controller) -> Figures:
    """python-control on the block-diagonal state space: stability_margins chooses its own method."""
    return _figures(control.stability_margins(_loop(p, c), returnall=True), None)


def control_disk(p: Prepared, c: Controller) -> Figures:
    """python-control's disk margin on the same 1000 points."""
    alpha, _, _ = control.disk_margins(_loop(p, c), p.w_rad_s)
    return Figures(None, None, None, None, disk_margin=float(alpha))


def _loop(p: Prepared, c: Controller) -> control.StateSpace:
    a, b, row, d = state_space(sections(c))
    return p.system * control.ss(a, b.reshape(-1, 1), row.reshape(1, -1), d, p.plant.sample_time_s)


def numpy_by_hand(p: Prepared, c: Controller) -> Figures:
    """The cheapest that a careful user writes: vectorised, linear between points, poles by eigenvalues."""
    rows = sections(c)
    value = p.response * chain_response(rows, p.q)
    x = np.log(p.w_rad_s)
    gain = _nearest(x, np.log(abs(value)), np.degrees(np.angle(-value)))
    phase = _nearest(x, value.imag, -20 * np.log10(abs(value)), value.real < 0)
    a, _ = closed_loop(p.plant, rows)
    stable = bool(np.max(abs(np.linalg.eigvals(a))) < 1.0)
    return Figures(*gain, *phase, max_sensitivity=float(1 / np.min(abs(1 + value))), stable=stable)


def _nearest(
    x: np.ndarray, level: np.ndarray, value: np.ndarray, where: np.ndarray | None = None
) -> tuple[float | None, float | None]:
    """Of the places where `level` changes sign: `value` smallest in absolute value, and its frequency (Hz)."""
    turns = np.signbit(level[:-1]) != np.signbit(level[1:])
    if where is not None:
        turns &= where[:-1] & where[1:]
    i = np.nonzero(turns)[0]
    if len(i) == 0:
        return None, None
    share = level[i] / (level[i] - level[i + 1])
    found = value[i] + share * (value[i + 1] - value[i])
    best = int(np.argmin(abs(found)))
    at = x[i[best]] + share[best] * (x[i[best] + 1] - x[i[best]])
    return float(found[best]), float(np.exp(at) / (2 * np.pi))


def _figures(answer: tuple, max_sensitivity: float | None) -> Figures:
    gain_margins, phase_margins, _, phase_w, gain_w, _ = answer
    hz = 1 / (2 * np.pi)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        db = 20 * np.log10(np.asarray(gain_margins, dtype=float))
    usable = np.isfinite(db)
    db, phase_w = db[usable], np.asarray(phase_w)[usable]
    degrees = np.asarray(phase_margins, dtype=float)
    g, p = _smallest(db), _smallest(degrees)
    return Figures(
        None if p is None else float(degrees[p]),
        None if p is None else float(gain_w[p] * hz),
        None if g is None else float(db[g]),
        None if g is None else float(phase_w[g] * hz),
        max_sensitivity=max_sensitivity,
    )


def _smallest(values: np.ndarray) -> int | None:
    return None if len(values) == 0 else int(np.argmin(abs(values)))


@dataclass(frozen=True)
class Write:
    """The write without noise, and its noise."""

    scene: write.Scene
    noise: write.NoiseOnLines

    def norms(self, pes: np.ndarray, rows: np.ndarray) -> tuple[float, float]:
        """Both DFT norms, noise as expected power."""
        amplitudes = write.harmonics(pes, self.scene.profile)
        return write.bands(np.sqrt(amplitudes**2 + self.noise.power(rows)), self.scene.profile)


def prepare_write(profile: Profile, plant: Sampled) -> Write:
    return Write(write.scene(write.quiet(profile), plant, whole=False), write.noise_on_lines(profile, plant))


def whole_by_control(p: Prepared, w: Write, c: Controller) -> tuple[float, float]:
    """One candidate with python-control: margins on the sampled response, poles, write, DFT."""
    control_frd(p, c)
    rows = sections(c)
    a, _ = closed_loop(p.plant, rows)
    np.linalg.eigvals(a)
    return w.norms(write.by_control(w.scene, rows), rows)


def whole_by_scipy(p: Prepared, w: Write, c: Controller) -> tuple[float, float]:
    """One candidate with scipy's simulation and hand-written margins."""
    numpy_by_hand(p, c)
    rows = sections(c)
    return w.norms(write.by_scipy(w.scene, rows), rows)


def whole_by_numpy(p: Prepared, w: Write, c: Controller) -> tuple[float, float]:
    """One candidate, hand-written throughout."""
    numpy_by_hand(p, c)
    rows = sections(c)
    return w.norms(write.by_numpy(w.scene, rows), rows)
