"""Plant models: plant.toml, identification, python-control, exact sampling."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

from servotune import _core
from servotune.document import PathLike, text_of, write
from servotune.frf import sweep_of
from servotune.machine import WORDS, Machine
from servotune.numbers import finite
from servotune.result import Result


class Sampled(NamedTuple):
    """A plant behind a hold, sampled exactly: x' = a x + b u, y = c x + d u, dead time as states.

    a : m x m, b : m x 1, c : 1 x m, d : 1 x 1; command_unit in, position_unit out, every sample_time_s seconds.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    sample_time_s: float

    def to_control(self) -> Any:
        """The same as a python-control `StateSpace`."""
        import control

        return control.ss(self.a, self.b, self.c, self.d, self.sample_time_s)


class Plant(Machine):
    """A plant model, what stands in a plant.toml: P(s) = exp(-delay_s s) times a rational part, and physics beyond linear where it has any."""

    __slots__ = ()

    def __init__(self, core: Any) -> None:
        self._core = core

    @classmethod
    def from_toml(cls, source: PathLike) -> Plant:
        """Reads a plant.toml; a text with line breaks is taken as its content."""
        text, name = text_of(source, "plant")
        return Plant(_core.Plant.parse(text, name))

    @classmethod
    def from_control(
        cls, system: Any, delay_s: float = 0.0, position_unit: str = WORDS[0], command_unit: str = WORDS[1]
    ) -> Plant:
        """Of a continuous python-control system (`tf`, `zpk`, `ss`) with one input and one output; such a system has no dead time, so say it."""
        if getattr(system, "dt", 0) not in (0, None):
            raise ValueError(f"found a system sampled at {system.dt} s; expected a continuous one")
        channels = (getattr(system, "ninputs", 1), getattr(system, "noutputs", 1))
        if channels != (1, 1):
            raise ValueError(f"found {channels[0]} inputs and {channels[1]} outputs; expected one of each")
        head = f"position_unit = {json.dumps(position_unit)}\ncommand_unit = {json.dumps(command_unit)}\n[plant]\n"
        delay = f"delay_s = {float(delay_s)!r}\n"
        if all(hasattr(system, key) for key in "ABCD"):
            a, b, c, d = (np.asarray(getattr(system, key), dtype=float) for key in "ABCD")
            body = (
                f"a = {a.tolist()}\nb = {b.ravel().tolist()}\nc = {c.ravel().tolist()}\nd = {float(d.ravel()[0])!r}\n"
            )
        else:
            numerator, denominator = (np.atleast_1d(np.squeeze(part[0][0])) for part in (system.num, system.den))
            body = (
                f"numerator = {numerator.astype(float).tolist()}\ndenominator = {denominator.astype(float).tolist()}\n"
            )
        return Plant(_core.Plant.parse(head + body + delay, "python-control system"))

    def to_control(self, form: str = "zpk") -> Any:
        """The rational part as a python-control system: "zpk" or "tf" (a `TransferFunction`), "ss" (a `StateSpace`). The dead time is `delay_s`."""
        import control

        zeros, poles, gain = self._core.zpk()
        if form == "ss":
            return control.ss(*cascade(zeros, poles, gain))
        if form in ("zpk", "tf"):
            return control.zpk(zeros, poles, gain)
        raise ValueError(f"form: found {form!r}; expected 'zpk', 'tf' or 'ss'")

    def to_toml(self, path: PathLike | None = None) -> str:
        """The text of its plant.toml, written to `path` where one is given."""
        text = self._core.to_toml()
        if path is not None:
            write(path, text)
        return text

    @property
    def delay_s(self) -> float:
        """Dead time (s)."""
        return self._core.delay_s

    @property
    def order(self) -> int:
        """Order of the rational part."""
        return self._core.order

    def response(self, hz: Any) -> np.ndarray:
        """P(j 2 pi f), dead time included: complex values (position_unit per command_unit) in the shape of `hz` (Hz)."""
        flat, shape = finite(hz, "hz")
        return self._core.response(flat).reshape(shape)

    def discretise(self, sample_time_s: float) -> Sampled:
        """The plant behind a zero-order hold of `sample_time_s` seconds, fractional dead time and all, without approximation."""
        state, now, before, output, whole = self._core.discretise(sample_time_s)
        n = len(now)
        # States: the plant's, then the commands of the samples before, newest first.
        held = whole + 1
        a = np.zeros((n + held, n + held))
        a[:n, :n] = np.asarray(state).reshape(n, n)
        b = np.zeros((n + held, 1))
        if whole == 0:
            b[:n, 0] = now
        else:
            a[:n, n + whole - 1] = now
        a[:n, n + whole] = before
        b[n, 0] = 1.0
        for i in range(1, held):
            a[n + i, n + i - 1] = 1.0
        c = np.concatenate([np.asarray(output, dtype=float), np.zeros(held)]).reshape(1, -1)
        return Sampled(a, b, c, np.zeros((1, 1)), sample_time_s)

    def __reduce__(self) -> tuple[Any, ...]:
        # Its text is all there is to it: so it goes to workers of any engine. The quality of an identified one stays behind.
        return Plant.from_toml, (self.to_toml(),)

    def to_dict(self) -> dict[str, Any]:
        """The plant.toml as a dictionary."""
        return json.loads(self._core.json())


