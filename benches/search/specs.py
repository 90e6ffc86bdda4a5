"""Three hundred specs in the second edition of spec.toml over the thirty machines, seeded.

    python specs.py --out target/search [--unseen]        writes specs/ID/{spec.toml, profile.toml, meta.json}

Kinds of spec: `random` (limits are a stable controller's own figures with a little slack, so that controller proves it feasible), `chain` (a family
that differs in one limit only), `infeasible` (no linear controller, or none of the structure, can meet it, by an argument kept in meta.json).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from pathlib import Path

import numpy as np

import impossible
import judge
import machines
import toml_text
import witness
from law import Law
from plant import Machine

SEED = 300
RANDOM, INFEASIBLE = 174, 30
PAPER_MS = (1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.2, 2.4)
CHAINS = (
    ("stage_1", "max_sensitivity"),
    ("gantry_2", "max_sensitivity"),
    ("galvo_1", "max_sensitivity"),
    ("vcm_1", "max_sensitivity"),
    ("belt_1", "max_sensitivity"),
    ("bearing_1", "max_sensitivity"),
    ("hdd_room_0", "max_sensitivity"),
    ("vcm_2", "phase_margin_deg"),
    ("galvo_2", "phase_margin_deg"),
    ("stage_3", "gain_margin_db"),
)
CONVEX = ("paper_healthy", "paper_loose_pushpin", "stage_1", "gantry_2", "galvo_1", "galvo_3", "belt_1", "bearing_3")
CHAIN_STEPS = (0.9, 0.95, 1.02, 1.1, 1.2, 1.35)
FILTER_S = 12e-6


class Maker:
    """Benches are kept, one a machine."""

    def __init__(self, every: list[Machine]) -> None:
        self.every = {m.name: m for m in every}
        self._benches: dict[str, judge.Bench] = {}

    def bench(self, m: Machine) -> judge.Bench:
        if m.name not in self._benches:
            self._benches[m.name] = judge.Bench(m.plant, m.sample_time_s, 20_000)
        return self._benches[m.name]

    def random(self, rng: np.random.Generator, m: Machine, first: bool, want: str | None = None) -> tuple[dict, Law]:
        """A spec and the controller that meets it; `want` is a margin that must be among the limits."""
        for _ in range(40):
            made = self._try(rng, m, first, want)
            if made:
                return made
        raise RuntimeError(f"no stable controller found for {m.name}")

    def _try(self, rng, m: Machine, first: bool, want: str | None):
        bench = self.bench(m)
        held = m.plant.double == 0 and all(p != 0 for p, _ in m.plant.reals) and not m.plant.unstable_poles()
        choice = ["pid"] * 7 + ["lead", "p_pi"] + (["pi"] if held else [])
        structure = "pid" if first or want else str(rng.choice(choice))
        if m.kind == "piezo scanner":
            structure = str(rng.choice(["pi", "pid"]))
        notches, lowpasses = int(rng.integers(0, 4)), int(rng.integers(0, 3))
        filter_s = FILTER_S if first else float(f"{m.sample_time_s * rng.uniform(0.3, 1.5):.3g}")
        if structure in ("p_pi", "pi"):
            filter_s = 0.0
        law = witness.draw(rng, m, bench, structure, notches, lowpasses, filter_s)
        if law is None:
            return None
        guard = 0.0 if first else float(rng.choice([0.0, 0.02, 0.05], p=[0.6, 0.3, 0.1]))
        names = ["pes_rms", "dft", "disturbance", "bandwidth", "integral", "room"]
        name = "dft" if first else str(rng.choice(names, p=[0.25, 0.2, 0.25, 0.1, 0.1, 0.1]))
        if structure == "lead" and name == "integral":
            name = "bandwidth"
        spec: dict = {"sample_time_s": m.sample_time_s}
        if name in ("pes_rms", "dft"):
            spec["profile"] = "profile.toml"
        if guard != 0.02 or rng.random() < 0.3:
            spec["guard"] = guard
        spec["objective"] = {"minimise": name}
        profile = m.profile if "profile" in spec else None
        crossing = math.sqrt(m.crossover_hz[0] * m.crossover_hz[1])
        if name == "dft" and not first:
            spec["objective"]["bands_hz"] = [[0.5 * crossing, 1.3 * crossing], [1.3 * crossing, 3.0 * crossing]]
        if name == "disturbance":
            spec["disturbance"] = {"rms": 1.0, "corner_hz": float(f"{crossing * rng.uniform(0.02, 0.3):.3g}")}
        self._limits(rng, m, bench, spec, profile, law, first, guard, structure, want)
        found = judge.judge(bench, spec, profile, law)
        if not found.stable or not math.isfinite(found.objective):
            return None
        if any(v > (-0.99 * guard if guard else -1e-3) for v in found.violations.values()):
            return None
        self._search(rng, m, spec, law, first, structure, notches, lowpasses)
        return spec, law

    def _limits(self, rng, m, bench, spec, profile, law, first, guard, structure, want) -> None:
        """Limits from the controller's own figures, each with a slack of its own."""
        f = bench.loop.margins(law)

        def below(value: float) -> float:
            return value / (1 + guard) / (1 + rng.uniform(0.005, 0.1))

        def above(value: float) -> float:
            return value / (1 - guard) * (1 + rng.uniform(0.005, 0.1))

        margins: dict = {}
        if rng.random() < 0.75 or want == "max_sensitivity":
            margins["max_sensitivity"] = above(f.max_sensitivity)
        if rng.random() < 0.5 or want == "phase_margin_deg" or not margins:
            margins["phase_margin_deg"] = below(f.phase_margin_deg)
        if f.gain_margin_db and (rng.random() < 0.5 or want == "gain_margin_db"):
            margins["gain_margin_db"] = below(f.gain_margin_db)
        gains = [hz for hz, _ in f.gain_crossings]
        name = spec["objective"]["minimise"]
        if rng.random() < 0.6:
            top = above(max(gains)) * (1.0 if name not in ("bandwidth",) and rng.random() < 0.6 else 2.0)
            bottom = below(min(gains)) * (1.0 if name == "room" or rng.random() < 0.4 else 0.5)
            margins["gain_crossover_hz"] = [bottom, top]
        if not first and (rng.random() < 0.2 or name == "room"):
            margins["bandwidth_hz"] = below(f.bandwidth_hz)
        spec["margins"] = margins
        limits: dict = {}
        if not first:
            curves = [
                self._curve(rng, m, bench, law, of, guard, gains)
                for of, p in (("S", 0.25), ("L", 0.3), ("T", 0.15), ("CS", 0.1), ("PS", 0.1))
                if rng.random() < p
            ]
            if curves:
                limits["curve"] = curves
            if structure != "p_pi" and rng.random() < 0.15:
                found = judge.judge(
                    bench,
                    {"limits": {"overshoot_percent": 1.0, "settling_s": 1.0}, "objective": {"minimise": "bandwidth"}},
                    None,
                    law,
                ).figures
                if found["overshoot_percent"] > 1.0:
                    limits["overshoot_percent"] = above(found["overshoot_percent"])
                if rng.random() < 0.5:
                    limits["settling_s"] = 1.1 * above(found["settling_s"])
        if profile is not None:
            keys = {"dft_low": 0.4, "dft_high": 0.4} if name == "dft" else {}
            chosen = {k: 1.0 for k, p in keys.items() if rng.random() < p or first}
            if rng.random() < 0.2:
                chosen["command_peak"] = 1.0
            if chosen:
                found = judge.judge(bench, {**spec, "limits": chosen}, profile, law).figures
                limits.update({k: above(found[k]) * (1.3 if k == "command_peak" else 1.0) for k in chosen})
        if limits:
            spec["limits"] = limits

    def _curve(self, rng, m, bench, law, of: str, guard: float, gains: list[float]) -> dict:
        """A straight line in log frequency and dB that touches the controller's own curve, with slack."""
        nyquist, lowest, highest = 0.5 / m.sample_time_s, min(gains), max(gains)
        hz, slope = {
            "S": ((lowest / 60, lowest / rng.uniform(3, 8)), 20.0),
            "L": ((min(highest * rng.uniform(2, 4), 0.5 * nyquist), 0.95 * nyquist), -20.0),
            "T": ((lowest / 10, 0.9 * nyquist), 0.0),
            "CS": ((highest, 0.9 * nyquist), 0.0),
            "PS": ((lowest / 30, 0.9 * nyquist), 0.0),
        }[of]
        side = "at_most"
        if of == "L" and rng.random() < 0.35:
            hz, slope, side = (lowest / 60, lowest / rng.uniform(3, 8)), -20.0, "at_least"
        line = [0.0, slope * math.log10(hz[1] / hz[0])]
        touched = judge.curve(bench, law.rows(), {"of": of, "side": side, "hz": list(hz), "db": line})
        slack = rng.uniform(0.1, 1.0)
        if side == "at_most":
            offset = 20 * math.log10((1 + touched) / (1 - guard)) + slack
        else:
            offset = 20 * math.log10((1 - touched) / (1 + guard)) - slack
        return {"of": of, "side": side, "hz": list(hz), "db": [d + offset for d in line]}

    def _search(self, rng, m, spec, law: Law, first: bool, structure: str, notches: int, lowpasses: int) -> None:
        search: dict = {"seed": 1, "notches": notches, "lowpasses": lowpasses}
        if first or rng.random() < 0.5:
            nyquist = 0.5 / m.sample_time_s
            bounds = {}
            for key in ("kp", "ki_per_s", "kd_s"):
                value = getattr(law, key)
                bounds[key] = [value / 40, value * 40] if value > 0 else [0.0, 0.0]
            low, high = m.crossover_hz
            bounds["lowpass_hz"] = [2.0 * low, 0.95 * nyquist]
            bounds["notch_hz"] = [1.2 * low, 0.95 * nyquist]
            if structure != "p_pi":
                search["bounds"] = bounds
        spec["search"] = search
        if first:
            return
        spec["structure"] = {"controller": structure}
        if structure in ("pid", "lead"):
            f = law.derivative_filter_s
            spec["structure"]["derivative_filter_s"] = f if rng.random() < 0.6 else [f / 6, f * 4]


