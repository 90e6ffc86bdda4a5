"""Plant, controller, write and limits: what stands in the TOML files, and the formulas that define them.

Written from the file contract alone, so that it can disagree with the program it is compared with.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Mode:
    """(s^2 + 2 zz wz s + wz^2) / (s^2 + 2 zp wp s + wp^2)."""

    zero_rad_s: float
    zero_damping_ratio: float
    pole_rad_s: float
    pole_damping_ratio: float


@dataclass(frozen=True)
class Plant:
    """The product form with a second-order body."""

    dc_gain: float
    natural_frequency_rad_s: float
    damping_ratio: float
    delay_s: float
    resonance_gain: float
    modes: tuple[Mode, ...]

    @property
    def order(self) -> int:
        return 2 + 2 * len(self.modes)

    @property
    def leading_gain(self) -> float:
        """The factor before the monic polynomials."""
        return self.resonance_gain * self.dc_gain * self.natural_frequency_rad_s**2

    def without_delay(self) -> Plant:
        return Plant(**{**self.__dict__, "delay_s": 0.0})

    def denominators(self) -> list[tuple[float, float]]:
        """(frequency, damping) of every second-order denominator, the body first."""
        body = (self.natural_frequency_rad_s, self.damping_ratio)
        return [body] + [(m.pole_rad_s, m.pole_damping_ratio) for m in self.modes]

    def numerators(self) -> list[tuple[float, float]]:
        return [(m.zero_rad_s, m.zero_damping_ratio) for m in self.modes]

    def response(self, w_rad_s: np.ndarray) -> np.ndarray:
        """P(j w), delay included, hold not."""
        s = 1j * np.asarray(w_rad_s)
        value = self.leading_gain * np.exp(-s * self.delay_s)
        for w, d in self.denominators():
            value = value / (s * s + 2 * d * w * s + w * w)
        for w, d in self.numerators():
            value = value * (s * s + 2 * d * w * s + w * w)
        return value

    def toml(self) -> str:
        lines = ['position_unit = "track"', 'command_unit = "V"', "[plant]"]
        keys = ("dc_gain", "natural_frequency_rad_s", "damping_ratio", "delay_s", "resonance_gain")
        lines += [f"{key} = {float(getattr(self, key))!r}" for key in keys]
        for mode in self.modes:
            lines.append("[[plant.modes]]")
            lines += [f"{key} = {float(value)!r}" for key, value in mode.__dict__.items()]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Controller:
    """PID, low-passes, notches at one sample time."""

    sample_time_s: float
    kp: float
    ki_per_s: float
    kd_s: float
    derivative_filter_s: float
    lowpasses: tuple[tuple[float, float], ...] = ()  # Hz, damping
    notches: tuple[tuple[float, float, float], ...] = ()  # Hz, zero damping, pole damping
    output_limit: float | None = None

    def toml(self) -> str:
        lines = [f"sample_time_s = {self.sample_time_s!r}"]
        if self.output_limit is not None:
            lines.append(f"output_limit = {self.output_limit!r}")
        lines += ["[pid]", f"kp = {float(self.kp)!r}", f"ki_per_s = {float(self.ki_per_s)!r}"]
        lines += [f"kd_s = {float(self.kd_s)!r}", f"derivative_filter_s = {float(self.derivative_filter_s)!r}"]
        for hz, damping in self.lowpasses:
            lines += ["[[lowpass]]", f"frequency_hz = {float(hz)!r}", f"damping_ratio = {float(damping)!r}"]
        for hz, zero, pole in self.notches:
            lines += ["[[notch]]", f"frequency_hz = {float(hz)!r}"]
            lines += [f"zero_damping_ratio = {float(zero)!r}", f"pole_damping_ratio = {float(pole)!r}"]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Profile:
    """A spiral write, its servo clock and its noise."""

    velocity: float
    distance: float
    acceleration_time_s: float
    start_s: float
    duration_s: float
    sample_rate_hz: float
    window: tuple[int, int]
    encoder_rms: float
    windage_rms: float
    windage_corner_hz: float
    seed: int

    def reference(self, t: float) -> float:
        """Rest, constant acceleration, constant speed, constant deceleration, rest."""
        ramp, speed = self.acceleration_time_s, abs(self.velocity)
        if self.distance < speed * ramp:
            raise ValueError("this comparison has no write too short for its full speed")
        cruise = self.distance / speed - ramp
        since = min(max(t - self.start_s, 0.0), 2 * ramp + cruise)
        up = min(since, ramp)
        level = min(max(since - ramp, 0.0), cruise)
        down = max(since - ramp - cruise, 0.0)
        return float(np.sign(self.velocity)) * speed * (0.5 * up * up / ramp + level + down - 0.5 * down * down / ramp)

    @property
    def first_window_sample(self) -> int:
        """Servo sample from which the window is counted."""
        return int(np.ceil(self.start_s * self.sample_rate_hz * (1 - 1e-12)))


@dataclass(frozen=True)
class Spec:
    """Limits of a tuning and the box of its search."""

    profile: Profile
    phase_margin_deg: float
    gain_margin_db: float
    max_sensitivity: float
    gain_crossover_hz: tuple[float, float]
    dft_low: float
    dft_high: float
    bounds: dict[str, list[float]] = field(default_factory=dict)


def _document(path: Path) -> dict:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def read_plant(path: Path) -> Plant:
    table = _document(path)["plant"]
    modes = tuple(Mode(**mode) for mode in table.pop("modes", []))
    return Plant(modes=modes, **table)


def read_controller(path: Path) -> Controller:
    d = _document(path)
    lowpasses = tuple((f["frequency_hz"], f["damping_ratio"]) for f in d.get("lowpass", []))
    notches = tuple(
        (f["frequency_hz"], f["zero_damping_ratio"], f["pole_damping_ratio"]) for f in d.get("notch", [])
    )
    return Controller(
        sample_time_s=d["sample_time_s"],
        lowpasses=lowpasses,
        notches=notches,
        output_limit=d.get("output_limit"),
        **d["pid"],
    )


def read_profile(path: Path) -> Profile:
    d = _document(path)
    noise = d.get("noise", {})
    if noise.get("runout"):
        raise ValueError("this comparison has no run-out")
    return Profile(
        **d["spiral"],
        sample_rate_hz=d["pes"]["sample_rate_hz"],
        window=tuple(d["pes"]["window"]),
        encoder_rms=noise.get("encoder_rms", 0.0),
        windage_rms=noise.get("windage_rms", 0.0),
        windage_corner_hz=noise.get("windage_corner_hz", 0.0),
        seed=noise.get("seed", 0),
    )


def read_spec(path: Path) -> Spec:
    d = _document(path)
    margins = d["margins"]
    return Spec(
        profile=read_profile(path.parent / d["profile"]),
        phase_margin_deg=margins["phase_margin_deg"],
        gain_margin_db=margins["gain_margin_db"],
        max_sensitivity=margins["max_sensitivity"],
        gain_crossover_hz=tuple(margins["gain_crossover_hz"]),
        dft_low=d["limits"]["dft_low"],
        dft_high=d["limits"]["dft_high"],
        bounds=d["search"]["bounds"],
    )


def healthy_machine() -> Plant:
    return read_plant(ROOT / "specs/machines/healthy.toml")


def nominal_controller() -> Controller:
    return read_controller(ROOT / "specs/controllers/nominal.toml")


def spiral_write() -> Profile:
    return read_profile(ROOT / "specs/profiles/spiral.toml")


def random_plant(rng: np.random.Generator, pairs: int) -> Plant:
    """A plant around the paper's: body 45-110 Hz, delay 40-80 us, pairs at 800-4900 Hz with damping 0.005-0.05."""

    def between_logs(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    edges = np.geomspace(800.0, 4900.0, pairs + 1)
    modes = []
    for low, high in zip(edges[:-1], edges[1:]):
        centre = 2 * np.pi * between_logs(low, high)
        apart = rng.uniform(0.005, 0.06) * rng.choice([-1.0, 1.0])
        damping = between_logs(0.005, 0.05)
        zero_damping = damping * between_logs(1 / 1.5, 1.5)
        modes.append(Mode(centre * (1 + 0.5 * apart), zero_damping, centre * (1 - 0.5 * apart), damping))
    return Plant(
        dc_gain=rng.uniform(40.0, 120.0),
        natural_frequency_rad_s=2 * np.pi * rng.uniform(45.0, 110.0),
        damping_ratio=rng.uniform(0.1, 0.4),
        delay_s=rng.uniform(40e-6, 80e-6),
        resonance_gain=1.0,
        modes=tuple(modes),
    )
