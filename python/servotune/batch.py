"""Many machines in one call: an Arrow table in, an Arrow table out, a row for each row.

Rows are independent: a bad one is a row with its error, and what a row gives does not depend on the others, on their order or on the number of threads. Any
object with the Arrow C stream interface is a table (pyarrow, polars, duckdb, nanoarrow), and so are pandas data frames and columns by name. Sweeps are the
columns `frequency_hz`, `magnitude_db`, `phase_deg`, lists of doubles, read without a copy. A row gives the bytes that the program gives for a file of
these numbers with the header "Frequency (Hz)", "Magnitude (dB)", "Phase (deg)". Memory holds one table: hand a large floor over in parts.

`threads` is the number of threads; 0 takes every core.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from servotune import _core
from servotune.controller import controller_of
from servotune.gate import Gate, table_text
from servotune.machine import WORDS
from servotune.numbers import count
from servotune.spec import spec_of

SWEEP = ("frequency_hz", "magnitude_db", "phase_deg")
#: Options of `read_frf` that tell how a column is to be read; the others belong to `identify`.
READING = {"phase", "magnitude", "angle", "frequency", "conjugate", "outliers", "expect_hz", "unstable_poles"}


def tune(
    table: Any,
    spec: Any,
    controller: Any = None,
    *,
    hold_included: bool = False,
    certificate: bool = True,
    starts: int = 12,
    sample_time_s: float | None = None,
    position_unit: str = WORDS[0],
    command_unit: str = WORDS[1],
    threads: int = 0,
    **options: Any,
) -> pa.Table:
    """Tunes every sweep: `slot`, `verdict`, `objective`, `phase_margin_deg`, `gain_margin_db`, `max_sensitivity`, `gains` (TOML), `certified`, `error`,
    and `document` and `certificate` (JSON).

    A row may bring a `controller` (TOML) to start from; `controller` is that of the rows that bring none. Options are those of `read_frf` and `identify`.
    """
    table = arrow(table)
    reading, model = split(options)
    slots = words(table, "slot")
    rows = _core.batch_tune(
        slots,
        sweeps(table),
        optional(table, "controller"),
        None if controller is None else controller_of(controller)._core,
        spec_of(spec)._core,
        (position_unit, command_unit),
        hold_included,
        certificate,
        count(starts, "starts"),
        sample_time_s,
        reading,
        model,
        count(threads, "threads"),
    )
    number = pa.float64()
    fields = [
        ("verdict", pa.string()),
        ("objective", number),
        ("phase_margin_deg", number),
        ("gain_margin_db", number),
        ("max_sensitivity", number),
        ("gains", pa.string()),
        ("certified", pa.bool_()),
        ("document", pa.string()),
        ("certificate", pa.string()),
    ]
    return result(slots, rows, fields, missing(table, SWEEP))


def identify(
    table: Any,
    *,
    position_unit: str = WORDS[0],
    command_unit: str = WORDS[1],
    threads: int = 0,
    **options: Any,
) -> pa.Table:
    """Identifies every sweep: `slot`, `order`, `rms_relative_error`, `plant` (TOML), `accepted`, `error`, `document` (JSON)."""
    table = arrow(table)
    reading, model = split(options)
    slots = words(table, "slot")
    units = (position_unit, command_unit)
    rows = _core.batch_identify(slots, sweeps(table), units, reading, model, count(threads, "threads"))
    fields = [
        ("order", pa.int64()),
        ("rms_relative_error", pa.float64()),
        ("plant", pa.string()),
        ("accepted", pa.bool_()),
        ("document", pa.string()),
    ]
    return result(slots, rows, fields, missing(table, SWEEP))


def margins(
    table: Any, controller: Any = None, *, hold_included: bool = False, threads: int = 0, **options: Any
) -> pa.Table:
    """Margins of every row, of its `plant` (TOML) or of its sweep: the margins by name, `error`, `document` (JSON).

    A row may bring its `controller` (TOML); `controller` is that of the rows that bring none.
    """
    table = arrow(table)
    reading, model = split(options)
    if model:
        raise TypeError(f"found the keyword {next(iter(model))!r}; expected one of: {', '.join(sorted(READING))}")
    slots = words(table, "slot")
    swept = SWEEP[0] in table.column_names
    rows = _core.batch_margins(
        slots,
        optional(table, "plant") if "plant" in table.column_names else None,
        sweeps(table) if swept else None,
        optional(table, "controller"),
        None if controller is None else controller_of(controller)._core,
        hold_included,
        reading,
        count(threads, "threads"),
    )
    number = pa.float64()
    names = "phase_margin_deg gain_crossover_hz gain_margin_db phase_crossover_hz max_sensitivity max_sensitivity_hz"
    names += " modulus_margin delay_margin_s disk_margin"
    fields = [("stable", pa.bool_()), *((name, number) for name in names.split()), ("document", pa.string())]
    return result(slots, rows, fields)


def verify(table: Any, spec: Any, uncertainty: dict[str, float] | None = None, *, threads: int = 0) -> pa.Table:
    """Proves every row's `gains` (TOML) on its `plant` (TOML): `slot`, `proved`, `findings` (count), `error`, `document` (JSON)."""
    table = arrow(table)
    slots = words(table, "slot")
    gains, plants = optional(table, "gains"), optional(table, "plant")
    rows = _core.batch_verify(slots, gains, plants, spec_of(spec)._core, uncertainty, count(threads, "threads"))
    fields = [("proved", pa.bool_()), ("findings", pa.int64()), ("document", pa.string())]
    return result(slots, rows, fields)


