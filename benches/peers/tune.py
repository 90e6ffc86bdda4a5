"""One full tuning: scipy's optimisers around the cheapest candidate evaluation, with servotune's objective and limits.

Objective: ln(dft_low/limit + dft_high/limit) of the write, the noise as expected power. Limits: margins, Ms, crossover,
both DFT norms. A candidate that misses a limit by the share v pays 10 v; an unstable one pays more than any stable one.
Parameters are searched as logarithms in the box of the spec. All optimisers start from the nominal controller or from
shaken copies of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import optimize

import candidate
import exact
import program
import write
from clock import timing
from machine import ROOT, Controller, Spec, healthy_machine, nominal_controller, read_spec
from realise import sampled, sections

PRICE, UNSTABLE = 10.0, 1e3
SEED = 1
STARTS = 12
# "As far as servotune": this share above its objective, within this many times its evaluations.
NEAR, TIMES = 0.01, 10
SPEC = ROOT / "benches/peers/spec.toml"
# The same box for the notch's depth and width as servotune's.
NOTCH_DEPTH, NOTCH_POLE_DAMPING = (0.01, 1.0), (0.05, 1.0)


def _parts(f: candidate.Figures, low: float, high: float, spec: Spec) -> tuple[float, float]:
    """Objective and largest miss as a share of its limit."""
    objective = float(np.log(low / spec.dft_low + high / spec.dft_high))
    misses = [low / spec.dft_low - 1, high / spec.dft_high - 1, f.max_sensitivity / spec.max_sensitivity - 1]
    if f.phase_margin_deg is None:
        misses.append(1.0)
    else:
        from_hz, to_hz = spec.gain_crossover_hz
        misses += [1 - f.phase_margin_deg / spec.phase_margin_deg]
        misses += [1 - f.gain_crossover_hz / from_hz, f.gain_crossover_hz / to_hz - 1]
    if f.gain_margin_db is not None:
        misses.append(1 - f.gain_margin_db / spec.gain_margin_db)
    return objective, max(misses)


class Enough(Exception):
    """The evaluations are used up, or the target is reached."""


@dataclass
class Problem:
    """A counted merit over logarithms of kp, ki, kd, low-pass, notch frequency, depth and width."""

    spec: Spec
    prepared: candidate.Prepared
    write: candidate.Write
    base: Controller
    limit: int
    target: float = -np.inf
    used: int = 0
    best: float = np.inf
    best_x: np.ndarray | None = None

    def bounds(self) -> np.ndarray:
        b = self.spec.bounds
        rows = [b["kp"], b["ki_per_s"], b["kd_s"], b["lowpass_hz"], b["notch_hz"], NOTCH_DEPTH, NOTCH_POLE_DAMPING]
        return np.log(np.array(rows))

    def controller(self, x: np.ndarray) -> Controller:
        kp, ki, kd, lowpass, notch, depth, width = np.exp(x)
        lowpasses = ((lowpass, self.base.lowpasses[0][1]),)
        return replace(
            self.base, kp=kp, ki_per_s=ki, kd_s=kd, lowpasses=lowpasses, notches=((notch, depth * width, width),)
        )

    def start(self) -> np.ndarray:
        c = self.base
        hz, zero, pole = c.notches[0]
        x = np.log([c.kp, c.ki_per_s, c.kd_s, c.lowpasses[0][0], hz, zero / pole, pole])
        return np.clip(x, *self.bounds().T)

    def merit(self, x: np.ndarray) -> float:
        if self.used >= self.limit:
            raise Enough
        self.used += 1
        inside = np.clip(x, *self.bounds().T)
        value = self._merit_inside(inside) + float(np.sum(abs(x - inside)))
        if value < self.best:
            self.best, self.best_x = value, inside
            if value <= self.target:
                raise Enough
        return value

    def _merit_inside(self, x: np.ndarray) -> float:
        c = self.controller(x)
        figures = candidate.numpy_by_hand(self.prepared, c)
        if not figures.stable:
            return UNSTABLE + (0.0 if figures.gain_margin_db is None else abs(figures.gain_margin_db))
        rows = sections(c)
        low, high = self.write.norms(write.by_numpy(self.write.scene, rows), rows)
        objective, miss = _parts(figures, low, high, self.spec)
        return objective + PRICE * max(miss, 0.0)


def _starts(p: Problem, spread: float = 0.3) -> list[np.ndarray]:
    rng = np.random.default_rng(SEED)
    at = p.start()
    return [at] + [np.clip(at + rng.normal(0, spread, len(at)), *p.bounds().T) for _ in range(STARTS - 1)]


def nelder_mead(p: Problem) -> None:
    for x in _starts(p):
        optimize.minimize(p.merit, x, method="Nelder-Mead", options={"maxfev": p.limit // STARTS})


def powell(p: Problem) -> None:
    for x in _starts(p):
        optimize.minimize(p.merit, x, method="Powell", bounds=p.bounds(), options={"maxfev": p.limit // STARTS})


def cobyqa(p: Problem) -> None:
    """Model-based; the merit is not smooth, which is what it has to bear."""
    for x in _starts(p):
        optimize.minimize(p.merit, x, method="COBYQA", bounds=p.bounds(), options={"maxfev": p.limit // STARTS})


def differential_evolution(p: Problem) -> None:
    optimize.differential_evolution(
        p.merit, p.bounds(), x0=p.start(), rng=SEED, popsize=10, maxiter=10_000, tol=0.0, polish=False
    )


def _prepared(limit: int) -> Problem:
    plant, base, spec = healthy_machine(), nominal_controller(), read_spec(SPEC)
    s, w = sampled(plant, base.sample_time_s), candidate.grid()
    prepared = candidate.prepare(s, exact.block_response(s, w), w)
    return Problem(spec, prepared, candidate.prepare_write(spec.profile, s), base, limit)


def judge(c: Controller) -> dict:
    """Objective and largest miss by the reference: a million points, scipy's simulation, the exact power of the noise."""
    spec, s = read_spec(SPEC), sampled(healthy_machine(), c.sample_time_s)
    profile, rows = spec.profile, sections(c)
    r = exact.margins(s, rows)
    scene = write.scene(write.quiet(profile), s, whole=True)
    amplitudes = write.harmonics(write.by_scipy(scene, rows), profile)
    power = write.expected_power_exact(scene, profile, rows)
    low, high = write.bands(np.sqrt(amplitudes**2 + power), profile)
    phase = min(r.gain_crossings, key=lambda x: abs(x[1]))
    gain = min(r.phase_crossings, key=lambda x: abs(x[1]))
    f = candidate.Figures(phase[1], phase[0], gain[1], gain[0], r.max_sensitivity)
    objective, miss = _parts(f, low, high, spec)
    return {
        "objective": float(np.exp(objective)),
        "largest_miss": miss,
        "dft_low": low,
        "dft_high": high,
        **{k: f.__dict__[k] for k in ("phase_margin_deg", "gain_margin_db", "max_sensitivity", "gain_crossover_hz")},
    }


