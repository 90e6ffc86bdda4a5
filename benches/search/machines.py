"""Thirty machines of eight kinds, from their physics, seeded: plant.toml, clock, units and a move for each.

    python machines.py --out target/search        writes machines/NAME.toml and machines/index.json

The nine benchmark cases need the published parameters under `hdd_benchmark_model/` (--data; see README.md); they are read, never copied.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from pathlib import Path

import numpy as np

import product
from plant import Machine, Plant, from_document, pair_roots

ROOT = Path(__file__).resolve().parents[2]
TAU = 2 * math.pi
SEED = 18


def product_toml(
    units: tuple[str, str], body: dict, delay_s: float, modes: list[tuple[float, float, float, float]], gain=1.0
) -> str:
    """Body and monic pairs: zero (Hz), its damping, pole (Hz), its damping."""
    lines = [f'position_unit = "{units[0]}"', f'command_unit = "{units[1]}"', "[plant]"]
    lines += [f"{k} = {float(v)!r}" for k, v in body.items()]
    lines += [f"delay_s = {float(delay_s)!r}", f"resonance_gain = {float(gain)!r}"]
    for fz, dz, fp, dp in modes:
        lines += ["[[plant.modes]]", f"zero_rad_s = {TAU * fz!r}", f"zero_damping_ratio = {float(dz)!r}"]
        lines += [f"pole_rad_s = {TAU * fp!r}", f"pole_damping_ratio = {float(dp)!r}"]
    return "\n".join(lines) + "\n"


def roots_toml(units: tuple[str, str], zeros: list[complex], poles: list[complex], gain: float, delay_s: float) -> str:
    """Zeros, poles and the factor before prod(s - z)/prod(s - p)."""

    def rows(roots: list[complex]) -> str:
        return "[" + ", ".join(f"[{float(r.real)!r}, {float(r.imag)!r}]" for r in roots) + "]"

    return (
        f'position_unit = "{units[0]}"\ncommand_unit = "{units[1]}"\n[plant]\n'
        f"gain = {float(gain)!r}\ndelay_s = {float(delay_s)!r}\n"
        + (f"zeros_rad_s = {rows(zeros)}\n" if len(zeros) else "")
        + f"poles_rad_s = {rows(poles)}\n"
    )


def free_body(acceleration_gain: float, viscous: float) -> dict:
    return {"natural_frequency_rad_s": 0.0, "acceleration_gain": acceleration_gain, "viscous_rate_per_s": viscous}


def held_body(dc_gain: float, hz: float, damping: float) -> dict:
    return {"dc_gain": dc_gain, "natural_frequency_rad_s": TAU * hz, "damping_ratio": damping}


def move(crossover_hz: float, sample_time_s: float, distance: float, noise: float) -> dict:
    """A move sized to the loop: about eight periods of the crossover, a window over the travel at speed."""
    rate = round(0.43 / sample_time_s / max(1.0, 0.43 / sample_time_s / (60 * crossover_hz)), 3)
    ramp, travel = 1.5 / crossover_hz, 8.0 / crossover_hz
    start = 2.0 / crossover_hz
    first, last = round((ramp + 0.5 / crossover_hz) * rate), round(travel * rate)
    return {
        "spiral": {
            "velocity": distance / (travel - ramp),
            "distance": distance,
            "acceleration_time_s": ramp,
            "start_s": start,
            "duration_s": start + 1.3 * (travel + ramp),
        },
        "pes": {"sample_rate_hz": rate, "window": [first, last]},
        "noise": {"encoder_rms": noise * distance, "windage_corner_hz": round(crossover_hz / 10, 3), "seed": 1},
    }


def machine(
    name: str, kind: str, text: str, rate_hz: float, crossover: tuple[float, float], distance: float, first: bool
) -> Machine:
    """Reads the text back, so that the plant judged is the one in the file."""
    import tomllib

    p = from_document(tomllib.loads(text))
    t = round(1.0 / rate_hz, 12)
    profile = move(math.sqrt(crossover[0] * crossover[1]), t, distance, 2e-4)
    # Windage: what moves the free plant by a thousandth of the distance at the crossover.
    wc = TAU * math.sqrt(crossover[0] * crossover[1])
    profile["noise"]["windage_rms"] = float(f"{1e-3 * distance / abs(p.response(np.array([wc]))[0]):.3g}")
    before = product.product_toml(p) if first and profile["pes"]["sample_rate_hz"] > 6100.0 else None
    return Machine(name, kind, p, text, t, crossover, profile, before)


def paper() -> list[Machine]:
    import tomllib

    profile = tomllib.loads((ROOT / "specs/profiles/spiral.toml").read_text(encoding="utf-8"))
    out = []
    for name in ("healthy", "sensor_fault", "loose_pushpin", "tunable"):
        text = (ROOT / f"specs/machines/{name}.toml").read_text(encoding="utf-8")
        p = from_document(tomllib.loads(text))
        out.append(Machine(f"paper_{name}", "spiral writer", p, text, 39.6e-6, (350.0, 900.0), profile, text))
    return out


def benchmark(data: Path) -> list[Machine]:
    """The published main actuator with the second one's loop closed by the fixed lag of `lab hdd`, here in continuous time:
    P = M/(1 + g F lag); its poles are M's and the roots of 1 + g F lag, its residues follow in closed form."""

    def rows(name: str) -> list[tuple[float, float, float]]:
        with (data / "hdd_benchmark_model" / name).open(encoding="utf-8") as f:
            return [(float(r["f_Hz"]), float(r["kappa"]), float(r["zeta"])) for r in csv.DictReader(f)]

    vcm, pzt = rows("vcm_modes.csv"), rows("pzt_modes.csv")
    out = []
    for word, vcm_f, pzt_f, damping in (("room", 1.0, 1.0, 1.0), ("low", 1.04, 1.06, 0.8), ("high", 0.96, 0.94, 1.2)):
        for share in (1.0, 1.05, 0.95):
            p = _two_actuators(vcm, pzt, vcm_f, pzt_f, damping, share)
            name = (
                f"hdd_{word}_{round(100 * (share - 1)):+d}".replace("+0", "0")
                .replace("+", "plus")
                .replace("-", "minus")
            )
            out.append(
                machine(
                    name,
                    "HDD benchmark",
                    roots_toml(("track", "V"), *_roots_of(p), 0.0),
                    50_400.0,
                    (600.0, 1700.0),
                    1.0,
                    True,
                )
            )
    return out


