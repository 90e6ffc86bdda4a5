"""The judge against the program: margins and writes of the specs' own controllers. Asserts; prints the largest differences.

    python check.py --program target/release/servotune [--every 5] [--before]

Plants that the program cannot read are counted, not passed over in silence. `--before` uses the first form of plant.toml.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import judge
import law as laws
import machines
import plant as plants
import toml_text

MARGIN, WRITE = 2e-6, 1e-7
SEEDS = 24


def said(program: str, *words: str) -> dict:
    done = subprocess.run([program, *words, "--json"], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.strip())
    return json.loads(done.stdout)


def law_of(meta: dict) -> laws.Law:
    w = meta["witness"]
    tuples = {k: tuple(tuple(f) for f in w[k]) for k in ("lowpasses", "notches")}
    return laws.Law(**{**w, **tuples})


def margins(program: str, plant: Path, controller: Path, bench: judge.Bench, law: laws.Law) -> float:
    """Largest relative difference of any margin or crossing; degrees and dB are compared over 10."""
    a, b = said(program, "margins", "--plant", str(plant), "--controller", str(controller)), bench.loop.margins(law)
    assert a["stable"] == b.stable, plant
    apart = [abs(a["max_sensitivity"] / b.max_sensitivity - 1)]
    for key, scale in (("phase_margin_deg", 10.0), ("gain_margin_db", 10.0)):
        if a.get(key) is not None:
            apart.append(abs(a[key] - getattr(b, key)) / scale)
    assert len(a["gain_crossings"]) == len(b.gain_crossings), (plant, a["gain_crossings"], b.gain_crossings)
    for x, (hz, value) in zip(sorted(a["gain_crossings"], key=lambda c: c["hz"]), b.gain_crossings):
        apart += [abs(x["hz"] / hz - 1), abs(x["value"] - value) / 10]
    return max(apart)


def write(
    program: str, plant: Path, controller: Path, bench: judge.Bench, law: laws.Law, profile: dict, folder: Path
) -> float:
    """Largest difference of the PES of the window without noise, as a share of its largest value."""
    quiet = {**profile, "noise": {}}
    file = folder / "profile.toml"
    file.write_text(toml_text.text(quiet), encoding="utf-8")
    a = said(program, "simulate", "--plant", str(plant), "--controller", str(controller), "--profile", str(file))
    scene = bench.scene(quiet)
    pes = scene.quiet(law)[0]
    theirs = np.array(a["pes"])[scene.first : scene.count]
    return float(abs(theirs - pes).max() / abs(pes).max())


def noise(
    program: str, plant: Path, controller: Path, bench: judge.Bench, law: laws.Law, profile: dict, folder: Path
) -> float:
    """Mean square of the noise over many draws against its expectation, in standard errors of that mean (taken from the draws)."""
    scene = bench.scene(profile)
    pes, found = scene.quiet(law)[0], []
    for seed in range(1, SEEDS + 1):
        file = folder / "profile.toml"
        file.write_text(toml_text.text({**profile, "noise": {**profile["noise"], "seed": seed}}), encoding="utf-8")
        a = said(program, "simulate", "--plant", str(plant), "--controller", str(controller), "--profile", str(file))
        found.append(np.mean((np.array(a["pes"])[scene.first : scene.count] - pes) ** 2))
    return float((np.mean(found) - scene.noise_variance(law)) / (np.std(found, ddof=1) / np.sqrt(SEEDS)))


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--folder", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--program", default=str(machines.ROOT / "target/release/servotune"))
    a.add_argument("--every", type=int, default=5)
    a.add_argument("--before", action="store_true")
    w = a.parse_args()
    worst, writes, noises, unread, done = [], [], [], 0, set()
    # The judge against itself, where the answer is known: the noise's power over all bins is its variance.
    for name in sorted(p.name for p in (w.folder / "specs").iterdir())[:: w.every]:
        here = w.folder / "specs" / name
        meta = json.loads((here / "meta.json").read_text())
        if "witness" not in meta:
            continue
        machine, law = meta["machine"], law_of(meta)
        own = w.folder / f"machines/{machine}.toml"
        first = w.folder / f"machines/before/{machine}.toml"
        file = first if w.before and first.exists() else own
        bench = judge.Bench(plants.read(own), law.sample_time_s)
        spec, profile = judge.read_spec(here / "spec.toml")
        with tempfile.TemporaryDirectory() as f:
            controller = Path(f) / "controller.toml"
            controller.write_text(law.toml(), encoding="utf-8")
            try:
                worst.append((margins(w.program, file, controller, bench, law), name))
            except RuntimeError as e:
                unread += 1
                print(f"{name} on {machine}: {str(e)[:150]}")
                continue
            if profile is not None:
                writes.append((write(w.program, file, controller, bench, law, profile, Path(f)), name))
                if machine not in done and (profile["noise"].get("encoder_rms") or profile["noise"].get("windage_rms")):
                    done.add(machine)
                    noises.append((noise(w.program, file, controller, bench, law, profile, Path(f)), name))
                    scene = bench.scene(profile)
                    n = scene.count - scene.first
                    over_bins = scene.noise_power(law, np.arange(n)).sum()
                    assert abs(over_bins / scene.noise_variance(law) - 1) < 1e-8, name
    print(f"margins: {len(worst)} loops, largest difference {max(worst)}; {unread} plants not read")
    if writes:
        print(f"writes: {len(writes)}, largest difference {max(writes)}")
    if noises:
        print(
            f"noise: {len(noises)} machines, {SEEDS} draws each, farthest {max(noises, key=lambda x: abs(x[0]))} standard errors"
        )
    assert max(worst)[0] < MARGIN, max(worst)
    assert not writes or max(writes)[0] < WRITE, max(writes)
    assert not noises or max(abs(x) for x, _ in noises) < 4.5, noises


if __name__ == "__main__":
    main()
