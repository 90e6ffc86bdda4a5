"""The same specs by other hands: scipy's differential evolution over numpy margins, python-control's margins in the same place, and
CVXPY with Clarabel where the gains alone are free and the problem is a sequence of convex ones.

    python peers.py --program target/release/servotune [--count 24] [--seconds 12]       writes results/search_peers.md

Every result, the program's too, is judged by `judge.py`. The time of a peer is that of its search alone; the program's is the whole command.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

import judge
import law as laws
import loop
import machines
import page
import plant as plants
import run
import write
from law import Law

TAU = 2 * math.pi
COARSE = 4_000
PRICE = 30.0


class OutOfTime(Exception):
    """The time that a method was given is over."""


class Problem:
    """A spec on a machine as a function of logarithms; bounds are the spec's, or scaled from the plant's gain and the clock."""

    def __init__(self, plant: plants.Plant, spec: dict, profile: dict | None, seconds: float) -> None:
        self.spec, self.profile, self.seconds = spec, profile, seconds
        self.t = spec["sample_time_s"]
        self.bench = judge.Bench(plant, self.t, COARSE)
        self.margins = spec.get("margins", {})
        self.search, self.structure = spec.get("search", {}), spec.get("structure", {})
        self.names, self.bounds = self._parameters()
        self.evaluations, self.best, self.best_x = 0, math.inf, None
        d = spec.get("disturbance")
        if d:
            keep = math.exp(-TAU * d.get("corner_hz", 50.0) * self.t)
            self.density = d.get("rms", 1.0) ** 2 * self.t * (1 - keep**2) / abs(1 - keep * self.bench.loop.q) ** 2
        self.began = time.perf_counter()

    def _parameters(self) -> tuple[list[str], list[tuple[float, float]]]:
        rate = 1 / self.t
        low, high = self.margins.get("gain_crossover_hz", (1e-3 * rate, 0.1 * rate))
        w = TAU * np.geomspace(low, high, 17)
        inverse = 1 / abs(self.bench.loop.s.plant.response(w))
        scaled = {"kp": inverse, "ki_per_s": inverse * w, "kd_s": inverse / w}
        given, kind = self.search.get("bounds", {}), self.structure.get("controller", "pid")
        out = []
        gains = {
            "pid": ("kp", "ki_per_s", "kd_s"),
            "pi": ("kp", "ki_per_s"),
            "lead": ("kp", "kd_s"),
            "p_pi": ("a", "b", "c"),
        }[kind]
        scaled["a"], scaled["b"], scaled["c"] = np.array([2 * low, 0.1 * TAU * high]), scaled["kd_s"], scaled["kp"] / 10
        for g in gains:
            found = given.get(g)
            below = 1e-5 if g == "ki_per_s" else 1e-2
            out.append((g, tuple(found) if found and found[0] > 0 else (below * scaled[g].min(), 10 * scaled[g].max())))
        f = self.structure.get("derivative_filter_s")
        if isinstance(f, list):
            out.append(("filter", tuple(f)))
        elif f is None and kind == "lead":
            out.append(("filter", (0.1 * self.t, 100 * self.t)))
        hz = given.get("lowpass_hz", [2 * low, 0.45 * rate])
        out += [(f"lowpass {i}", (hz[0], min(hz[1], 0.495 * rate))) for i in range(self.search.get("lowpasses", 0))]
        hz = given.get("notch_hz", [1.2 * low, 0.45 * rate])
        for i in range(self.search.get("notches", 0)):
            out += [
                (f"notch {i}", (hz[0], min(hz[1], 0.495 * rate))),
                (f"depth {i}", (0.01, 1.0)),
                (f"width {i}", (0.05, 1.0)),
            ]
        return [n for n, _ in out], [(math.log(a), math.log(b)) for _, (a, b) in out]

    def law(self, x: np.ndarray) -> Law:
        v = dict(zip(self.names, np.exp(x)))
        fixed = self.structure.get("derivative_filter_s")
        kind = self.structure.get("controller", "pid")
        kp, ki, kd = v.get("kp", 0.0), v.get("ki_per_s", 0.0), v.get("kd_s", 0.0)
        if kind == "p_pi":
            kp, ki, kd = v["a"] * v["b"] + v["c"], v["a"] * v["c"], v["b"]
        filter_s = (
            0.0 if kind in ("p_pi", "pi") else v.get("filter", fixed if isinstance(fixed, float) else 0.3 * self.t)
        )
        lows = tuple((v[f"lowpass {i}"], 0.7) for i in range(self.search.get("lowpasses", 0)))
        holes = []
        for i in range(self.search.get("notches", 0)):
            holes.append((v[f"notch {i}"], v[f"depth {i}"] * v[f"width {i}"], v[f"width {i}"]))
        return Law(self.t, kp, ki, kd, filter_s, lows, tuple(holes))

    def quick(self, law: Law) -> tuple[float, float]:
        """(objective, largest violation) on the coarse grid, limits tightened by the guard; unstable loops by their poles."""
        b, rows, guard = self.bench.loop, law.rows(), judge.guard_of(self.spec)
        bad = loop.close(b.s, rows).unstable()
        if bad:
            return math.inf, 10.0 * bad
        value, v, m = b.loop(rows), [], self.margins
        s = 1 / (1 + value)
        size, hz = abs(value), b.w / TAU
        turns = np.nonzero((size[:-1] - 1) * (size[1:] - 1) < 0)[0]
        part = np.log(size[turns]) / (np.log(size[turns]) - np.log(size[turns + 1]))
        gains = hz[turns] * (hz[turns + 1] / hz[turns]) ** part
        if "phase_margin_deg" in m and len(turns):
            a, c = value[turns] / size[turns], value[turns + 1] / size[turns + 1]
            at = np.degrees(np.angle(-(a + (c - a) * part)))
            v.append(1 - at[np.argmin(abs(at))] / (m["phase_margin_deg"] * (1 + guard)))
        if "gain_margin_db" in m:
            i = np.nonzero((value.imag[:-1] * value.imag[1:] < 0) & (value.real[:-1] < 0))[0]
            if len(i):
                p = value.imag[i] / (value.imag[i] - value.imag[i + 1])
                db = -20 * np.log10(np.maximum(-(value.real[i] + p * (value.real[i + 1] - value.real[i])), 1e-300))
                v.append(1 - db[np.argmin(abs(db))] / (m["gain_margin_db"] * (1 + guard)))
        if "max_sensitivity" in m:
            v.append(abs(s).max() / (m["max_sensitivity"] * (1 - guard)) - 1)
        if "gain_crossover_hz" in m:
            low, high = m["gain_crossover_hz"]
            v += judge.crossings(list(gains), low * (1 + guard), high * (1 - guard), m.get("phase_stabilised_hz", []))
        if "bandwidth_hz" in m:
            below = np.nonzero(abs(value * s) < loop.EDGE)[0]
            if len(below):
                v.append(1 - hz[below[0]] / (m["bandwidth_hz"] * (1 + guard)))
        limits = self.spec.get("limits", {})
        for c in limits.get("curve", []):
            shift = 20 * math.log10(1 - guard if c["side"] == "at_most" else 1 + guard)
            v.append(judge.curve(self.bench, rows, {**c, "db": [d + shift for d in c["db"]]}))
        name, figures = judge.objective_name(self.spec), {}
        if "overshoot_percent" in limits or "settling_s" in limits:
            over, settling = write.step(b.s, law)
            found = {"overshoot_percent": over, "settling_s": settling}
            v += [found[k] / (limits[k] * (1 - guard)) - 1 for k in found if k in limits]
        if self.profile is not None:
            of_write: dict = {}
            judge._of_the_write(self.bench.scene(self.profile), self.spec, law, name, figures, of_write)
            v += [(1 + x) / (1 - guard) - 1 for x in of_write.values()]
        worst = max(v, default=-1.0)
        objective = {
            "bandwidth": lambda: 1 / (TAU * gains.min()) if len(gains) else math.inf,
            "integral": lambda: 1 / law.ki_per_s if law.ki_per_s > 0 else math.inf,
            "disturbance": lambda: math.sqrt(np.trapezoid(abs(b.p * s) ** 2 * self.density, b.w) / math.pi),
            "room": lambda: worst,
        }.get(name, lambda: figures.get(name, math.inf))()
        return objective, worst

    def merit(self, x: np.ndarray) -> float:
        if time.perf_counter() - self.began > self.seconds:
            raise OutOfTime
        self.evaluations += 1
        objective, worst = self.quick(self.law(x))
        if worst >= 10 or not math.isfinite(objective):
            found = 1e3 + worst
        elif judge.objective_name(self.spec) == "room":
            found = worst
        else:
            found = math.log(objective) + PRICE * max(worst + 1e-5, 0.0)
        if found < self.best:
            self.best, self.best_x = found, x.copy()
        return found


def evolve(
    plant: plants.Plant, spec: dict, profile: dict | None, seconds: float, seed: int
) -> tuple[Law | None, float, int]:
    """scipy's differential evolution to its own end, or until its time is over."""
    p = Problem(plant, spec, profile, seconds)
    try:
        differential_evolution(p.merit, p.bounds, rng=seed, popsize=10, maxiter=100_000, tol=1e-6, polish=False)
    except OutOfTime:
        pass
    return (p.law(p.best_x) if p.best_x is not None else None), time.perf_counter() - p.began, p.evaluations


