"""The closed loop of one write: its PES at the servo clock and the DFT of its window."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from scipy import signal

import noise
from machine import Profile
from realise import Sampled, closed_loop

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
