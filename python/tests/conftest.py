"""Files and the program that the package is held against."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import servotune as st

ROOT = Path(__file__).resolve().parents[2]
#: Data beside the project; another place is named in SERVOTUNE_SHARED.
SHARED = Path(os.environ.get("SERVOTUNE_SHARED", ROOT.parent / "shared"))


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Data beside the project, there or not."""
    return SHARED


@pytest.fixture(scope="session")
def practice() -> Path:
    """Practice cases beside the project."""
    folder = SHARED / "practice"
    if not folder.is_dir():
        pytest.skip("../shared/practice is absent: nothing to diagnose or classify")
    return folder


@pytest.fixture(scope="session")
def program_file() -> Path | None:
    """The program that was built last, or the one named in SERVOTUNE."""
    named = os.environ.get("SERVOTUNE")
    built = [ROOT / "target" / kind / "servotune" for kind in ("release", "debug")]
    there = [Path(named)] if named else sorted((p for p in built if p.exists()), key=lambda p: -p.stat().st_mtime)
    return there[0].resolve() if there else None


@pytest.fixture(scope="session")
def program(program_file):
    """Runs `servotune --json` with some words: its document and its exit code."""
    if program_file is None:
        pytest.skip("the program is not built: cargo build, or name it in SERVOTUNE")

    def run(*words, folder=None):
        ran = subprocess.run(
            [str(program_file), "--json", *map(str, words)],
            capture_output=True,
            text=True,
            cwd=folder or ROOT,
            check=False,
        )
        assert ran.returncode in (0, 1), ran.stderr
        return json.loads(ran.stdout), ran.returncode

    return run


@pytest.fixture(scope="session")
def healthy(root) -> st.Plant:
    return st.Plant.from_toml(root / "specs/machines/healthy.toml")


@pytest.fixture(scope="session")
def nominal(root) -> st.Controller:
    return st.Controller.from_toml(root / "specs/controllers/nominal.toml")


#: A write and limits that are met at once: what is tested is the way, not the search.
PROFILE = """[spiral]
velocity = 350.0
distance = 15.0
acceleration_time_s = 2e-3
start_s = 8e-3
duration_s = 0.06
[pes]
sample_rate_hz = 27480.0
window = [200, 400]
[noise]
encoder_rms = 0.003
seed = 1
"""
SPEC = """profile = "profile.toml"
sample_time_s = 39.6e-6
[margins]
phase_margin_deg = 25.0
gain_margin_db = 4.0
max_sensitivity = 3.0
[limits]
dft_low = 1.0
[search]
seed = 1
notches = 1
lowpasses = 0
"""


@pytest.fixture(scope="session")
def easy(tmp_path_factory) -> Path:
    """A folder with a spec that is met at once and its profile."""
    folder = tmp_path_factory.mktemp("easy")
    (folder / "spec.toml").write_text(SPEC)
    (folder / "profile.toml").write_text(PROFILE)
    return folder


def swept(plant: st.Plant, seed: int, points: int = 160) -> st.Frf:
    """A sweep of a plant with 1 % noise, 40 to 5000 Hz."""
    random = np.random.default_rng(seed)
    hz = np.geomspace(40.0, 5000.0, points)
    noise = random.normal(size=(2, points)) * 0.01 / np.sqrt(2)
    return st.Frf(hz, plant.response(hz) * (1 + noise[0] + 1j * noise[1]))
