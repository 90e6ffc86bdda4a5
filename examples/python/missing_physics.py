"""What a linear model of the EMPS axis leaves out, and the model with it."""

# %%
import os
from pathlib import Path

import servotune as st

SHARED = os.environ.get("SERVOTUNE_SHARED", Path(__file__).resolve().parents[3] / "shared")
CASE = Path(SHARED) / "practice/emps"
if not CASE.is_dir():
    raise SystemExit("../shared/practice/emps is absent: there are no records to diagnose")
found = st.diagnose(CASE)
print(found)
for finding in found.findings:
    print(finding["says"])

# %% The fit on the laps that were never used.
held_out = found.fit["holdout"]
print({key: held_out[key] for key in ("rms_before", "rms_refit_linear", "rms_after", "noise_floor")})

# %% The corrected plant simulates, judges and tunes like any other.
if found.corrected is not None:
    print(found.corrected.to_toml())