def _roots_of(p: Plant) -> tuple[list[complex], list[complex], float]:
    """Zeros, poles and leading factor; conjugates exact, real ones real."""

    def neat(roots: np.ndarray) -> list[complex]:
        upper = [complex(z) for z in roots if z.imag > 1e-9 * abs(z)]
        return [complex(z.real) for z in roots if abs(z.imag) <= 1e-9 * abs(z)] + [
            w for z in upper for w in (z, z.conjugate())
        ]

    zeros, poles = neat(product.zeros(p)), neat(p.poles())
    leading = p.double + 2 * sum((r * q).real for q, r in p.pairs) + sum(r * q for q, r in p.reals)
    return zeros, poles, leading


def _two_actuators(vcm, pzt, vcm_f, pzt_f, damping, share) -> Plant:
    gain, lag_gain, lag = 3.7976e7, 4.0, TAU * 120.0
    scale = TAU * 1e3  # keeps the eigenvalues' matrix in range

    def upper(hz: float, zeta: float) -> complex:
        w, z = TAU * hz, zeta
        return w * complex(-z, math.sqrt(1 - z * z))

    fine = [(upper(f * pzt_f, z * damping), k) for f, k, z in pzt]
    rest = sum(k / abs(p) ** 2 for p, k in fine)
    fine = [(p, share * k / abs(rest)) for p, k in fine]
    main = [(upper(f * vcm_f, z * damping), gain * k) for f, k, z in vcm if f > 0]
    rigid = sum(gain * k for f, k, _ in vcm if f == 0)

    def sum_of(modes, s: complex) -> complex:
        return sum(k / ((s - p) * (s - p.conjugate())) for p, k in modes)

    def slope_of(modes, s: complex) -> complex:
        return sum(-k * (2 * s - p - p.conjugate()) / ((s - p) * (s - p.conjugate())) ** 2 for p, k in modes)

    def lag_at(s: complex) -> complex:
        return lag_gain * lag / (s + lag)

    def g(s: complex) -> complex:
        return 1 + sum_of(fine, s) * lag_at(s)

    def dg(s: complex) -> complex:
        return slope_of(fine, s) * lag_at(s) - sum_of(fine, s) * lag_at(s) / (s + lag)

    # Roots of 1 + F lag: eigenvalues of the closed second loop, each polished by Newton's rule.
    n = 2 * len(fine) + 1
    a = np.zeros((n, n))
    for i, (p, k) in enumerate(fine):
        j = 2 * i
        a[j, j + 1] = 1.0
        a[j + 1, j], a[j + 1, j + 1] = -(abs(p / scale) ** 2), 2 * (p / scale).real
        a[j + 1, n - 1] = -1.0
        a[n - 1, j] = lag_gain * (lag / scale) * k / scale**2
    a[n - 1, n - 1] = -lag / scale
    pairs, reals = [], []
    for q in np.linalg.eigvals(a) * scale:
        for _ in range(20):
            q -= g(q) / dg(q)
        r = (sum_of(main, q) + rigid / q**2) / dg(q)
        if abs(q.imag) < 1e-9 * abs(q):
            reals.append((q.real, r.real))
        elif q.imag > 0:
            pairs.append((complex(q), complex(r)))
    for p, k in main:
        pairs.append((p, k / (p - p.conjugate()) / g(p)))
    single = (-rigid * dg(0.0) / g(0.0) ** 2).real
    return Plant(tuple(pairs), tuple(reals), (rigid / g(0.0)).real, single, 0.0, "track", "V")


