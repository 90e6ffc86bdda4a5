"""An independent judge: objective and every limit of a spec for a controller or gain table on a plant.

    python judge.py PLANT SPEC GAINS        one line a limit: wanted, found, violation as a share of the limit (negative: room)

Read from the file contract; nothing of the program is used.
"""

from __future__ import annotations

import math
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import law as laws
import loop
import plant as plants
import write
from law import Law

TAU = 2 * math.pi
BANDS = [[600.0, 1500.0], [1500.0, 3000.0]]


@dataclass(frozen=True)
class Judged:
    stable: bool
    objective: float
    violations: dict[str, float]
    """Found over limit less 1, or 1 less found over limit; negative where there is room."""
    figures: dict[str, float]

    @property
    def worst(self) -> float:
        return max(self.violations.values(), default=-math.inf) if self.stable else math.inf


class Bench:
    """A machine at one clock; scenes of profiles are kept."""

    def __init__(self, plant: plants.Plant, sample_time_s: float, points: int = loop.POINTS) -> None:
        self.loop = loop.Bench(plant, sample_time_s, points)
        self._scenes: dict[str, write.Scene] = {}

    def scene(self, profile: dict) -> write.Scene:
        key = repr(profile)
        if key not in self._scenes:
            self._scenes = {key: write.Scene(write.profile_of(profile), self.loop.s)}
        return self._scenes[key]


def objective_name(spec: dict) -> str:
    return spec.get("objective", {}).get("minimise", "pes_rms" if "profile" in spec else "disturbance")


def at_most(found: float | None, limit: float) -> float:
    return found / limit - 1 if found is not None else -1.0


def at_least(found: float | None, limit: float) -> float:
    return 1 - found / limit if found is not None else -1.0


def crossings(found: list[float], low: float, high: float, allowed: list[list[float]]) -> tuple[float, float]:
    """By how much the range is left below and above, over every crossing outside the bands allowed."""
    held = [f for f in found if not any(a <= f <= b for a, b in allowed)]
    if not held:
        return 1.0, 1.0
    return max(1 - f / low for f in held), max(f / high - 1 for f in held)


def curve(bench: Bench, rows: np.ndarray, c: dict) -> float:
    """Largest excess of one curve, over the grid and the curve's own corners."""
    w, hz = bench.loop.w, np.array(c["hz"])
    inside = w[(w >= TAU * hz[0]) & (w <= TAU * hz[-1])]
    extra = TAU * hz[TAU * hz < np.pi / bench.loop.s.t]
    p = np.concatenate([bench.loop.p[(w >= TAU * hz[0]) & (w <= TAU * hz[-1])], bench.loop.s.response(extra)])
    w = np.concatenate([inside, extra])
    if not len(w):
        return -1.0
    k = laws.response(rows, np.exp(-1j * w * bench.loop.s.t))
    s = 1 / (1 + p * k)
    value = abs({"L": p * k, "S": s, "T": p * k * s, "PS": p * s, "CS": k * s}[c["of"]])
    limit = 10 ** (np.interp(np.log(w / TAU), np.log(hz), c["db"]) / 20)
    return float(np.max(value / limit - 1 if c["side"] == "at_most" else 1 - value / limit))


