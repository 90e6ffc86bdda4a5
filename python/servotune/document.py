"""The text of a file of the contract: from a path, or the text itself."""

from __future__ import annotations

import os
from pathlib import Path

PathLike = str | os.PathLike


def text_of(source: PathLike, called: str) -> tuple[str, str]:
    """The text and the name that messages use. A `str` with a line break is the text itself, anything else a path."""
    if isinstance(source, str) and "\n" in source:
        return source, called
    if not (isinstance(source, str) or hasattr(source, "__fspath__")):
        raise TypeError(f"found {type(source).__name__} for the {called}; expected a path or the text of its file")
    path = Path(source)
    return read(path), str(path)


def read(path: Path) -> str:
    """A text file; refused with the library's words where it is none."""
    from servotune._core import DocumentRefused

    try:
        return path.read_bytes().decode("utf-8")
    except OSError as e:
        raise DocumentRefused(f"{path}: cannot read: {e.strerror}; expected a text file") from e
    except UnicodeDecodeError as e:
        raise DocumentRefused(f"{path}: byte {e.start} is not UTF-8 text; expected a text file, saved as UTF-8") from e


def write(path: PathLike, text: str) -> None:
    """Writes a text as it is, whole: what was there stays where this fails."""
    from servotune._core import write_text

    write_text(path, text)
