"""The gate: which machines are worth tuning, from tables of features."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

from servotune import _core
from servotune.document import PathLike, read
from servotune.result import Result


class Classified(Result):
    """The document of `servotune classify --json`."""

    __slots__ = ()

    rows: list[dict[str, Any]]
    abstained: int
    drift: dict[str, Any]

    def to_pandas(self) -> Any:
        """The rows as a pandas data frame."""
        import pandas

        return pandas.DataFrame(self.rows)

    def _repr_html_(self) -> str:
        from html import escape

        head = "<tr><th>machine</th><th>class</th><th>probability</th><th>action</th><th>why</th></tr>"
        cells = (
            (r["id"] or f"line {r['line']}", r["class_name"], f"{r['probability']:.4f}", r["action"], r["why"])
            for r in self.rows
        )
        body = "".join("<tr>" + "".join(f"<td>{escape(str(c))}</td>" for c in row) + "</tr>" for row in cells)
        return f"<table>{head}{body}</table>"


class Gate:
    """A trained gate, what stands in a gate.json.

    Tables are a path of a features.csv, a pandas data frame, an Arrow table, or columns by name. A column `id` is carried along; a missing value is None,
    NaN or an empty field.
    """

    __slots__ = ("_core", "report")

    def __init__(self, core: Any, report: Result | None = None) -> None:
        self._core = core
        #: The document of `servotune train --json`, of a gate that was trained here.
        self.report = report

    @classmethod
    def train(cls, table: Any, label: str, **settings: Any) -> Gate:
        """Trains a gate; `label` is the column of the classes.

        Settings are the program's: `features`, `hidden`, `epochs`, `learning_rate`, `batch`, `folds`, `seed`, `missing_limit`, `correlation_limit`,
        `search`, `coverage`, `novelty_level`, `costs` and `actions` (paths).
        """
        text, name = table_text(table)
        core, answer = _core.train(text, name, label, settings)
        return cls(core, Result(answer))

    @classmethod
    def read(cls, path: PathLike) -> Gate:
        """Reads a gate.json."""
        return cls(_core.Gate.read(path))

    def write(self, path: PathLike) -> None:
        """Writes a gate.json."""
        self._core.write(path)

    @property
    def label(self) -> str:
        """Column of the classes."""
        return self._core.label

    def classify(self, table: Any) -> Classified:
        """Class, probability and action of every row."""
        return Classified(self._core.classify(*table_text(table)))

    def __repr__(self) -> str:
        return repr(self._core)

    def _repr_html_(self) -> str | None:
        return None if self.report is None else self.report._repr_html_()


def table_text(table: Any) -> tuple[str, str]:
    """A table as the text of a features.csv, every number with the digits that it needs to come back, and its name."""
    if isinstance(table, str) or hasattr(table, "__fspath__"):
        path = Path(table)
        return read(path), str(path)
    columns = columns_of(table)
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"table: found columns of unequal length: {lengths}; expected one length")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*([field(v) for v in column] for column in columns.values())))
    return out.getvalue(), "table"


def columns_of(table: Any) -> dict[str, list[Any]]:
    """Columns by name of whatever holds a table."""
    if hasattr(table, "to_pydict"):
        return table.to_pydict()
    if hasattr(table, "to_dict") and hasattr(table, "columns"):
        return {str(name): column for name, column in table.to_dict("list").items()}
    if not hasattr(table, "keys"):
        raise TypeError(
            f"found {type(table).__name__} for a table; expected a path, a data frame, an Arrow table, or columns by name"
        )
    return {str(name): list(table[name]) for name in table.keys()}


def field(value: Any) -> str:
    """A value as a field: empty where it is missing."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if hasattr(value, "item"):
        value = value.item()
        return field(value)
    return repr(value) if isinstance(value, float) else str(value)
