"""Measured frequency responses: from sweep files, numpy arrays, python-control."""

from __future__ import annotations

from typing import Any

import numpy as np

from servotune import _core
from servotune.document import PathLike, write
from servotune.machine import WORDS, Machine
from servotune.numbers import vector


class Frf(Machine):
    """A frequency response, position over command.

    frequency_hz : n ascending frequencies (Hz)
    response     : n complex values (position_unit per command_unit)
    relative_std : n standard deviations of the values over their sizes, where they are known
    """

    __slots__ = ()

    def __init__(
        self,
        frequency_hz: Any,
        response: Any,
        position_unit: str = WORDS[0],
        command_unit: str = WORDS[1],
        *,
        relative_std: Any = None,
        unstable_poles: int = 0,
    ) -> None:
        hz = vector(frequency_hz, "frequency_hz")
        value = vector(response, "response", np.complex128)
        std = None if relative_std is None else vector(relative_std, "relative_std")
        self._core = _core.Frf(hz, value, std, position_unit, command_unit, unstable_poles)

    @classmethod
    def _of(cls, core: Any) -> Frf:
        made = cls.__new__(cls)
        made._core = core
        return made

    @classmethod
    def from_control(cls, frd: Any, position_unit: str = WORDS[0], command_unit: str = WORDS[1]) -> Frf:
        """Of a python-control `FRD` with one input and one output; its frequencies are rad/s."""
        value = np.asarray(frd.frdata if hasattr(frd, "frdata") else frd.fresp)
        if value.shape[:2] != (1, 1):
            raise ValueError(f"found {value.shape[1]} inputs and {value.shape[0]} outputs; expected one of each")
        return cls(np.asarray(frd.omega) / (2 * np.pi), value[0, 0], position_unit, command_unit)

    def to_control(self) -> Any:
        """The same as a python-control `FRD`."""
        import control

        return control.frd(self.response, 2 * np.pi * self.frequency_hz)

    @property
    def frequency_hz(self) -> np.ndarray:
        """Frequencies (Hz), n."""
        return self._core.frequency_hz

    @property
    def response(self) -> np.ndarray:
        """Complex values (position_unit per command_unit), n."""
        return self._core.response

    @property
    def relative_std(self) -> np.ndarray | None:
        """Standard deviation of each value over its size, n."""
        return self._core.relative_std

    @property
    def coherence(self) -> np.ndarray | None:
        """Coherence at each point, n, where the file has it."""
        return self._core.coherence

    @property
    def magnitude_db(self) -> np.ndarray:
        """20 lg |response| (dB), n."""
        return 20 * np.log10(np.abs(self.response))

    @property
    def phase_deg(self) -> np.ndarray:
        """Phase of the response, wrapped to +-180 (deg), n."""
        return np.degrees(np.angle(self.response))

    @property
    def unstable_poles(self) -> int:
        """Poles of the plant in the right half-plane, as stated: no sweep shows them."""
        return self._core.unstable_poles

    @property
    def notes(self) -> list[str]:
        """What was decided as the file was read."""
        return self._core.notes

    @property
    def source_digest(self) -> str:
        """SHA-256 of the file it came from, or of the one that `to_bod` would write."""
        return self._core.source_digest

    def to_bod(self, path: PathLike) -> None:
        """Writes it as a sweep file (Hz, dB, deg)."""
        write(path, self._core.to_bod())

    def to_dict(self) -> dict[str, Any]:
        """Columns of the sweep, units, notes and digest."""
        columns = {"frequency_hz": self.frequency_hz, "magnitude_db": self.magnitude_db, "phase_deg": self.phase_deg}
        std = self.relative_std
        return {
            **{name: column.tolist() for name, column in columns.items()},
            "relative_std": None if std is None else std.tolist(),
            "position_unit": self.position_unit,
            "command_unit": self.command_unit,
            "notes": self.notes,
            "source_digest": self.source_digest,
        }

    def __len__(self) -> int:
        return len(self._core)


def read_frf(
    path: PathLike,
    *,
    position_unit: str = WORDS[0],
    command_unit: str = WORDS[1],
    controller: Any = None,
    **options: Any,
) -> Frf:
    """Reads a swept-sine file: .bod, .csv, .tsv, .txt (gzip allowed) or UFF with dataset 58.

    Options are the program's, each decided from the file and noted where it is left out: `phase` ("margin", "response"), `magnitude` ("decibels",
    "linear"), `angle` ("degrees", "radians"), `frequency` ("hertz", "rad_per_s"), `conjugate`, `duplicates`, `unsorted`, `bad_points`, `outliers`,
    `deviation`, `columns` (names by role: frequency and magnitude, phase or real, imaginary; std, coherence), `dataset`, `expect_hz` (low, high),
    `measured` ("P", "L", "S", "T", "PS", "CS"; what was swept, with the `controller` that ran), `unstable_poles`.
    """
    from servotune.controller import controller_of

    ran = None if controller is None else controller_of(controller)._core
    return Frf._of(_core.read_frf(path, ran, position_unit, command_unit, options))


def is_sweep(machine: Any) -> bool:
    """Whether a machine is a measured response, this package's or python-control's."""
    return isinstance(machine, Frf) or hasattr(machine, "frdata") or hasattr(machine, "fresp")


def sweep_of(machine: Any) -> Frf:
    """A machine as a sweep."""
    if isinstance(machine, Frf):
        return machine
    if not is_sweep(machine):
        raise TypeError(f"found {type(machine).__name__} for a sweep; expected an Frf or a python-control FRD")
    return Frf.from_control(machine)
