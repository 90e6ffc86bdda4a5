"""Where simulation and recordings differ, and what physics is missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from servotune import _core
from servotune.controller import controller_of
from servotune.document import PathLike, write
from servotune.gate import columns_of
from servotune.numbers import vector
from servotune.plant import Plant, plant_of
from servotune.result import Result


@dataclass
class Record:
    """One record of a machine.

    columns       : a data frame or columns by name, each of n samples: time_s (s), command and excitation (command_unit), reference and position
                    (position_unit); where they were logged pes, spindle_rad, temperature_c. command and position are needed
    role          : "fit", or "holdout" for one that is never used to fit
    repeat_group  : records of one group share reference and excitation
    sample_time_s : where there is no time_s (s)
    """

    name: str
    columns: Any
    role: str = "fit"
    repeat_group: str | None = None
    sample_time_s: float | None = None

    def _parts(self) -> tuple[Any, ...]:
        arrays = {
            name: vector(column, f"{self.name}: column `{name}`")
            for name, column in columns_of(self.columns).items()
            if name in COLUMNS
        }
        return self.name, self.role, self.repeat_group, self.sample_time_s, arrays


COLUMNS = {"time_s", "command", "position", "reference", "excitation", "pes", "spindle_rad", "temperature_c"}


class Diagnosis(Result):
    """The document diagnosis.json, the corrected plant, and the report."""

    __slots__ = ("corrected", "report")

    verdict: str
    findings: list[dict[str, Any]]
    fit: dict[str, Any]
    next_experiment: dict[str, Any]
    remarks: list[str]

    def __init__(self, answer: Any, corrected: str | None, report: str) -> None:
        super().__init__(answer)
        #: The plant with the physics that was found; none where it would simulate worse than the given one.
        self.corrected = None if corrected is None else Plant.from_toml(corrected)
        #: The report, one HTML page.
        self.report = report

    def save_report(self, path: PathLike) -> None:
        """Writes the report."""
        write(path, self.report)

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict}, {', '.join(f['effect'] for f in self.findings) or 'no finding'})"


def diagnose(
    case_or_records: Any,
    plant: Any = None,
    controller: Any = None,
    *,
    id: str = "records",
    spindle_hz: float | None = None,
    bootstrap: int = 0,
) -> Diagnosis:
    """Diagnoses a case folder (a path), or a list of `Record` with the `plant`; without a `controller` the command is taken as given.

    spindle_hz : Hz
    bootstrap  : draws of the parametric bootstrap, a check of the search's false alarms
    """
    if isinstance(case_or_records, str) or hasattr(case_or_records, "__fspath__"):
        return Diagnosis(*_core.diagnose_case(case_or_records, bootstrap))
    if plant is None:
        raise TypeError("records need the plant model that they are held against: plant=")
    records = [r._parts() for r in case_or_records]
    law = None if controller is None else controller_of(controller)._core
    return Diagnosis(*_core.diagnose_records(id, records, plant_of(plant)._core, law, spindle_hz, bootstrap))
