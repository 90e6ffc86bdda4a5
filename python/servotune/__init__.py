"""Servo identification, margins, PES simulation, gain tuning and diagnosis, on the library behind the `servotune` program.

Files are those of the program; every number has its unit in its name; every result's `to_dict()` is the document that the program prints with `--json`.

>>> import servotune as st
>>> frf = st.read_frf("slot07.bod")
>>> plant = st.identify(frf)
>>> st.margins(plant, st.Controller.from_toml("controller.toml")).phase_margin_deg
"""

from servotune._core import (
    ControllerRefused,
    DiagnoseRefused,
    DocumentRefused,
    FleetRefused,
    FrfRefused,
    GateRefused,
    IdentifyRefused,
    MarginsRefused,
    PhysicsRefused,
    PlantRefused,
    ProfileRefused,
    RecordingRefused,
    ReportRefused,
    ServotuneError,
    SimulateRefused,
    TuneRefused,
    VerifyRefused,
    __version__,
)
from servotune.certificate import Certificate, verify
from servotune.controller import Controller
from servotune.diagnosis import Diagnosis, Record, diagnose
from servotune.frf import Frf, read_frf
from servotune.gate import Classified, Gate
from servotune.loop import Margins, margins
from servotune.plant import IdentifiedPlant, Plant, Sampled, identify
from servotune.spec import Spec
from servotune.tuning import Tuned, tune
from servotune.write import Simulation, simulate

__all__ = [
    "Certificate",
    "Classified",
    "Controller",
    "ControllerRefused",
    "Diagnosis",
    "DiagnoseRefused",
    "DocumentRefused",
    "FleetRefused",
    "Frf",
    "FrfRefused",
    "Gate",
    "GateRefused",
    "IdentifiedPlant",
    "IdentifyRefused",
    "Margins",
    "MarginsRefused",
    "PhysicsRefused",
    "Plant",
    "PlantRefused",
    "ProfileRefused",
    "Record",
    "RecordingRefused",
    "ReportRefused",
    "Sampled",
    "ServotuneError",
    "SimulateRefused",
    "Simulation",
    "Spec",
    "Tuned",
    "TuneRefused",
    "VerifyRefused",
    "__version__",
    "diagnose",
    "identify",
    "margins",
    "read_frf",
    "simulate",
    "tune",
    "verify",
]
