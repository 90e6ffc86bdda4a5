"""The write of a profile: position at the servo clock without noise, and what noise is expected to add, by exact recursions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from law import Law
from loop import Closed, Sampled, close


@dataclass(frozen=True)
class Profile:
    velocity: float
    distance: float
    ramp: float
    start: float
    duration: float
    rate: float
    window: tuple[int, int]
    encoder: float
    windage: float
    corner_hz: float
    spindle_hz: float
    runout: tuple[tuple[float, float, float], ...]

    def reference(self, t: np.ndarray) -> np.ndarray:
        """Rest, constant acceleration, constant speed, constant deceleration, rest; a short move turns back at the speed it reaches."""
        speed, ramp = abs(self.velocity), self.ramp
        accel = speed / ramp
        if self.distance < speed * ramp:
            ramp = np.sqrt(self.distance / accel)
            speed = accel * ramp
        cruise = self.distance / speed - ramp
        x = np.clip(np.asarray(t, float) - self.start, 0.0, 2 * ramp + cruise)
        up, level, down = np.minimum(x, ramp), np.clip(x - ramp, 0.0, cruise), np.maximum(x - ramp - cruise, 0.0)
        return np.sign(self.velocity) * (accel * up * up / 2 + speed * level + speed * down - accel * down * down / 2)

    def first(self) -> int:
        """Servo sample from which the window is counted."""
        return int(np.ceil(self.start * self.rate * (1 - 1e-12)))

    def bins_hz(self) -> np.ndarray:
        n = self.window[1] - self.window[0]
        return np.arange(1, n // 2 + 1) * self.rate / n


def profile_of(d: dict) -> Profile:
    """The document profile.toml."""
    s, noise = d["spiral"], d.get("noise", {})
    run = tuple((r["order"], r["amplitude"], np.radians(r.get("phase_deg", 0.0))) for r in noise.get("runout", []))
    return Profile(
        s["velocity"],
        s["distance"],
        s["acceleration_time_s"],
        s["start_s"],
        s["duration_s"],
        d["pes"]["sample_rate_hz"],
        tuple(d["pes"]["window"]),
        noise.get("encoder_rms", 0.0),
        noise.get("windage_rms", 0.0),
        noise.get("windage_corner_hz", 0.0),
        noise.get("spindle_hz", 0.0),
        run,
    )


class Scene:
    """All of a write that does not depend on the gains, to the end of its window."""

    def __init__(self, p: Profile, s: Sampled) -> None:
        self.profile, self.s = p, s
        count = max(p.first() + p.window[1], 1)
        at = np.arange(count) / p.rate
        k = np.floor(at / s.t).astype(int)
        off = at - k * s.t
        over = off > s.t * (1 - 1e-9)
        self.tick, off = k + over, np.where(over, 0.0, off)
        self.first = p.first() + p.window[0]
        self.rows = {j: s.reading(off[j]) for j in range(self.first, count)}
        self.count, self.steps = count, int(self.tick[-1]) + 1
        self.target = p.reference(at)
        for order, amplitude, phase in p.runout:
            self.target = self.target + amplitude * np.cos(2 * np.pi * order * p.spindle_hz * at + phase)
        every = int(p.duration / s.t) + 1
        self.times = np.arange(every) * s.t
        self.r = p.reference(self.times)

    def quiet(self, law: Law) -> tuple[np.ndarray, np.ndarray]:
        """PES of the window, and every command of the whole write, without noise."""
        c, f = close(self.s, law.rows()), law.feedforward
        ahead = np.zeros(len(self.r))
        if f:
            t, seen = self.s.t, self.times + f.get("ahead_samples", 0) * self.s.t
            before, now, after = (self.profile.reference(seen + i * t) for i in (-1, 0, 1))
            ahead = f.get("factor", 0.0) * (
                f.get("velocity_s", 0.0) * (after - before) / (2 * t)
                + f.get("acceleration_s2", 0.0) * (after - 2 * now + before) / t**2
            )
        x = np.zeros((len(self.r) + 1, len(c.a)))
        driven = np.outer(self.r, c.b_r) + np.outer(ahead, c.b_w)
        for k in range(len(self.r)):
            x[k + 1] = c.a @ x[k] + driven[k]
        command = x[:-1] @ c.k + c.d * self.r + ahead
        pes, d = [], self.s.whole
        for j in range(self.first, self.count):
            row, now, before = self.rows[j]
            k = self.tick[j]
            held = np.concatenate([[command[k]], x[k, c.n : c.n + d + 1]])
            pes.append(self.target[j] - row @ x[k, : c.n] - now * held[d] - before * held[d + 1])
        return np.array(pes), command

    def _reading(self, j: int, c: Closed) -> tuple[np.ndarray, float, float]:
        """Position of servo sample j: row of X, factor of (r - v)[k] and of w[k]."""
        row, now, before = self.rows[j]
        out, d = np.zeros(len(c.a)), self.s.whole
        out[: c.n] = row
        direct = (now, before)
        r = w = 0.0
        for i, g in enumerate(direct):
            if d + i == 0:
                out += g * c.k
                r, w = g * c.d, g
            else:
                out[c.n + d + i - 1] += g
        return out, r, w

    def noise_variance(self, law: Law) -> float:
        """Mean over the window of the PES' variance: the covariance from rest, step by step."""
        p, c = self.profile, close(self.s, law.rows())
        n, keep = len(c.a), np.exp(-2 * np.pi * p.corner_hz * self.s.t)
        a = np.zeros((n + 1, n + 1))
        a[:n, :n], a[:n, n], a[n, n] = c.a, p.windage * c.b_w, keep
        b = np.append(p.encoder * c.b_r, 0.0)
        q = np.outer(b, b)
        q[n, n] = 1 - keep**2
        cov, total, j = np.zeros((n + 1, n + 1)), 0.0, self.first
        cov[n, n] = 1.0
        for k in range(self.steps):
            while j < self.count and self.tick[j] == k:
                row, r, w = self._reading(j, c)
                row = np.append(row, w * p.windage)
                total += row @ cov @ row + (r * p.encoder) ** 2
                j += 1
            cov = a @ cov @ a.T + q
        return total / (self.count - self.first)

    def noisy_peak(self, law: Law) -> float:
        """Least peak of the command that its noise alone can be expected to reach: four fifths of sqrt(2 ln n) standard deviations at the end."""
        p, c = self.profile, close(self.s, law.rows())
        n, keep = len(c.a), np.exp(-2 * np.pi * p.corner_hz * self.s.t)
        a, b = np.zeros((n + 1, n + 1)), np.append(p.encoder * c.b_r, 0.0)
        a[:n, :n], a[:n, n], a[n, n] = c.a, p.windage * c.b_w, keep
        q = np.outer(b, b)
        q[n, n] = 1 - keep**2
        cov = np.zeros((n + 1, n + 1))
        cov[n, n] = 1.0
        for _ in range(self.steps):
            cov = a @ cov @ a.T + q
        deviation = np.sqrt(c.k @ cov[:n, :n] @ c.k + (c.d * p.encoder) ** 2)
        return float(0.8 * np.sqrt(2 * np.log(max(len(self.r), 2))) * deviation)

    def noise_power(self, law: Law, bins: np.ndarray) -> np.ndarray:
        """Expected |X_k|^2/N^2 of the noise for these k: one backward recursion gives every draw's share."""
        p, c, n = self.profile, close(self.s, law.rows()), self.count - self.first
        size, keep = len(c.a), np.exp(-2 * np.pi * p.corner_hz * self.s.t)
        a = np.zeros((size + 1, size + 1))
        a[:size, :size], a[:size, size], a[size, size] = c.a, p.windage * c.b_w, keep
        encoder = np.append(p.encoder * c.b_r, 0.0)
        share, power, j = np.zeros((len(bins), size + 1), complex), np.zeros(len(bins)), self.count - 1
        for k in range(self.steps - 1, -1, -1):
            direct = np.zeros(len(bins), complex)
            from_next = share @ encoder
            power += (1 - keep**2) * abs(share[:, size]) ** 2
            share = share @ a
            while j >= self.first and self.tick[j] == k:
                turn = np.exp(-2j * np.pi * bins * (j - self.first) / n) / n
                row, r, w = self._reading(j, c)
                share[:, :size] += np.outer(turn, row)
                share[:, size] += turn * w * p.windage
                direct += turn * r * p.encoder
                j -= 1
            power += abs(from_next + direct) ** 2
        return power + abs(share[:, size]) ** 2

    def norms(self, law: Law, bands: list[tuple[float, float]]) -> list[float]:
        """Euclidean norm of the amplitudes over each band, noise by its expectation."""
        pes, hz = self.quiet(law)[0], self.profile.bins_hz()
        square = abs(np.fft.rfft(pes)[1 : len(hz) + 1] / len(pes)) ** 2
        used = np.zeros(len(hz), bool)
        for low, high in bands:
            used |= (hz >= low) & (hz <= high)
        k = np.nonzero(used)[0]
        if self.profile.encoder or self.profile.windage:
            square[k] += self.noise_power(law, k + 1)
        return [float(np.sqrt(square[(hz >= low) & (hz <= high)].sum())) for low, high in bands]

    def pes_rms(self, law: Law) -> float:
        """Root of the window's mean square, noise by its expectation."""
        mean = float(np.mean(self.quiet(law)[0] ** 2))
        noisy = self.profile.encoder or self.profile.windage
        return float(np.sqrt(mean + (self.noise_variance(law) if noisy else 0.0)))


