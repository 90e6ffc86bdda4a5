"""What a call gives back: the document of the program's `--json` as attributes, and the report's picture for a notebook."""

from __future__ import annotations

import base64
import json
from typing import Any


def picture(svg: str | None) -> str | None:
    """A picture as HTML of its own: its style rules reach nothing else on the page."""
    if svg is None:
        return None
    data = base64.b64encode(svg.encode()).decode()
    return f'<img alt="figure" src="data:image/svg+xml;base64,{data}"/>'


class Result:
    """A document. Its keys are attributes; numbers are those of the program to the last bit."""

    __slots__ = ("_answer", "_document")

    def __init__(self, answer: Any) -> None:
        self._answer = answer
        # Most calls in a loop look at one or two numbers: the document is taken apart when a list or an object of it is first asked for.
        self._document: dict[str, Any] | None = None

    @property
    def accepted(self) -> bool:
        """All was accepted: the program would end with 0."""
        return self._answer.accepted

    @property
    def notes(self) -> list[str]:
        """What was decided on the way."""
        return self._answer.notes

    def _read(self) -> dict[str, Any]:
        if self._document is None:
            self._document = json.loads(self._answer.json)
        return self._document

    def to_dict(self) -> dict[str, Any]:
        """The document of `--json`, a new one each time."""
        return json.loads(self._answer.json)

    def to_json(self) -> str:
        """The same as text."""
        return self._answer.json

    def __getattr__(self, key: str) -> Any:
        # Only what is no attribute comes here.
        if key.startswith("_"):
            raise AttributeError(key)
        if self._document is None and (found := self._answer.plain(key)) is not None:
            return found[0]
        try:
            return self._read()[key]
        except KeyError:
            known = ", ".join(self._read())
            raise AttributeError(f"{type(self).__name__} has no {key!r}; expected one of: {known}") from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._read()})

    def _repr_html_(self) -> str | None:
        return picture(self._answer.svg())
