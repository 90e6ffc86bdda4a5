"""The limit of performance of the healthy machine, stated again in numpy and solved by CVXPY with Clarabel.

Independent of the program: pulse responses in closed form from residues, noise forms as stacked rows, every frequency of the grid at
once instead of cuts. Run: python benches/peers/limit.py --servotune target/release/servotune --out results
Needs numpy and cvxpy. Writes limit_peers.md and limit_peers.json.
"""

import argparse
import json
import math
import pathlib
import subprocess
import time
import tomllib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
T = 39.6e-6


def residues(plant):
    """Poles and residues of P(s) without its delay."""
    w0, z0 = plant["natural_frequency_rad_s"], plant["damping_ratio"]
    gain = plant["dc_gain"] * w0 * w0 * plant["resonance_gain"]
    pair = lambda w, z: [complex(-z * w, w * math.sqrt(1 - z * z)), complex(-z * w, -w * math.sqrt(1 - z * z))]
    poles, zeros = pair(w0, z0), []
    for m in plant["modes"]:
        poles += pair(m["pole_rad_s"], m["pole_damping_ratio"])
        zeros += pair(m["zero_rad_s"], m["zero_damping_ratio"])
    poles, zeros = np.array(poles), np.array(zeros)
    r = []
    for i, p in enumerate(poles):
        others = np.delete(poles, i)
        r.append(gain * np.prod((p - zeros)) / np.prod(p - others))
    return poles, np.array(r)


def pulse(plant, times):
    """Position at `times` after a command of 1 held from 0 to T."""
    poles, r = residues(plant)

    def step(t):
        t = np.maximum(t - plant["delay_s"], 0.0)
        return sum((q / p * (np.exp(p * t) - 1)).real for p, q in zip(poles, r))

    return step(times) - step(times - T)


def reference(s, t):
    a, ramp = s["velocity"] / s["acceleration_time_s"], s["acceleration_time_s"]
    cruise = s["distance"] / s["velocity"] - ramp
    x = np.maximum(t - s["start_s"], 0.0)
    left = np.maximum(2 * ramp + cruise - x, 0.0)
    return np.where(
        x <= ramp,
        0.5 * a * x * x,
        np.where(x <= ramp + cruise, a * ramp * (x - 0.5 * ramp), a * ramp * (ramp + cruise) - 0.5 * a * left**2),
    )


