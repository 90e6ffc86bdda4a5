"""The search of gains that meet a spec."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from servotune import _core
from servotune.controller import Controller, controller_of
from servotune.document import PathLike, write
from servotune.frf import is_sweep, sweep_of
from servotune.numbers import count
from servotune.plant import plant_of
from servotune.result import Result
from servotune.spec import spec_of


class Tuned(Result):
    """The document of `servotune tune --json`, the gain table and its certificate."""

    __slots__ = ("_core", "controller")

    verdict: str
    objective: dict[str, Any]
    after: list[dict[str, Any]]

    def __init__(self, core: Any) -> None:
        super().__init__(core.answer)
        self._core = core
        self.controller = Controller(core.controller)

    @property
    def tuned(self) -> bool:
        """Every limit is met, and whether the loop is stable is known."""
        return self._core.tuned

    @property
    def gains(self) -> str:
        """The gain table, the text of a gains.toml; of an infeasible spec the best compromise."""
        return self._core.gains

    @property
    def certificate_text(self) -> str | None:
        """The certificate, the text of a gains.certificate.json; none where nothing was proved or refused."""
        return self._core.certificate

    @property
    def certified(self) -> bool:
        """Every limit is proved, by algorithms that the search does not use."""
        return self._core.certified

    def save(self, path: PathLike, *, keep_infeasible: bool = False) -> None:
        """Writes the gain table and its certificate beside it; refused where the limits are not met, unless the compromise is asked for."""
        if not (self.tuned or keep_infeasible):
            raise _core.TuneRefused(
                f"{path}: the limits are not met; expected keep_infeasible=True to write the compromise"
            )
        write(path, self.gains)
        beside = Path(path).with_suffix(".certificate.json")
        if self.certificate_text is not None:
            write(beside, self.certificate_text)
        else:
            # One of an earlier table would speak of this one.
            beside.unlink(missing_ok=True)

    def __repr__(self) -> str:
        return f"Tuned({self.verdict}, {self.objective['name']} {self.objective['value']} {self.objective['unit']})"


def tune(
    plant_or_frf: Any,
    spec: Any,
    controller: Any = None,
    *,
    hold_included: bool = False,
    certificate: bool = True,
    uncertainty: dict[str, float] | None = None,
    sample_time_s: float | None = None,
    starts: int = 12,
    **settings: Any,
) -> Tuned:
    """Searches PID, low-pass and notch gains that meet a spec, on a plant model or straight on a measured response.

    spec          : path of a spec.toml, or a `Spec`
    controller    : to start from and to compare with
    certificate   : whether the table is proved
    uncertainty   : shares of a box over which it is proved: gain, frequency, damping, delay (of a sweep the gain alone)
    sample_time_s : of the controller (s), where neither `controller` nor the spec says it
    settings      : of a sweep, those of `identify` for the model that continues it
    """
    start = None if controller is None else controller_of(controller)._core
    sweep = sweep_of(plant_or_frf)._core if is_sweep(plant_or_frf) else None
    plant = None if sweep else plant_of(plant_or_frf)._core
    of = spec_of(spec)._core
    return Tuned(
        _core.tune(plant, sweep, of, start, hold_included, certificate, uncertainty, sample_time_s, count(starts, "starts"), settings)
    )
