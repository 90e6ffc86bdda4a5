"""A controller as its second-order sections: from its own numbers, or from the rows that the firmware runs."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parent.parent / "peers"))

from sections import bilinear, response, state_space


__all__ = ["Law", "from_document", "read", "response", "state_space"]


@dataclass(frozen=True)
class Law:
    """PID, low-passes (Hz, damping), notches (Hz, zero damping, pole damping), at one sample time."""

    sample_time_s: float
    kp: float
    ki_per_s: float
    kd_s: float
    derivative_filter_s: float
    lowpasses: tuple[tuple[float, float], ...] = ()
    notches: tuple[tuple[float, float, float], ...] = ()
    feedforward: dict = field(default_factory=dict)
    output_limit: float | None = None
    fixed: tuple[tuple[float, ...], ...] | None = None
    """Rows b0 b1 b2 a1 a2 of a law that is no PID with low-passes and notches."""

    def rows(self) -> np.ndarray:
        """b0 b1 b2 a1 a2 of every section; a pole at 1 only where there is an integrator."""
        if self.fixed is not None:
            return np.array([_reduced(np.array(r)) for r in self.fixed])
        t, f = self.sample_time_s, self.derivative_filter_s
        a = t + f
        p, d = self.kp * np.array([a, -f, 0.0]) / a, self.kd_s * np.array([1.0, -1.0, 0.0]) / a
        if self.ki_per_s == 0.0:
            rows = [np.concatenate([p + d, [-f / a, 0.0]])]
        else:
            # Times (1 - q) above and below, q = 1/z.
            i = self.ki_per_s * t * np.array([a, -f, 0.0]) / a
            rows = [np.concatenate([_differenced(p + d) + i, [-(a + f) / a, f / a]])]
        rows += [bilinear(hz, t, (0.0, 0.0, 1.0), d) for hz, d in self.lowpasses]
        rows += [bilinear(hz, t, (1.0, 2 * zero, 1.0), pole) for hz, zero, pole in self.notches]
        return np.array(rows)

    def toml(self) -> str:
        """controller.toml."""
        lines = [f"sample_time_s = {self.sample_time_s!r}", "[pid]"]
        for key in ("kp", "ki_per_s", "kd_s", "derivative_filter_s"):
            lines.append(f"{key} = {float(getattr(self, key))!r}")
        for hz, d in self.lowpasses:
            lines += ["[[lowpass]]", f"frequency_hz = {float(hz)!r}", f"damping_ratio = {float(d)!r}"]
        for hz, zero, pole in self.notches:
            lines += ["[[notch]]", f"frequency_hz = {float(hz)!r}"]
            lines += [f"zero_damping_ratio = {float(zero)!r}", f"pole_damping_ratio = {float(pole)!r}"]
        return "\n".join(lines) + "\n"


def _differenced(row: np.ndarray) -> np.ndarray:
    """Times (1 - q); the row's last place is free."""
    return row - np.concatenate([[0.0], row[:-1]])


def _reduced(row: np.ndarray) -> np.ndarray:
    """A section without a pole at 1 that a zero cancels."""
    b, a = row[:3], np.concatenate([[1.0], row[3:]])
    if abs(a.sum()) < 1e-12 and abs(b.sum()) < 1e-12 * abs(b).max():
        return np.array([b[0], b[0] + b[1], 0.0, 1.0 + a[1], 0.0])
    return row


KNOWN = {
    "sample_time_s",
    "output_limit",
    "pid",
    "lowpass",
    "notch",
    "feedforward",
    "section",
    "before",
    "after",
    "provenance",
    "position_unit",
    "command_unit",
}


def read(path: Path) -> Law:
    """controller.toml or gains.toml. Keys of a law beyond PID, low-pass and notch: the firmware's rows are taken; where both stand they must agree."""
    return from_document(tomllib.loads(path.read_text(encoding="utf-8")))


def from_document(d: dict) -> Law:
    rows = tuple(tuple(s[k] for k in ("b0", "b1", "b2", "a1", "a2")) for s in d.get("section", []))
    plain = set(d) <= KNOWN and "pid" in d
    if not plain and not rows:
        raise ValueError(f"neither a PID law nor sections: {sorted(set(d) - KNOWN)}")
    pid = d.get("pid", {})
    law = Law(
        d["sample_time_s"],
        pid.get("kp", 0.0),
        pid.get("ki_per_s", 0.0),
        pid.get("kd_s", 0.0),
        pid.get("derivative_filter_s", 0.0),
        tuple((f["frequency_hz"], f.get("damping_ratio", 0.7)) for f in d.get("lowpass", [])),
        tuple((f["frequency_hz"], f["zero_damping_ratio"], f["pole_damping_ratio"]) for f in d.get("notch", [])),
        d.get("feedforward", {}),
        d.get("output_limit"),
        None if plain else rows,
    )
    if plain and rows:
        q = np.exp(-1j * np.geomspace(1e-3, 3.0, 50))
        apart = abs(response(np.array(rows), q) / response(law.rows(), q) - 1).max()
        if apart > 1e-8:
            raise ValueError(f"the sections and the gains of the table differ by {apart:.1e}")
    return law