def problem(tail):
    plant = tomllib.loads((ROOT / "specs/machines/healthy.toml").read_text())["plant"]
    spec = tomllib.loads((ROOT / "specs/limits/paper.toml").read_text())
    profile = tomllib.loads((ROOT / "specs/profiles/spiral.toml").read_text())
    s, rate, (w0, w1) = profile["spiral"], profile["pes"]["sample_rate_hz"], profile["pes"]["window"]
    first = math.ceil(s["start_s"] * rate - 1e-9)
    j = np.arange(first + w0, first + w1)
    at = j / rate
    k = np.floor(at / T + 1e-9).astype(int)
    ahead = max(int(s["start_s"] / T) - 1, 0)
    n = k[-1] - ahead + 1
    lag = np.arange(n)
    plant_taps = pulse(plant, lag * T)
    rows = np.array([pulse(plant, (o + lag * T)) for o in at - k * T])
    target = reference(s, (ahead + lag) * T)
    noise = profile["noise"]
    keep = math.exp(-2 * math.pi * noise["windage_corner_hz"] * T)
    colour = keep**lag
    coloured = np.convolve(plant_taps, colour)[:n]
    count = w1 - w0
    bands = []
    for low, high, limit in ((600.0, 1500.0, spec["limits"]["dft_low"]), (1500.0, 3000.0, spec["limits"]["dft_high"])):
        stack, const = [], []
        for b in range(1, count // 2 + 1):
            if not low <= b * rate / count <= high:
                continue
            turn = np.exp(-2j * np.pi * b * np.arange(count) / count) / count
            z = np.zeros(n, complex)
            for e, row, kk in zip(turn, rows, k - ahead):
                z[: kk + 1] += e * row[kk::-1]
            hankel = np.array([np.concatenate([z[i:], np.zeros(i)]) for i in range(n)])
            still = (turn * reference(s, at)).sum()
            stack += [-(hankel @ target)[None, :]]
            const += [np.array([still])]
            stack += [noise["encoder_rms"] * hankel]
            const += [np.zeros(n, complex)]
            sigma = noise["windage_rms"] * math.sqrt(1 - keep * keep)
            pushed = hankel @ coloured
            # c_j = open_j - sum_m q_m pushed[j + m]
            stack += [-sigma * np.array([np.concatenate([pushed[i:], np.zeros(i)]) for i in range(n)])]
            const += [sigma * (hankel @ colour)]
        a, c = np.concatenate(stack), np.concatenate(const)
        a, c = np.concatenate([a.real, a.imag]) / limit, np.concatenate([c.real, c.imag]) / limit
        # The same length for every q with n + 1 rows.
        r = np.linalg.qr(np.column_stack([a, c]), mode="r")
        bands.append((r[:, :-1], r[:, -1]))
    angle = np.pi * np.arange(1, 2 * n + 1) / (2 * n)
    turn = np.exp(-1j * np.outer(angle, lag))
    lower = np.array([np.concatenate([np.zeros(m), plant_taps[: n - m]]) for m in range(n)]).T
    response = -(turn @ lower)
    hz = angle / (2 * np.pi * T)
    return bands, response, hz, spec["margins"], n


def solve(tail):
    import cvxpy as cp

    begin = time.perf_counter()
    bands, response, hz, margins, n = problem(tail)
    # Coordinates in which the solver keeps its digits, as the program has them.
    unit = 1.0 / np.linalg.norm(pulse(tomllib.loads((ROOT / "specs/machines/healthy.toml").read_text())["plant"], np.arange(16) * T))
    stack = np.concatenate([bands[0][0] * unit, bands[1][0] * unit, 1e-3 * np.eye(n)])
    const = np.concatenate([bands[0][1], bands[1][1], np.zeros(n)])
    q, r = np.linalg.qr(stack)
    way = unit * np.linalg.inv(r)
    centre = -(way @ (q.T @ const))
    y = cp.Variable(n)
    terms = [cp.norm((a @ way) @ y + (a @ centre + c)) for a, c in bands]
    re, im = response.real @ way, response.imag @ way
    re0, im0 = 1 + response.real @ centre, response.imag @ centre
    ms, (low, high) = margins["max_sensitivity"], margins["gain_crossover_hz"]
    constraints = [cp.norm(cp.vstack([re @ y + re0, im @ y + im0]), axis=0) <= ms + tail]
    below, above = hz <= low, hz >= high
    constraints += [re[below] @ y + re0[below] <= 0.5 + tail, re[above] @ y + re0[above] >= 0.5 - tail]
    p = cp.Problem(cp.Minimize(sum(terms)), constraints)
    stated = time.perf_counter() - begin
    begin = time.perf_counter()
    value = p.solve(solver=cp.CLARABEL)
    return value, stated, time.perf_counter() - begin, p.solver_stats.solve_time, p.status, n


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--servotune", default=str(ROOT / "target/release/servotune"))
    a.add_argument("--out", default=str(ROOT / "results"))
    a.add_argument("--tail", type=float, default=0.05)
    a.add_argument("--rounds", type=int, default=40)
    a = a.parse_args()
    begin = time.perf_counter()
    command = [a.servotune, "limit", "--plant", "specs/machines/healthy.toml", "--spec", "specs/limits/paper.toml"]
    command += ["--tail", str(a.tail), "--rounds", str(a.rounds), "--alone", "0", "--json"]
    ours = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, check=False).stdout)["limit"]
    wall = time.perf_counter() - begin
    value, stated, solved, inner, status, n = solve(a.tail)
    import cvxpy

    found = {
        "taps": int(n), "bound": ours["sum"]["objective"], "missed": ours["sum"]["missed"], "wall_s": wall,
        "cvxpy": {"version": cvxpy.__version__, "value": float(value), "status": status, "stating_s": stated, "solve_s": solved, "clarabel_s": inner},
    }
    out = pathlib.Path(a.out)
    (out / "limit_peers.json").write_text(json.dumps(found, indent=1) + "\n")
    (out / "limit_peers.md").write_text(
        "# The limit of performance beside CVXPY with Clarabel\n\n"
        "Made by `python benches/peers/limit.py --out results` (numpy, cvxpy). Healthy machine under `specs/limits/paper.toml`, "
        f"tail {a.tail}, {n} taps. The peer states the programme anew from closed forms and takes every frequency of the grid at once.\n\n"
        "| | value | time |\n|---|---|---|\n"
        f"| `servotune limit` (bound; last point misses a demand by {found['missed']:.1e}) | {found['bound']:.6f} | {wall:.1f} s, all of it |\n"
        f"| CVXPY {cvxpy.__version__} ({status}) | {value:.6f} | {stated:.1f} s stating, {solved:.1f} s solving, of which the solver {inner:.1f} s |\n\n"
        f"Bound below the peer's optimum by {100 * (1 - found['bound'] / value):.3f} % (it must not be above). One run on a shared machine with two cores.\n"
    )
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
