"""A made-up floor on Ray: `python examples/python/floor_on_ray.py [testers]`; 63 testers of 16 slots are a floor of about 1000."""

# %%
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from servotune import floor

TESTERS = int(sys.argv[1]) if len(sys.argv) > 1 else 1
PROGRAM = os.environ.get("SERVOTUNE", "servotune")

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([PROGRAM, "twin", "fleet", "--out", folder, "--testers", str(TESTERS)], check=True)

    # %% Two workers; the store and the files are those of `servotune fleet run`.
    ran = floor.run(Path(folder) / "FLEET.toml", engine="ray", out=Path(folder) / "results", workers=2, said=print)
    print(ran.slots, ran.verdicts)
    assert sum(ran.verdicts.values()) == ran.slots == 16 * TESTERS