def _run(name: str, method: Callable[[Problem], None], evaluations: int, target: float = -np.inf) -> dict:
    p = _prepared(evaluations)
    p.target = target
    start, cpu = time.perf_counter(), time.process_time()
    try:
        method(p)
    except Enough:
        pass
    times = {"time_s": time.perf_counter() - start, "cpu_s": time.process_time() - cpu}
    found = p.controller(p.best_x)
    return {"route": name, "evaluations": p.used, **times, **judge(found), "controller": found.__dict__}


def servotune_controller(tuning: dict) -> Controller:
    """The controller in an outcome of the bench."""
    c = tuning["controller"]
    return Controller(
        c["sample_time_s"],
        **c["pid"],
        lowpasses=tuple((f["frequency_hz"], f["damping_ratio"]) for f in c["lowpass"]),
        notches=tuple((f["frequency_hz"], f["zero_damping_ratio"], f["pole_damping_ratio"]) for f in c["notch"]),
    )


def compare_tuning(speed: dict, folder: Path) -> dict:
    """Every optimiser with servotune's number of evaluations; two of them also until they come as far."""
    tuning = speed["tuning"]
    evaluations = tuning["work"]["evaluations"]
    own = {"route": "servotune tune", "evaluations": evaluations, **judge(servotune_controller(tuning))}
    methods = {
        "scipy Nelder-Mead, 12 starts": nelder_mead,
        "scipy Powell, 12 starts": powell,
        "scipy COBYQA, 12 starts": cobyqa,
        "scipy differential evolution": differential_evolution,
    }
    rows = [_run(name, method, evaluations) for name, method in methods.items()]
    target = float(np.log(own["objective"] * (1 + NEAR)))
    for name in ("scipy Nelder-Mead, 12 starts", "scipy differential evolution"):
        row = _run(name, methods[name], TIMES * evaluations, target)
        reached = row["objective"] <= own["objective"] * (1 + 2 * NEAR) and row["largest_miss"] <= NEAR
        ending = "reached" if reached else "not reached"
        until = f"until within 1 % of servotune, at most {TIMES} times the evaluations: {ending}"
        rows.append({**row, "route": f"{name}, {until}"})
    return {
        "start": judge(nominal_controller()),
        "verdict": tuning["verdict"],
        "servotune": own,
        "peers": rows,
        "command_time": _command_time(folder),
    }


def _command_time(folder: Path) -> dict | None:
    """Time of the command `tune`; none where this build has no such command."""
    words = ["tune", "--plant", str(ROOT / "specs/machines/healthy.toml"), "--spec", str(SPEC)]
    words += ["--controller", str(ROOT / "specs/controllers/nominal.toml"), "--out", str(folder / "gains.toml")]
    try:
        return timing(lambda: program.run(*words), 5).__dict__
    except RuntimeError:
        return None