class IdentifiedPlant(Plant):
    """A plant with what is known of its quality: intervals, trusted band, the ladder of models (`quality`)."""

    __slots__ = ("quality",)

    def __init__(self, core: Any, answer: Any) -> None:
        super().__init__(core)
        self.quality = Result(answer)

    @property
    def accepted(self) -> bool:
        """The fit converged and some band of it is to be trusted."""
        return self.quality.accepted

    def to_dict(self) -> dict[str, Any]:
        """The document of `servotune identify --json`."""
        return self.quality.to_dict()

    def _repr_html_(self) -> str | None:
        return self.quality._repr_html_()


def identify(frf: Any, **settings: Any) -> IdentifiedPlant:
    """The plant model of a sweep (an `Frf` or a python-control `FRD`).

    Settings are the program's: `order` (even; chosen by held-out frequencies where it is left out), `max_order` (30), `body` ("auto", "second_order",
    "free_inertia"), `minimum_phase` (False), `hold_s` (the sweep was taken through a hold of so many seconds), `band_hz` (low, high).
    """
    return IdentifiedPlant(*_core.identify(sweep_of(frf)._core, settings))


def plant_of(machine: Any) -> Plant:
    """A machine as a plant model: one of ours, a path, or a python-control system."""
    if isinstance(machine, Plant):
        return machine
    if isinstance(machine, str) or hasattr(machine, "__fspath__"):
        return Plant.from_toml(machine)
    if not (hasattr(machine, "num") or all(hasattr(machine, key) for key in "ABCD")):
        raise TypeError(
            f"found {type(machine).__name__} for a plant; expected a Plant, a path, the text of a plant.toml, or a python-control system"
        )
    return Plant.from_control(machine)


def cascade(zeros: list[complex], poles: list[complex], gain: float) -> tuple[np.ndarray, ...]:
    """State space of gain prod(s - z)/prod(s - p), second-order sections in a row: no polynomial of high order is ever multiplied out."""
    lower, upper = pairs(poles), pairs(zeros)
    a, b, c, d = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[float(gain)]])
    for i, den in enumerate(lower):
        num = upper[i] if i < len(upper) else np.array([1.0])
        num = np.concatenate([np.zeros(len(den) - len(num)), num])
        order = len(den) - 1
        through = num[0]
        a2 = np.vstack([-den[1:], np.eye(order)[:-1]])
        b2 = np.eye(order)[:, :1]
        c2 = (num[1:] - through * den[1:]).reshape(1, -1)
        a = np.block([[a, np.zeros((a.shape[0], order))], [b2 @ c, a2]])
        b, c, d = np.vstack([b, b2 @ d]), np.hstack([through * c, c2]), through * d
    return a, b, c, d


def pairs(roots: list[complex]) -> list[np.ndarray]:
    """Factors of a polynomial: of complex pairs and of real roots two by two, fast ones last; a single real root stands alone at the end."""
    complex_ones = sorted((r for r in roots if r.imag > 0), key=abs)
    real = sorted((r.real for r in roots if r.imag == 0), key=abs)
    found = [np.array([1.0, -(r + s), r * s]) for r, s in zip(real[0::2], real[1::2])]
    found += [np.array([1.0, -2 * r.real, abs(r) ** 2]) for r in complex_ones]
    return found + ([np.array([1.0, -real[-1]])] if len(real) % 2 else [])
