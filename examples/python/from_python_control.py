"""A plant of python-control judged here, and a plant from here judged there."""

# %%
from pathlib import Path

import control
import numpy as np

import servotune as st

ROOT = Path(__file__).resolve().parents[2]
nominal = st.Controller.from_toml(ROOT / "specs/controllers/nominal.toml")

# %% python-control has no dead time: it is said beside the system.
body = control.tf([75 * 369.0**2], [1, 2 * 0.22 * 369.0, 369.0**2])
plant = st.Plant.from_control(body, delay_s=65e-6)
ours = st.margins(plant, nominal)
print(ours)

# %% The exactly sampled loop, there.
sampled = plant.discretise(nominal.sample_time_s).to_control()
loop = sampled * control.ss(nominal.to_control())
grid = np.geomspace(10.0, 0.999 * np.pi / nominal.sample_time_s, 20_000)
gm, pm, *_ = control.stability_margins(control.frd(loop, grid))
print(f"{pm:.4f} deg, {20 * np.log10(gm):.4f} dB")
assert abs(pm - ours.phase_margin_deg) < 1e-3

# %% A sweep goes both ways too.
hz = np.geomspace(10.0, 5e3, 300)
frf = st.Frf.from_control(control.frd(plant.response(hz), 2 * np.pi * hz))
assert np.array_equal(frf.to_control().complex.ravel(), plant.response(hz))