def stages(rng: np.random.Generator) -> list[Machine]:
    """Linear stage: mass on a guide, base on its feet, two modes of the frame; the last with its current loop as a real pole."""
    out = []
    for i in range(3):
        u = rng.uniform
        mass, force = u(6.0, 16.0), u(40.0, 90.0)
        accel = force / mass * 1e6
        feet, frame, third = u(22.0, 34.0), u(140.0, 190.0), u(380.0, 620.0)
        modes = [
            (feet, 0.04, feet * u(1.01, 1.05), 0.04),
            (frame * u(0.90, 0.97), 0.012, frame, 0.010),
            (third * u(0.92, 1.06), 0.015, third, 0.012),
        ]
        units, delay = ("um", "A"), u(120e-6, 240e-6)
        first = i < 2
        if first:
            text = product_toml(units, free_body(accel, u(0.5, 3.0)), delay, modes)
        else:
            current = TAU * 1500.0
            zeros, poles = _pairs(modes)
            text = roots_toml(
                units, zeros, [0j, complex(-u(0.5, 3.0)), complex(-current)] + poles, accel * current, delay
            )
        out.append(machine(f"stage_{i + 1}", "linear stage", text, 10_000.0, (30.0, 90.0), 2000.0, first))
    return out


def _pairs(modes: list[tuple[float, float, float, float]]) -> tuple[list[complex], list[complex]]:
    zeros, poles = [], []
    for fz, dz, fp, dp in modes:
        zeros += pair_roots(TAU * fz, dz)
        poles += pair_roots(TAU * fp, dp)
    return zeros, poles


def gantries(rng: np.random.Generator) -> list[Machine]:
    """Two masses and a spring: measured at the motor (a zero below the pole) or at the load (no zero)."""
    out = []
    for i, rate in enumerate((4000.0, 8000.0, 8000.0)):
        u = rng.uniform
        motor, load = u(8.0, 14.0), u(6.0, 18.0)
        zero = u(70.0, 130.0)
        pole = zero * math.sqrt(1 + load / motor)
        accel = u(15.0, 40.0) * 1e3 / (motor + load) * 10
        units, delay, viscous = ("mm", "V"), u(0.9, 1.6) / rate, u(0.5, 4.0)
        second = u(300.0, 500.0)
        modes = [(second * 0.96, 0.02, second, 0.02)]
        if i < 2:
            modes = [(zero, 0.012, pole, 0.012)] + modes
            # Monic pairs raise the top; the physical gain at low frequency is that of both masses.
            text = product_toml(units, free_body(accel, viscous), delay, modes, gain=(pole / zero) ** 2)
            first = rate >= 8000.0
        else:
            zeros, poles = _pairs(modes)
            text = roots_toml(
                units,
                zeros,
                [0j, complex(-viscous)] + poles + pair_roots(TAU * pole, 0.02),
                accel * (TAU * pole) ** 2,
                delay,
            )
            first = False
        out.append(machine(f"gantry_{i + 1}", "gantry", text, rate, (10.0, 26.0), 100.0, first))
    return out


def galvos(rng: np.random.Generator) -> list[Machine]:
    """Galvanometer: rotor on a weak torsion spring, shaft and mirror modes; the last with its coil as a real pole."""
    out = []
    for i, rate in enumerate((100_000.0, 50_000.0, 80_000.0)):
        u = rng.uniform
        shaft, mirror = u(2400.0, 4200.0), u(9000.0, 13000.0)
        modes = [(shaft * u(0.86, 0.97), 0.008, shaft, 0.006), (mirror * u(0.93, 1.05), 0.012, mirror, 0.01)]
        units, delay = ("rad", "V"), u(8e-6, 18e-6)
        spring, damping, at_rest = u(25.0, 80.0), u(0.2, 0.6), u(0.2, 0.6)
        first = i < 2
        if first:
            text = product_toml(units, held_body(at_rest, spring, damping), delay, modes)
        else:
            coil = TAU * 18_000.0
            zeros, poles = _pairs(modes)
            w0 = TAU * spring
            text = roots_toml(
                units, zeros, pair_roots(w0, damping) + [complex(-coil)] + poles, at_rest * w0 * w0 * coil, delay
            )
        out.append(machine(f"galvo_{i + 1}", "galvo", text, rate, (700.0, 1700.0), 0.02, first))
    return out