def classify(table: Any, gate: Any) -> pa.Table:
    """Classifies every row of features: `slot` (or `id`), `class`, `probability`, `action`, `abstained`, `why`, `error`."""
    table = arrow(table)
    gate = gate if isinstance(gate, Gate) else Gate.read(gate)
    name = "slot" if "slot" in table.column_names else "id"
    slots = words(table, name) if name in table.column_names else [str(i) for i in range(table.num_rows)]
    features = table.drop_columns([c for c in ("slot", "id") if c in table.column_names])
    fields = [
        ("class", pa.string()),
        ("probability", pa.float64()),
        ("action", pa.string()),
        ("abstained", pa.bool_()),
        ("why", pa.string()),
    ]

    def rows_of(part: pa.Table) -> list[Any]:
        text, called = table_text(part)
        keys = ("class_name", "probability", "action", "abstained", "why")
        from servotune.gate import Classified

        return [(tuple(r[k] for k in keys), None) for r in Classified(gate._core.classify(text, called)).rows]

    try:
        rows = rows_of(features) if table.num_rows else []
    except _core.ServotuneError:
        # One row spoils the table: each stands for itself then.
        rows = []
        for i in range(table.num_rows):
            try:
                rows += rows_of(features.slice(i, 1))
            except _core.ServotuneError as e:
                rows.append((None, " ".join(str(e).split())))
    return result(slots, rows, fields)


def diagnose(table: Any, *, threads: int = 0) -> pa.Table:
    """Diagnoses every row's case folder (`case`, a path): `slot`, `verdict`, `effects`, `error`, `document` (JSON)."""
    table = arrow(table)
    folders = optional(table, "case")
    slots = words(table, "slot") if "slot" in table.column_names else [str(f) for f in folders]
    rows = _core.batch_diagnose(folders, count(threads, "threads"))
    fields = [("verdict", pa.string()), ("effects", pa.list_(pa.string())), ("document", pa.string())]
    return result(slots, rows, fields)


def arrow(table: Any) -> pa.Table:
    """A table of any kind as Arrow's; nothing is copied where it already is one."""
    if not isinstance(table, pa.Table):
        if not any(hasattr(table, key) for key in ("__arrow_c_stream__", "__arrow_c_array__", "keys")):
            raise TypeError(
                f"found {type(table).__name__} for a table; expected an Arrow table, a data frame, or columns by name"
            )
        try:
            table = pa.Table.from_batches([table]) if isinstance(table, pa.RecordBatch) else pa.table(table)
        except (pa.ArrowException, TypeError) as e:
            raise ValueError(f"table: {e}; expected columns of one length, each of one type") from None
    twice = {name for name in table.column_names if table.column_names.count(name) > 1}
    if twice:
        raise ValueError(f"table: found the column {min(twice)!r} more than once; expected each name once")
    return table


def cast(column: Any, name: str, kind: pa.DataType, expected: str) -> Any:
    """A column as one of `kind`."""
    try:
        return column.cast(kind)
    except pa.ArrowException:
        raise TypeError(f"column {name!r}: found {column.type}; expected {expected}") from None


def need(table: pa.Table, name: str) -> pa.ChunkedArray:
    """A column that must be there."""
    if name not in table.column_names:
        found = ", ".join(table.column_names) or "no column at all"
        raise ValueError(f"table: no column {name!r}; found {found}; expected it")
    return table.column(name)


def words(table: pa.Table, name: str) -> list[str]:
    """A column of words; a null is an empty one."""
    return [v or "" for v in cast(need(table, name), name, pa.string(), "words").to_pylist()]


def optional(table: pa.Table, name: str) -> list[str | None]:
    """A column of words that may be absent."""
    if name not in table.column_names:
        return [None] * table.num_rows
    return cast(table.column(name), name, pa.string(), "words").to_pylist()


def sweeps(table: pa.Table) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Offsets and values of the three columns of a sweep: views of the table's own memory."""
    offsets, values = [], []
    for name in SWEEP:
        column = need(table, name).combine_chunks()
        if isinstance(column, pa.ChunkedArray):
            column = column.chunk(0) if column.num_chunks else pa.array([], type=column.type)
        column = cast(column, name, pa.large_list(pa.float64()), "lists of numbers")
        offsets.append(column.offsets.to_numpy())
        values.append(np.ascontiguousarray(column.values.to_numpy(zero_copy_only=False)))
    return offsets, values


def missing(table: pa.Table, names: tuple[str, ...]) -> dict[int, str]:
    """Rows that have no list in one of the columns, with the error that says so."""
    found = {}
    for name in names:
        column = table.column(name)
        if column.null_count:
            nulls = np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False))
            found.update({int(i): f"{name} is null; expected a list of numbers" for i in nulls})
    return found


def split(options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of the reader and those of the model."""
    reading = {k: v for k, v in options.items() if k in READING}
    return reading, {k: v for k, v in options.items() if k not in READING}


def result(
    slots: list[str],
    rows: list[tuple[tuple[Any, ...] | None, str | None]],
    fields: list[tuple[str, pa.DataType]],
    missing: dict[int, str] | None = None,
) -> pa.Table:
    """The table of results, `slot` first and `error` before the documents."""
    rows = [(None, missing[i]) if missing and i in missing else row for i, row in enumerate(rows)]
    columns: dict[str, pa.Array] = {"slot": pa.array(slots, pa.string())}
    for k, (name, kind) in enumerate(fields):
        if name == "document":
            columns["error"] = pa.array([error for _, error in rows], pa.string())
        columns[name] = pa.array([None if found is None else found[k] for found, _ in rows], kind)
    if "error" not in columns:
        columns["error"] = pa.array([error for _, error in rows], pa.string())
    return pa.table(columns)
