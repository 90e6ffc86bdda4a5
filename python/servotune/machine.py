"""What a measured response and a plant model have in common: units, and a picture of themselves."""

from __future__ import annotations

from typing import Any

from servotune.result import picture

#: Units of position and command where none are said.
WORDS = "track", "V"


class Machine:
    """A machine from command to position, as it was measured or as it is modelled."""

    __slots__ = ("_core",)

    _core: Any

    @property
    def position_unit(self) -> str:
        """Unit of position."""
        return self._core.position_unit

    @property
    def command_unit(self) -> str:
        """Unit of the command."""
        return self._core.command_unit

    def __repr__(self) -> str:
        return repr(self._core)

    def _repr_html_(self) -> str | None:
        return picture(self._core.svg())