def write(folder: Path, m: Machine, spec: dict, kind: str, law: Law | None, maker: Maker, **more) -> None:
    """One spec with its profile and what is known of it."""
    folder.mkdir(parents=True, exist_ok=True)
    text = toml_text.text(spec)
    (folder / "spec.toml").write_text(text, encoding="utf-8")
    profile = None
    if "profile" in spec:
        profile = m.profile
        (folder / "profile.toml").write_text(toml_text.text(profile), encoding="utf-8")
    meta = {"machine": m.name, "machine_kind": m.kind, "kind": kind, **more}
    if law is not None:
        meta["witness"] = {
            k: v
            for k, v in law.__dict__.items()
            if k in ("sample_time_s", "kp", "ki_per_s", "kd_s", "derivative_filter_s", "lowpasses", "notches")
        }
        meta["witness_objective"] = judge.judge(maker.bench(m), spec, profile, law).objective
    digest = hashlib.sha256((m.toml + text + json.dumps(profile)).encode())
    meta["digest"] = digest.hexdigest()[:16]
    (folder / "meta.json").write_text(json.dumps(meta, indent=1), encoding="utf-8")


def chain_spec(spec: dict, key: str, witnessed: float, step: float) -> tuple[dict, bool]:
    """The base spec with one limit at a step; whether the witness still meets it."""
    guard = judge.guard_of(spec)
    lower_is_tighter = key == "max_sensitivity"
    base = witnessed / (1 - guard) if lower_is_tighter else witnessed / (1 + guard)
    value = base * step if lower_is_tighter else base / step
    return {**spec, "margins": {**spec["margins"], key: value}}, step >= 1.02


