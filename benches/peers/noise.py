"""The draws of a write: xoshiro256++ seeded by SplitMix64 (Blackman & Vigna 2021), normals by the polar method.

The same seed must give the same write in both programs, else their PES could not be compared.
"""

from __future__ import annotations

import math

import numpy as np

from machine import Profile

_MASK = (1 << 64) - 1
_ENCODER_STREAM, _WINDAGE_STREAM = 1, 2


class Random:
    """One stream under a seed."""

    def __init__(self, seed: int, stream: int) -> None:
        x = seed ^ ((stream + 1) * 0xD1342543DE82EF95 & _MASK)
        self._state = []
        for _ in range(4):
            x = (x + 0x9E3779B97F4A7C15) & _MASK
            z = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
            self._state.append(z ^ (z >> 31))
        self._spare: float | None = None

    def _bits(self) -> int:
        s = self._state
        out = (_rotated((s[0] + s[3]) & _MASK, 23) + s[0]) & _MASK
        t = (s[1] << 17) & _MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = _rotated(s[3], 45)
        return out

    def _signed(self) -> float:
        return 2.0 * ((self._bits() >> 11) * 2.0**-53) - 1.0

    def normal(self) -> float:
        if self._spare is not None:
            kept, self._spare = self._spare, None
            return kept
        while True:
            a, b = self._signed(), self._signed()
            s = a * a + b * b
            if 0.0 < s < 1.0:
                scale = math.sqrt(-2.0 * math.log(s) / s)
                self._spare = b * scale
                return a * scale


def _rotated(x: int, by: int) -> int:
    return ((x << by) | (x >> (64 - by))) & _MASK


def encoder(profile: Profile, samples: int) -> np.ndarray:
    """White noise of the measured position, one draw a controller sample."""
    if profile.encoder_rms == 0.0:
        return np.zeros(samples)
    r = Random(profile.seed, _ENCODER_STREAM)
    return profile.encoder_rms * np.array([r.normal() for _ in range(samples)])


def windage(profile: Profile, samples: int, sample_time_s: float) -> np.ndarray:
    """First-order coloured noise at the plant input, stationary from the first sample."""
    if profile.windage_rms == 0.0:
        return np.zeros(samples)
    r = Random(profile.seed, _WINDAGE_STREAM)
    keep = math.exp(-2 * math.pi * profile.windage_corner_hz * sample_time_s)
    x, out = r.normal(), []
    for _ in range(samples):
        out.append(profile.windage_rms * x)
        x = keep * x + math.sqrt(1 - keep * keep) * r.normal()
    return np.array(out)
