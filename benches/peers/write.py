"""The closed loop of one write: its PES at the servo clock, the DFT of its window, and what noise is expected to add.

A search that saw one draw of the noise would fit itself to that draw, so candidates are judged by the write without noise and
by the expected power of the noise in every bin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np
from scipy import signal

import noise
from exact import block_response
from machine import Profile
from realise import Sampled, closed_loop
from sections import response as chain_response

LOW_BAND_HZ, HIGH_BAND_HZ = (600.0, 1500.0), (1500.0, 3000.0)


@dataclass(frozen=True)
class Scene:
    """All of a write that does not depend on the gains."""

    profile: Profile
    plant: Sampled
    inputs: np.ndarray  # steps x 2: reference less encoder noise, windage
    ticks: np.ndarray  # controller sample of each servo sample
    readings: np.ndarray  # row of each servo sample over the plant's states
    targets: np.ndarray  # reference at each servo sample


def quiet(profile: Profile) -> Profile:
    """The same write without noise."""
    return replace(profile, encoder_rms=0.0, windage_rms=0.0)


def scene(profile: Profile, plant: Sampled, whole: bool) -> Scene:
    """The write to its end, or to the end of the window where `whole` is false."""
    t, rate = plant.sample_time_s, profile.sample_rate_hz
    count = int(np.floor(profile.duration_s * rate * (1 + 1e-12))) + 1
    if not whole:
        count = profile.first_window_sample + profile.window[1]
    ticks, readings = [], []
    for j in range(count):
        k = int(np.floor(j / rate / t))
        offset = j / rate - k * t
        if offset > t * (1 - 1e-9):
            k, offset = k + 1, 0.0
        ticks.append(k)
        readings.append(plant.reading(offset))
    steps = ticks[-1] + 1
    reference = np.array([profile.reference(k * t) for k in range(steps)])
    encoder = noise.encoder(profile, steps)
    inputs = np.column_stack([reference - encoder, noise.windage(profile, steps, t)])
    targets = np.array([profile.reference(j / rate) for j in range(count)])
    return Scene(profile, plant, inputs, np.array(ticks), np.array(readings), targets)


def _pes(s: Scene, states: np.ndarray) -> np.ndarray:
    """PES from the plant's states at the controller's samples (one row a sample)."""
    used = states[s.ticks, : s.readings.shape[1]]
    return s.targets - np.einsum("ij,ij->i", s.readings, used)


def by_numpy(s: Scene, rows: np.ndarray) -> np.ndarray:
    """A hand-written recursion, one matrix product a sample."""
    a, b = closed_loop(s.plant, rows)
    driven = s.inputs @ b.T
    states = np.zeros_like(driven)
    for k in range(len(driven) - 1):
        states[k + 1] = a @ states[k] + driven[k]
    return _pes(s, states)


def by_scipy(s: Scene, rows: np.ndarray) -> np.ndarray:
    """scipy.signal.dlsim with the states as outputs."""
    a, b = closed_loop(s.plant, rows)
    n = len(a)
    _, _, states = signal.dlsim((a, b, np.eye(n), np.zeros((n, 2)), s.plant.sample_time_s), s.inputs)
    return _pes(s, states)


def by_control(s: Scene, rows: np.ndarray) -> np.ndarray:
    """control.forced_response with the states returned."""
    a, b = closed_loop(s.plant, rows)
    system = control.ss(a, b, np.eye(len(a)), np.zeros((len(a), 2)), s.plant.sample_time_s)
    answer = control.forced_response(system, inputs=s.inputs.T, return_states=True)
    return _pes(s, answer.states.T)


def harmonics(pes: np.ndarray, profile: Profile) -> np.ndarray:
    """|X_k|/N of the window, k = 1 ... N/2, by numpy's FFT."""
    first, last = (profile.first_window_sample + w for w in profile.window)
    window = pes[first:last]
    return np.abs(np.fft.rfft(window))[1:] / len(window)