def make(out: Path, every: list[Machine], seed: int) -> int:
    """All specs; each has a stream of its own."""
    maker, folder, count = Maker(every), out / "specs", 0
    streams = iter(np.random.SeedSequence(seed).spawn(1000))
    rng = lambda: np.random.default_rng(next(streams))  # noqa: E731
    unseen = every[0].kind == "piezo scanner"
    for i in range(RANDOM if not unseen else 40):
        m = every[i % len(every)]
        r = rng()
        first = m.first_edition and r.random() < 0.55
        spec, law = maker.random(r, m, first)
        write(folder / f"{'u' if unseen else 'r'}{i:03}", m, spec, "random", law, maker, first_edition=first)
        count += 1
    if unseen:
        return count
    for name in ("healthy", "sensor_fault", "loose_pushpin", "tunable"):
        m = maker.every[f"paper_{name}"]
        paper, _ = judge.read_spec(machines.ROOT / "specs/limits/paper.toml")
        for k, limit in enumerate(PAPER_MS):
            spec = {
                "sample_time_s": m.sample_time_s,
                "guard": 0.0,
                **paper,
                "profile": "profile.toml",
                "objective": {"minimise": "dft"},
            }
            spec["margins"] = {**paper["margins"], "max_sensitivity": limit}
            write(folder / f"c_{m.name}_{k}", m, spec, "chain", None, maker, first_edition=True, chain=m.name, step=k)
            count += 1
    for name, key in CHAINS:
        m, r = maker.every[name], rng()
        spec, law = maker.random(r, m, m.first_edition, want=key)
        f = maker.bench(m).loop.margins(law)
        for k, step in enumerate(CHAIN_STEPS):
            stepped, proved = chain_spec(spec, key, getattr(f, key), step)
            known = law if proved else None
            write(
                folder / f"c_{name}_{k}",
                m,
                stepped,
                "chain",
                known,
                maker,
                first_edition=m.first_edition,
                chain=name,
                step=k,
            )
            count += 1
    for i in range(INFEASIBLE):
        m, spec, why = impossible.draw(rng(), maker, i)
        write(folder / f"x{i:02}", m, spec, "infeasible", None, maker, first_edition=False, why=why)
        count += 1
    for name in CONVEX:
        m, r = maker.every[name], rng()
        spec, law = largest_integral(r, m, maker)
        write(folder / f"p_{name}", m, spec, "peers", law, maker, first_edition=False)
    return count


