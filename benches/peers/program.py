"""The program under comparison: its commands, and its bench."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np

from machine import ROOT, Plant


def command() -> str:
    """Path of servotune: the variable SERVOTUNE, or the release build of this project."""
    return os.environ.get("SERVOTUNE", str(ROOT / "target/release/servotune"))


def run(*words: str) -> dict:
    """One command with --json; exit code 1 (something rejected) still carries a document."""
    done = subprocess.run([command(), *words, "--json"], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"servotune {' '.join(words)} ended with {done.returncode}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def _bench(*words: str) -> str:
    line = ["cargo", "bench", "--quiet", "--bench", "speed", "--", *words]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def speed() -> dict:
    """The times of `benches/speed.rs`."""
    return json.loads(_bench())


def sampled_responses(plants: list[Plant], t: float, w_rad_s: np.ndarray, folder: Path) -> list[np.ndarray]:
    """P(e^{jwT}) of every plant as the library computes it."""
    paths = []
    for i, plant in enumerate(plants):
        path = folder / f"response_{i}.toml"
        path.write_text(plant.toml(), encoding="utf-8")
        paths.append(str(path))
    job = folder / "job.json"
    job.write_text(json.dumps({"sample_time_s": t, "w_rad_s": list(map(float, w_rad_s)), "plants": paths}))
    rows = np.array(json.loads(_bench("response", str(job))))
    return list(rows[:, :, 0] + 1j * rows[:, :, 1])
