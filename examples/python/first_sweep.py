"""First sweep to proved table: the linear stage of examples/stage."""

# %%
from pathlib import Path

import servotune as st

STAGE = Path(__file__).resolve().parents[1] / "stage"
frf = st.read_frf(STAGE / "sweep.csv", position_unit="um", command_unit="A")
print(frf, *frf.notes, sep="\n")

# %% The model, and how far it is to be trusted.
plant = st.identify(frf)
trusted = plant.quality.trusted
print(
    f"order {plant.order}, delay {1e6 * plant.delay_s:.1f} us, trusted {trusted['low_hz']:.0f} to {trusted['high_hz']:.0f} Hz"
)

# %% The loop of today.
controller = st.Controller.from_toml(STAGE / "controller.toml")
today = st.margins(plant, controller)
print(today)

# %% Gains that meet the limits, proved over 5 % of gain and of dead time.
box = {"gain": 0.05, "delay": 0.05}
tuned = st.tune(plant, STAGE / "spec.toml", controller, uncertainty=box, starts=2)
print(tuned, "certified" if tuned.certified else "not certified")

# %% The table proved again by other algorithms.
certificate = st.verify(tuned, plant, STAGE / "spec.toml", box)
print(certificate)
assert certificate.proved == tuned.certified