def judge(bench: Bench, spec: dict, profile: dict | None, law: Law, objective: bool = True) -> Judged:
    """Everything that the spec names. `objective = False` leaves the objective out (it may cost a simulation)."""
    m = bench.loop.margins(law)
    figures: dict[str, float] = {"max_sensitivity": m.max_sensitivity}
    for key in ("phase_margin_deg", "gain_margin_db", "bandwidth_hz"):
        if getattr(m, key) is not None:
            figures[key] = getattr(m, key)
    if not m.stable:
        return Judged(False, math.inf, {}, figures)
    wanted, limits, v = spec.get("margins", {}), spec.get("limits", {}), {}
    gains = [hz for hz, _ in m.gain_crossings]
    if gains:
        figures["lowest_crossing_hz"], figures["highest_crossing_hz"] = min(gains), max(gains)
    for key in ("phase_margin_deg", "gain_margin_db"):
        if key in wanted:
            v[key] = at_least(getattr(m, key), wanted[key])
    if "bandwidth_hz" in wanted:
        v["bandwidth_hz"] = at_least(m.bandwidth_hz, wanted["bandwidth_hz"])
    if "max_sensitivity" in wanted:
        v["max_sensitivity"] = at_most(m.max_sensitivity, wanted["max_sensitivity"])
    if "gain_crossover_hz" in wanted:
        low, high = crossings(gains, *wanted["gain_crossover_hz"], wanted.get("phase_stabilised_hz", []))
        v["gain_crossover_hz low"], v["gain_crossover_hz high"] = low, high
    for i, c in enumerate(limits.get("curve", [])):
        v[f"curve {i + 1} {c['of']}"] = curve(bench, law.rows(), c)
    if "overshoot_percent" in limits or "settling_s" in limits:
        over, settling = write.step(bench.loop.s, law)
        figures["overshoot_percent"], figures["settling_s"] = over, settling
        for key in ("overshoot_percent", "settling_s"):
            if key in limits:
                v[key] = at_most(figures[key], limits[key])
    name = objective_name(spec)
    if profile is not None:
        _of_the_write(bench.scene(profile), spec, law, name, figures, v)
    value = math.inf
    if name == "bandwidth" and gains:
        value = 1 / (TAU * min(gains))
    elif name == "integral":
        value = 1 / law.ki_per_s if law.ki_per_s > 0 else math.inf
    elif name == "disturbance" and objective:
        d = spec.get("disturbance", {})
        value = write.disturbance_rms(bench.loop.s, law, d.get("rms", 1.0), d.get("corner_hz", 50.0))
    elif name in ("pes_rms", "dft"):
        value = figures[name]
    elif name == "room":
        value = max(v.values())
    figures["objective"] = value
    return Judged(True, value, v, figures)


def _of_the_write(scene: write.Scene, spec: dict, law: Law, name: str, figures: dict, v: dict) -> None:
    limits = spec.get("limits", {})
    keys = ("dft_low", "dft_high")
    if name == "dft" or any(k in limits for k in keys):
        bands = spec.get("objective", {}).get("bands_hz", BANDS)
        norms = scene.norms(law, [tuple(b) for b in bands])
        for key, norm in zip(keys, norms):
            figures[key] = norm
            if key in limits:
                v[key] = at_most(norm, limits[key])
        weights = [limits.get(k, 1.0) for k in keys] + [1.0] * len(norms)
        figures["dft"] = sum(n / w for n, w in zip(norms, weights))
    if name == "pes_rms":
        figures["pes_rms"] = scene.pes_rms(law)
    if limits.get("harmonics"):
        k = np.array([h["k"] for h in limits["harmonics"]])
        pes = scene.quiet(law)[0]
        found = np.sqrt(abs(np.fft.fft(pes)[k] / len(pes)) ** 2 + scene.noise_power(law, k))
        for h, f in zip(limits["harmonics"], found):
            figures[f"harmonic {h['k']}"] = float(f)
            v[f"harmonic {h['k']}"] = at_most(float(f), h["amplitude"])
    if "command_peak" in limits or "command_rms" in limits:
        command = scene.quiet(law)[1]
        figures["command_peak"], figures["command_rms"] = float(abs(command).max()), float(np.sqrt(np.mean(command**2)))
        if "command_peak" in limits:
            figures["command_peak"] = max(figures["command_peak"], scene.noisy_peak(law))
        for key in ("command_peak", "command_rms"):
            if key in limits:
                v[key] = at_most(figures[key], limits[key])


def guard_of(spec: dict) -> float:
    """Room that the search keeps; 2 % where the spec is silent."""
    return spec.get("guard", 0.02)


def read_spec(path: Path) -> tuple[dict, dict | None]:
    """A spec and its profile."""
    spec = tomllib.loads(path.read_text(encoding="utf-8"))
    profile = spec.get("profile")
    return spec, tomllib.loads((path.parent / profile).read_text(encoding="utf-8")) if profile else None


def main() -> None:
    plant, spec, gains = (Path(a) for a in sys.argv[1:4])
    law, (document, profile) = laws.read(gains), read_spec(spec)
    found = judge(Bench(plants.read(plant), law.sample_time_s), document, profile, law)
    print(
        f"stable {found.stable}; {objective_name(document)} = {found.objective:.6g}; worst violation {found.worst:+.3e}"
    )
    for key, value in found.violations.items():
        print(f"  {key:28} {value:+.3e}")
    print("  " + ", ".join(f"{k} {v:.6g}" for k, v in found.figures.items()))


if __name__ == "__main__":
    main()
