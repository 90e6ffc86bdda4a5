"""Compares servotune with python-control, scipy and scikit-rf in one run; writes peers.md and peers.json."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: matrices of order 30 gain nothing from threads

import argparse
import json
import platform
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import discretise
import identify
import margins
import program
import report
import tune
from machine import ROOT


def pinned() -> dict[str, str]:
    """Versions that requirements.txt demands; ends the run where others are installed."""
    wanted = {}
    for line in (Path(__file__).parent / "requirements.txt").read_text(encoding="utf-8").split():
        name, number = line.split("==")
        if version(name) != number:
            found = f"{name} {version(name)} is installed, {number} is expected"
            sys.exit(f"{found}: pip install -r benches/peers/requirements.txt")
        wanted[name] = number
    return wanted


def machine(versions: dict[str, str]) -> dict:
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.split()
    return {
        "cores": os.cpu_count(),
        "architecture": platform.machine(),
        "system": platform.system(),
        "python": platform.python_version(),
        "rustc": " ".join(rustc[:2]),
        "versions": versions,
        "load_before": os.getloadavg()[0],
    }


def run(folder: Path) -> dict:
    results: dict = {"command": report.COMMAND, "machine": machine(pinned())}
    steps = {
        "speed": program.speed,
        "margins": margins.compare_margins,
        "write": lambda: margins.compare_write(folder),
        "candidate_times": margins.candidate_times,
        "discretisation": lambda: discretise.compare_discretisation(folder),
        "identification": lambda: identify.compare_identification(folder),
        "tuning": lambda: tune.compare_tuning(results["speed"], folder),
    }
    for name, step in steps.items():
        print(name, file=sys.stderr, flush=True)
        results[name] = step()
    results["machine"]["load_after"] = os.getloadavg()[0]
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "results", help="folder of peers.md and peers.json")
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        results = run(Path(folder))
    out.mkdir(parents=True, exist_ok=True)
    (out / "peers.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    (out / "peers.md").write_text(report.markdown(results), encoding="utf-8")


if __name__ == "__main__":
    main()