def control_time(plant: plants.Plant, law: Law) -> tuple[tuple[float, float], tuple[float, float]]:
    """Time of python-control's margins of one loop and how far its largest sensitivity is from the judge's: given the loop in state space,
    and given its response on the coarse grid."""
    import control

    s, rows = loop.Sampled(plant, law.sample_time_s), law.rows()
    a0, now, before = s.step
    n, held = s.order, s.whole + 1
    a, b = np.zeros((n + held,) * 2), np.zeros((n + held, 1))
    a[:n, :n], a[:n, n + s.whole] = a0, before
    if s.whole:
        a[:n, n + s.whole - 1] = now
    else:
        b[:n, 0] = now
    for i in range(1, held):
        a[n + i, n + i - 1] = 1.0
    b[n, 0] = 1.0
    p = control.ss(a, b, np.append(s.c, np.zeros(held))[None, :], 0, law.sample_time_s)
    ac, bc, cc, dc = laws.state_space(rows)
    c = control.ss(ac, bc[:, None], cc[None, :], dc, law.sample_time_s)
    true = judge.Bench(plant, law.sample_time_s).loop.margins(law).max_sensitivity
    b = loop.Bench(plant, law.sample_time_s, COARSE)
    out = []
    for make in (lambda: p * c, lambda: control.frd(b.loop(rows), b.w)):
        began = time.perf_counter()
        sm = control.stability_margins(make())[2]
        out.append((time.perf_counter() - began, 1 / sm / true - 1))
    return out[0], out[1]


