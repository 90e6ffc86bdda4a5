"""Controllers: controller.toml and the controllers of gain tables."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from servotune import _core
from servotune.document import PathLike, text_of, write
from servotune.numbers import finite
from servotune.result import picture


class Controller:
    """A discrete PID with low-passes, notches and feed-forward, what stands in a controller.toml or a gains.toml."""

    __slots__ = ("_core",)

    def __init__(self, core: Any) -> None:
        self._core = core

    @classmethod
    def from_toml(cls, source: PathLike) -> Controller:
        """Reads a controller.toml or a gains.toml; a text with line breaks is taken as its content."""
        text, name = text_of(source, "controller")
        return cls(_core.Controller.parse(text, name))

    def to_toml(self, path: PathLike | None = None) -> str:
        """The text of its file, written to `path` where one is given."""
        text = self._core.to_toml()
        if path is not None:
            write(path, text)
        return text

    @property
    def sample_time_s(self) -> float:
        """Sample time (s)."""
        return self._core.sample_time_s

    @property
    def sections(self) -> np.ndarray:
        """The second-order sections that the firmware runs, k x 5: b0 b1 b2 a1 a2 (a0 = 1)."""
        return np.array(self._core.sections_rows())

    def response(self, hz: Any) -> np.ndarray:
        """C(exp(j 2 pi f T)): complex values (command_unit per position_unit) in the shape of `hz` (Hz)."""
        flat, shape = finite(hz, "hz")
        return self._core.response(flat).reshape(shape)

    def to_control(self) -> Any:
        """The sections as a python-control discrete `TransferFunction`, error in, command out."""
        import control

        numerator, denominator = np.ones(1), np.ones(1)
        for b0, b1, b2, a1, a2 in self.sections:
            numerator, denominator = np.convolve(numerator, [b0, b1, b2]), np.convolve(denominator, [1.0, a1, a2])
        return control.tf(numerator, denominator, self.sample_time_s)

    def to_dict(self) -> dict[str, Any]:
        """The controller.toml as a dictionary."""
        return json.loads(self._core.json())

    def __reduce__(self) -> tuple[Any, ...]:
        # Its text is all there is to it: so it goes to workers of any engine.
        return Controller.from_toml, (self.to_toml(),)

    def __repr__(self) -> str:
        return repr(self._core)

    def _repr_html_(self) -> str | None:
        return picture(self._core.svg())


def controller_of(source: Any) -> Controller:
    """A controller: one of ours, that of a tuning, or a path."""
    if isinstance(source, Controller):
        return source
    found = getattr(source, "controller", None)
    return found if isinstance(found, Controller) else Controller.from_toml(source)