def largest_integral(rng: np.random.Generator, m: Machine, maker: Maker) -> tuple[dict, Law]:
    """PID alone with a fixed filter, Ms and a ceiling on T: what a sequence of cone programmes can solve too. Beside the three hundred."""
    bench, best = maker.bench(m), None
    for _ in range(12):
        law = witness.draw(rng, m, bench, "pid", 0, 0, float(f"{0.5 * m.sample_time_s:.3g}"))
        if law and (best is None or bench.loop.margins(law).max_sensitivity < bench.loop.margins(best).max_sensitivity):
            best = law
    if best is None:
        raise RuntimeError(f"no PID loop found for {m.name}")
    nyquist = 0.5 / m.sample_time_s
    ceiling = {"of": "T", "side": "at_most", "hz": [1e-4 * nyquist, 0.95 * nyquist], "db": [0.0, 0.0]}
    high = 20 * math.log10(1 + judge.curve(bench, best.rows(), ceiling)) + 0.3
    spec = {
        "sample_time_s": m.sample_time_s,
        "guard": 0.0,
        "objective": {"minimise": "integral"},
        "margins": {"max_sensitivity": 1.01 * bench.loop.margins(best).max_sensitivity},
        "limits": {"curve": [{**ceiling, "db": [high, high]}]},
        "search": {"seed": 1, "notches": 0, "lowpasses": 0},
        "structure": {"controller": "pid", "derivative_filter_s": best.derivative_filter_s},
    }
    return spec, best


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--out", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--data", type=Path, default=machines.ROOT / "../shared/data")
    a.add_argument("--unseen", action="store_true", help="the kind kept out of sight, for the final run only")
    words = a.parse_args()
    if words.unseen:
        import unseen

        every, seed = unseen.every(), SEED + 1
    else:
        every, seed = machines.every(words.data), SEED
    machines.write(every, words.out)
    print(f"{make(words.out, every, seed)} specs in {words.out / 'specs'}")


if __name__ == "__main__":
    main()