def convex(plant: plants.Plant, spec: dict, start: Law) -> tuple[Law, float, int]:
    """The largest integral gain for filters that stay: |1 + L| >= 1/Ms and curves, each replaced by a cone or half-plane that touches at the
    present loop and lies inside; repeated until the gain rests (Hast, Astrom, Bernhardsson, Boyd 2013)."""
    import cvxpy as cp

    t, guard = start.sample_time_s, judge.guard_of(spec)
    b = loop.Bench(plant, t, COARSE)
    unit = [
        Law(t, *g, start.derivative_filter_s, start.lowpasses, start.notches) for g in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    scale = np.array([start.kp, start.ki_per_s, start.kd_s])
    parts = np.stack([b.p * laws.response(u.rows(), b.q) for u in unit], 1) * scale
    x, spent, rounds = np.ones(3), 0.0, 0
    while rounds < 30:
        rounds += 1
        now = 1 + parts @ x
        turn = now.conj() / abs(now)
        g = cp.Variable(3, nonneg=True)
        inside = np.real(turn[:, None] * parts) @ g + np.real(turn)
        rules = [inside >= 1 / (spec["margins"]["max_sensitivity"] * (1 - guard)), g <= 2.5 * x, g >= 0.2 * x]
        for c in spec.get("limits", {}).get("curve", []):
            use = (b.w >= TAU * c["hz"][0]) & (b.w <= TAU * c["hz"][-1])
            level = 10 ** (np.interp(np.log(b.w[use] / TAU), np.log(c["hz"]), c["db"]) / 20) * (1 - guard)
            if c["of"] != "T" or c["side"] != "at_most":
                raise ValueError("this programme knows Ms and a ceiling on T")
            size = cp.norm(cp.vstack([parts[use].real @ g, parts[use].imag @ g]), 2, axis=0)
            rules.append(size <= cp.multiply(level, inside[use]))
        problem = cp.Problem(cp.Maximize(g[1]), rules)
        began = time.perf_counter()
        problem.solve(solver=cp.CLARABEL)
        spent += time.perf_counter() - began
        if g.value is None:
            break
        gained = g.value[1] / x[1] - 1
        x = np.maximum(g.value, 0.0)
        if gained < 1e-5:
            break
    kp, ki, kd = x * scale
    return Law(t, kp, ki, kd, start.derivative_filter_s, start.lowpasses, start.notches), spent, rounds


def law_of(meta: dict) -> Law:
    w = meta["witness"]
    return Law(**{**w, **{k: tuple(tuple(f) for f in w[k]) for k in ("lowpasses", "notches")}})


def row(name: str, meta: dict, spec: dict, own: dict | None, best: float | None, cells: list[str]) -> str:
    said = "-"
    if own:
        met = own.get("objective") is not None and own["worst"] <= run.MET
        said = f"{own['objective']:.5g}" if met else "refused" if own.get("error") else str(own.get("verdict"))
        said += f", {own['time_s']:.2f} s"
    return (
        f"| {name} | {meta['machine']} | {judge.objective_name(spec)} | {'' if best is None else f'{best:.5g}'} | {said} | "
        + " | ".join(cells)
        + " |"
    )


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--folder", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--program", default=str(machines.ROOT / "target/release/servotune"))
    a.add_argument("--count", type=int, default=24)
    a.add_argument("--seconds", type=float, default=12.0, help="of each differential evolution")
    a.add_argument("--convex-only", action="store_true")
    w = a.parse_args()
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    judges, found = run.Judges(w.folder), []
    lines = [
        "# Search: by other hands",
        "",
        "Made by `python benches/search/peers.py` (see `benches/search/README.md`). Each cell: objective by the judge and time.",
        f"scipy's differential evolution has {w.seconds:g} s a spec on one thread, around numpy margins of {COARSE} points, bounds and structure of the same spec.",
        "",
    ]
    kept = page.Kept(w.folder, run.REFERENCE, run.MET)
    names = [n for n in run.specs_of(w.folder, "r", False, "")]
    sample = [] if w.convex_only else names[:: max(len(names) // w.count, 1)][: w.count]
    if sample:
        lines += [
            "| spec | machine | objective | best known | servotune tune | differential evolution | python-control, one margin call: of the state space; of the response |",
            "|---|---|---|---|---|---|---|",
        ]
    ahead = behind = 0
    for name in sample:
        here = w.folder / "specs" / name
        meta, (spec, profile) = json.loads((here / "meta.json").read_text()), judge.read_spec(here / "spec.toml")
        plant = plants.read(w.folder / f"machines/{meta['machine']}.toml")
        own = run.judged(judges, w.folder, "peers", run.tune(w.program, w.folder, name, "peers", [], False, None))
        law, spent, evaluations = evolve(plant, spec, profile, w.seconds, 1)
        other = judges.judge(meta["machine"], spec, profile, law) if law else None
        met = other is not None and other.worst <= run.MET
        cell = (
            f"{other.objective:.5g}, {spent:.1f} s, {evaluations} candidates"
            if met
            else f"no table, {spent:.1f} s, {evaluations} candidates"
        )
        if met:
            found.append({"id": name, "seed": None, "objective": other.objective, "worst": other.worst})
            own_met = own.get("objective") is not None and own["worst"] <= run.MET
            further = not own_met or page.behind(own["objective"], other.objective, kept.objective[name]) > page.NEAR
            ahead, behind = ahead + further, behind + (not further)
        try:
            peer = "; ".join(
                f"{1e3 * each:.1f} ms, Ms {100 * apart:+.2g} %" for each, apart in control_time(plant, law_of(meta))
            )
        except Exception as e:  # it refuses some loops; that is its result
            peer = f"refused: {type(e).__name__}"
        lines.append(row(name, meta, spec, own, kept.best.get(name), [cell, peer]))
        print(lines[-1], flush=True)
    if sample:
        lines += [
            "",
            f"Differential evolution came to a table in {len(found)} of {len(sample)}; in {ahead} of them it is ahead of the program by more than 2 % or the program has none.",
        ]
    convexes = [n for n in run.specs_of(w.folder, "p_", False, "")]
    lines += [
        "",
        "## Largest integral gain, filters fixed",
        "",
        "PID alone, Ms and a ceiling on T: a sequence of cone programmes in three gains (CVXPY with Clarabel), started from the spec's own controller.",
        "",
        "| spec | machine | objective | best known | servotune tune | CVXPY with Clarabel | differential evolution |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in convexes:
        here = w.folder / "specs" / name
        meta, (spec, profile) = json.loads((here / "meta.json").read_text()), judge.read_spec(here / "spec.toml")
        plant = plants.read(w.folder / f"machines/{meta['machine']}.toml")
        own = run.judged(judges, w.folder, "peers", run.tune(w.program, w.folder, name, "peers", [], False, None))
        cells = []
        law, spent, rounds = convex(plant, spec, law_of(meta))
        evolved, time_s, evaluations = evolve(plant, spec, profile, w.seconds, 1)
        for l, said in (
            (law, f"{spent:.2f} s, {rounds} rounds"),
            (evolved, f"{time_s:.1f} s, {evaluations} candidates"),
        ):
            other = judges.judge(meta["machine"], spec, profile, l) if l else None
            met = other is not None and other.worst <= run.MET
            cells.append(
                f"{other.objective:.5g}, {said}"
                if met
                else f"no table (worst {other.worst if other else math.inf:+.1e}), {said}"
            )
            if met:
                found.append({"id": name, "seed": None, "objective": other.objective, "worst": other.worst})
        lines.append(row(name, meta, spec, own, kept.best.get(name), cells))
        print(lines[-1], flush=True)
    run.update_reference(w.folder, found, "peers")
    (machines.ROOT / "results/search_peers.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
