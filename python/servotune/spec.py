"""What tuning must reach: spec.toml."""

from __future__ import annotations

from typing import Any

from servotune import _core
from servotune.document import PathLike


class Spec:
    """Limits, objective, structure and search, with the profile that the spec names."""

    __slots__ = ("_core",)

    def __init__(self, core: Any) -> None:
        self._core = core

    @classmethod
    def read(cls, path: PathLike) -> Spec:
        """Reads a spec.toml; paths in it are relative to its folder."""
        return cls(_core.Spec.read(path))

    @classmethod
    def parse(cls, text: str, profile: str | None = None) -> Spec:
        """The spec in a text, with the text of the profile that it names."""
        return cls(_core.Spec.parse(text, profile))

    def to_toml(self) -> str:
        """The text of its file."""
        return self._core.to_toml()

    def __repr__(self) -> str:
        return repr(self._core)


def spec_of(source: Any) -> Spec:
    """A spec: one of ours, a path, or a text without a profile."""
    if isinstance(source, Spec):
        return source
    if isinstance(source, str) and "\n" in source:
        return Spec.parse(source)
    if not (isinstance(source, str) or hasattr(source, "__fspath__")):
        raise TypeError(f"found {type(source).__name__} for the spec; expected a Spec, a path, or the text of a spec.toml")
    return Spec.read(source)