def disturbance_rms(s: Sampled, law: Law, rms: float, corner_hz: float) -> float:
    """Position at the controller's samples under first-order coloured noise at the plant's input, stationary."""
    c = close(s, law.rows())
    n, keep = len(c.a), np.exp(-2 * np.pi * corner_hz * s.t)
    a = np.zeros((n + 1, n + 1))
    a[:n, :n], a[:n, n], a[n, n] = c.a, rms * c.b_w, keep
    # Doubling: cov = sum of A^i Q A^i'.
    cov, power = np.zeros((n + 1, n + 1)), a
    cov[n, n] = 1 - keep**2
    for _ in range(60):
        added = power @ cov @ power.T
        cov = cov + added
        if abs(added).max() <= 1e-16 * abs(cov).max():
            break
        power = power @ power
    row = s.c
    return float(np.sqrt(row @ cov[: c.n, : c.n] @ row))


def step(s: Sampled, law: Law) -> tuple[float, float]:
    """Overshoot (percent) and settling time (s, to 2 %) of a step of the reference, at the controller's samples."""
    c = close(s, law.rows())
    slowest = abs(np.linalg.eigvals(c.a)).max()
    if slowest >= 1:
        return np.inf, np.inf
    length = int(np.clip(np.log(1e-5) / np.log(slowest), 50, 400_000))
    # Homogeneous with the step as one more state; a block of outputs is one product.
    n, block = len(c.a), 256
    m = np.zeros((n + 1, n + 1))
    m[:n, :n], m[:n, n], m[n, n] = c.a, c.b_r, 1.0
    rows = [np.concatenate([s.c, np.zeros(n + 1 - len(s.c))])]
    for _ in range(block - 1):
        rows.append(rows[-1] @ m)
    outputs, jump = np.array(rows), np.linalg.matrix_power(m, block)
    x, parts = np.zeros(n + 1), []
    x[n] = 1.0
    for _ in range(0, length, block):
        parts.append(outputs @ x)
        x = jump @ x
    y = np.concatenate(parts)
    final = y[-1] if abs(y[-1] - 1) > 0.019 else 1.0
    outside = np.nonzero(abs(y - final) > 0.02)[0]
    return 100 * max(y.max() - 1, 0.0), (outside[-1] + 1) * s.t if len(outside) else 0.0