def bands(amplitudes: np.ndarray, profile: Profile) -> tuple[float, float]:
    """Euclidean norms of both bands."""
    n = profile.window[1] - profile.window[0]
    hz = np.arange(1, len(amplitudes) + 1) * profile.sample_rate_hz / n

    def norm(low: float, high: float) -> float:
        return float(np.linalg.norm(amplitudes[(hz >= low) & (hz <= high)]))

    return norm(*LOW_BAND_HZ), norm(*HIGH_BAND_HZ)


LINES_PER_BIN = 4


@dataclass(frozen=True)
class NoiseOnLines:
    """Densities of the noise on lines a quarter of a bin apart, and the share of each line that every bin takes."""

    q: np.ndarray
    plant: np.ndarray
    encoder: float
    windage: np.ndarray
    shares: np.ndarray

    def power(self, rows: np.ndarray) -> np.ndarray:
        """Expected |X_k|^2/N^2 of the noise for k = 1 ... N/2."""
        loop = self.plant * chain_response(rows, self.q)
        s = 1 / abs(1 + loop) ** 2
        return self.shares @ (s * (self.encoder * abs(loop) ** 2 + self.windage * abs(self.plant) ** 2))


def noise_on_lines(profile: Profile, plant: Sampled) -> NoiseOnLines:
    """The noise of a profile for this plant; the window is rectangular, its leakage included."""
    t, n = plant.sample_time_s, profile.window[1] - profile.window[0]
    bin_hz = profile.sample_rate_hz / n
    spacing = bin_hz / LINES_PER_BIN
    hz = spacing * (np.arange(int(0.5 / t / spacing)) + 0.5)
    q = np.exp(-2j * np.pi * hz * t)
    keep = np.exp(-2 * np.pi * profile.windage_corner_hz * t)
    windage = profile.windage_rms**2 * t * (1 - keep**2) / abs(1 - keep * q) ** 2
    bins = bin_hz * np.arange(1, n // 2 + 1)
    shares = sum(_kernel((sign * hz[None, :] - bins[:, None]) / profile.sample_rate_hz, n) for sign in (1, -1))
    response = block_response(plant, 2 * np.pi * hz)
    return NoiseOnLines(q, response, profile.encoder_rms**2 * t, windage, shares * spacing)


def _kernel(turns: np.ndarray, n: int) -> np.ndarray:
    """|mean of exp(2 pi j turns i), i < n|^2."""
    return (np.sinc(n * turns) / np.sinc(turns)) ** 2


def expected_power_exact(s: Scene, profile: Profile, rows: np.ndarray) -> np.ndarray:
    """The same power with nothing neglected: the sum over all draws of the squared share that each has in X_k.

    One backward recursion gives the shares of all draws; the windage's filter is one more state.
    """
    t, (first, last) = s.plant.sample_time_s, profile.window
    n, start = last - first, profile.first_window_sample
    keep = np.exp(-2 * np.pi * profile.windage_corner_hz * t)
    a, b = closed_loop(s.plant, rows)
    whole = np.zeros((len(a) + 1, len(a) + 1))
    whole[:-1, :-1], whole[:-1, -1], whole[-1, -1] = a, profile.windage_rms * b[:, 1], keep
    encoder = np.append(profile.encoder_rms * b[:, 0], 0.0)
    bins = np.arange(1, n // 2 + 1)
    share = np.zeros((len(bins), len(whole)), dtype=complex)
    power = np.zeros(len(bins))
    j = start + last - 1
    for k in range(s.ticks[j], -1, -1):
        share = share @ whole
        while j >= start + first and s.ticks[j] == k:
            share[:, : s.readings.shape[1]] += np.exp(-2j * np.pi * bins * j / n)[:, None] * s.readings[j] / n
            j -= 1
        # A draw of step k - 1 enters the state of step k; the windage's first value has unit variance.
        fresh = 1 - keep**2 if k > 0 else 1.0
        power += (abs(share @ encoder) ** 2 if k > 0 else 0.0) + fresh * abs(share[:, -1]) ** 2
    return power