def voice_coils(rng: np.random.Generator) -> list[Machine]:
    """Voice coil on a pivot spring, as a sum of modes; every second residue is negative (measured beyond the mode's node)."""
    out = []
    for i in range(3):
        u = rng.uniform
        accel = u(1.5e8, 4e8)
        terms = [(TAU * u(40.0, 80.0), u(0.15, 0.4), accel)]
        for hz, share in (
            (900.0, 0.04),
            (2200.0, -0.12),
            (3600.0, 0.1),
            (4900.0, -0.5),
            (7200.0, -0.2),
            (9000.0, 0.15),
        ):
            terms.append((TAU * hz * u(0.94, 1.06), u(0.008, 0.02), share * u(0.7, 1.3) * accel))
        text = f'position_unit = "track"\ncommand_unit = "A"\n[plant]\ndelay_s = {u(18e-6, 34e-6)!r}\n'
        for w, d, gain in terms:
            text += f"[[plant.residue]]\ngain = {gain!r}\nfrequency_rad_s = {w!r}\ndamping_ratio = {d!r}\n"
        out.append(machine(f"vcm_{i + 1}", "voice coil", text, 20_000.0, (500.0, 1100.0), 10.0, True))
    return out


def belts(rng: np.random.Generator) -> list[Machine]:
    """Motor with belt: measured at the motor, or at the carriage behind the belt."""
    out = []
    for i, rate in enumerate((1000.0, 4000.0)):
        u = rng.uniform
        zero = u(24.0, 34.0)
        pole = zero * u(1.6, 2.2)
        accel, viscous, delay = u(600.0, 2000.0), u(2.0, 9.0), u(0.4, 0.9) / rate
        units = ("mm", "A")
        if i == 0:
            text = product_toml(
                units, free_body(accel, viscous), delay, [(zero, 0.05, pole, 0.04)], gain=(pole / zero) ** 2
            )
        else:
            text = roots_toml(
                units, [], [0j, complex(-viscous)] + pair_roots(TAU * pole, 0.05), accel * (TAU * pole) ** 2, delay
            )
        out.append(machine(f"belt_{i + 1}", "belt drive", text, rate, (4.0, 11.0), 200.0, False))
    return out


def bearings(rng: np.random.Generator) -> list[Machine]:
    """Magnetic bearing: negative stiffness (one unstable pole), amplifier as a real pole, bending modes of the shaft."""
    out = []
    for i, rate in enumerate((10_000.0, 20_000.0, 12_500.0)):
        u = rng.uniform
        p, amplifier, accel = TAU * u(18.0, 45.0), TAU * u(1800.0, 3000.0), u(1.0e7, 4.0e7)
        bend, second = u(620.0, 900.0), u(1500.0, 2100.0)
        modes = [(bend * u(0.9, 0.97), 0.006, bend, 0.005), (second * u(0.94, 1.05), 0.008, second, 0.007)]
        zeros, poles = _pairs(modes)
        text = roots_toml(
            ("um", "A"),
            zeros,
            [complex(p), complex(-p), complex(-amplifier)] + poles,
            accel * amplifier,
            u(0.6, 1.1) / rate,
        )
        out.append(machine(f"bearing_{i + 1}", "magnetic bearing", text, rate, (110.0, 260.0), 50.0, False))
    return out


def every(data: Path) -> list[Machine]:
    """The thirty machines; each kind has its own stream, so that one kind can change alone."""
    streams = np.random.SeedSequence(SEED).spawn(6)
    makers = (stages, gantries, galvos, voice_coils, belts, bearings)
    return paper() + benchmark(data) + [m for make, s in zip(makers, streams) for m in make(np.random.default_rng(s))]


def write(machines: list[Machine], folder: Path) -> None:
    """machines/NAME.toml and what else is known of each."""
    folder = folder / "machines"
    folder.mkdir(parents=True, exist_ok=True)
    index = {}
    for m in machines:
        (folder / f"{m.name}.toml").write_text(m.toml, encoding="utf-8")
        if m.before is not None:
            (folder / "before").mkdir(exist_ok=True)
            (folder / f"before/{m.name}.toml").write_text(m.before, encoding="utf-8")
        index[m.name] = {"kind": m.kind, "sample_time_s": m.sample_time_s, "first_edition": m.first_edition}
    (folder / "index.json").write_text(json.dumps(index, indent=1), encoding="utf-8")


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--out", type=Path, default=ROOT / "target/search")
    a.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    words = a.parse_args()
    found = every(words.data)
    write(found, words.out)
    print(f"{len(found)} machines of {len({m.kind for m in found})} kinds in {words.out / 'machines'}")


if __name__ == "__main__":
    main()
