"""Margins of python-control on the loops of `lab certificate`, beside their truth.

    python benches/peers/certificate.py --loops results/certificate_loops.json --out results/certificate_peers.md

Each loop is read as a practitioner would have it: a sweep of 300 points, even in their logarithm, handed to control.frd and
control.stability_margins. The sweep is exact (the sampled plant by partial fractions, no noise): what is off is what the points do not show.
"""

import argparse
import json
import math
import time

import control
import numpy as np

T = 39.6e-6
POINTS = 300


def plant(row, w):
    """The plant under a hold, sampled: partial fractions, each pole's answer to a held command in closed form, the delay's broken part
    by splitting the hold where it ends."""
    gain, w0, damping = row["body"]
    pair = lambda w, z: [complex(-z * w, w * math.sqrt(1 - z * z)), complex(-z * w, -w * math.sqrt(1 - z * z))]
    poles, zeros = pair(w0, damping), []
    for m in row["modes"]:
        poles += pair(m["pole_rad_s"], m["pole_damping_ratio"])
        zeros += pair(m["zero_rad_s"], m["zero_damping_ratio"])
    poles, zeros = np.array(poles), np.array(zeros)
    whole, part = divmod(row["delay_s"], T)
    left = T - part
    z = np.exp(1j * w * T)
    total = np.zeros(len(w), dtype=complex)
    for i, p in enumerate(poles):
        residue = gain * w0**2 * np.prod(p - zeros) / np.prod(p - np.delete(poles, i))
        now, late = np.exp(p * left) - 1, np.exp(p * T) - np.exp(p * left)
        total += residue / p * (now + late / z) / (z - np.exp(p * T))
    return total * z**-whole


def controller(row, w):
    q = np.exp(-1j * w * T)
    c = np.ones(len(w), dtype=complex)
    for s in row["sections"]:
        c *= (s["b0"] + q * (s["b1"] + q * s["b2"])) / (1 + q * (s["a1"] + q * s["a2"]))
    return c


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--loops", required=True)
    a.add_argument("--out", required=True)
    a = a.parse_args()
    rows = [r for r in json.load(open(a.loops)) if r["stable"]]
    w = 2 * math.pi * np.geomspace(20.0, 12000.0, POINTS)
    ms = {"python-control": [], "servotune": []}
    gm = {"python-control": [], "servotune": []}
    pm = {"python-control": [], "servotune": []}
    spent = 0.0
    for r in rows:
        l = plant(r, w) * controller(r, w)
        start = time.perf_counter()
        g, p, _, _, _, _ = control.stability_margins(control.frd(l, w), returnall=True)
        spent += time.perf_counter() - start
        # Optimism: how much better than the truth the answer is.
        ms["python-control"].append(20 * math.log10(r["max_sensitivity"] * np.min(np.abs(1 + l))))
        ms["servotune"].append(20 * math.log10(r["max_sensitivity"] / r["proven_max_sensitivity"]))
        if r["gain_margin_db"] is not None:
            sizes = [abs(20 * math.log10(x)) for x in np.atleast_1d(g) if x > 0 and math.isfinite(x)]
            gm["python-control"].append((min(sizes) if sizes else math.inf) - r["gain_margin_db"])
            gm["servotune"].append(r["proven_gain_margin_db"] - r["gain_margin_db"])
        if r["phase_margin_deg"] is not None:
            angles = [abs((x + 180) % 360 - 180) for x in np.atleast_1d(p) if math.isfinite(x)]
            pm["python-control"].append((min(angles) if angles else math.inf) - r["phase_margin_deg"])
            pm["servotune"].append(r["proven_phase_margin_deg"] - r["phase_margin_deg"])
    lines = [
        "# Margins of python-control on the certificate's loops",
        "",
        "Made by `python benches/peers/certificate.py --loops results/certificate_loops.json --out results/certificate_peers.md`.",
        f"python-control {control.__version__}, {len(rows)} stable loops; it sees a noise-free sweep of {POINTS} points from 20 Hz to 12 kHz, servotune the plant's file.",
        "Optimism is the answer less the truth (dB, dB, deg); a bound that holds is never above 0.",
        "",
        "| figure | program | optimistic at all (more than 1e-6) | by more than 1 (dB, deg) | worst |",
        "|---|---|---|---|---|",
    ]
    for name, table in (("Ms (dB)", ms), ("gain margin (dB)", gm), ("phase margin (deg)", pm)):
        for program, x in table.items():
            x = np.array(x)
            lines.append(
                f"| {name} | {program} | {100 * np.mean(x > 1e-6):.1f} % | {100 * np.mean(x > 1):.1f} % | {np.max(x):.3g} |"
            )
    lines += ["", f"python-control's own time: {1e3 * spent / max(len(rows), 1):.2f} ms a loop.", ""]
    open(a.out, "w").write("\n".join(lines))


if __name__ == "__main__":
    main()
