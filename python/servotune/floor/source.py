"""Where a floor's slots come from: a FLEET.toml, a folder tree, or a table as CSV or Parquet."""

from __future__ import annotations

import json
import os
from pathlib import Path

from servotune.document import PathLike, write


def fleet_file(
    source: PathLike, spec: PathLike | None, out: Path, controller: PathLike | None, gate: PathLike | None
) -> Path:
    """The FLEET.toml of a source: itself, or one written to `out` that names the source, the spec and the controller."""
    source = Path(source)
    if source.suffix == ".toml":
        if spec or controller or gate:
            raise ValueError(
                f"{source}: a FLEET.toml names its spec, controller and gate itself; expected none beside it"
            )
        return source
    if spec is None or controller is None:
        raise ValueError(
            f"{source}: a tree or a table says nothing of limits and gains; expected spec= and controller="
        )
    names = {"spec": spec, "controller": controller, **({"gate": gate} if gate else {})}
    lines = [f"{key} = {quoted(path)}" for key, path in names.items()]
    if source.is_dir():
        entry = f"tree = {quoted(source)}"
    else:
        table = csv_of(source, out) if source.suffix == ".parquet" else source
        entry = f"table = {quoted(table)}"
    made = out / "FLEET.toml"
    write(made, "\n".join([*lines, "", "[input]", entry, ""]))
    return made


def quoted(path: PathLike) -> str:
    """A path that means the same from everywhere, as TOML."""
    return json.dumps(os.path.abspath(path), ensure_ascii=False)


#: Columns of a table of slots that hold paths; they are relative to the table's folder.
PATHS = ("response", "pes", "log", "controller")


def csv_of(source: Path, out: Path) -> Path:
    """A Parquet table of slots (tester, slot, response, pes; log, controller, temperature_c where there are any) as the CSV that the library reads."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(source)
    folder = os.path.abspath(source.parent)
    for name in set(PATHS) & set(table.column_names):
        paths = [os.path.join(folder, p) if p else None for p in table.column(name).to_pylist()]
        table = table.set_column(table.column_names.index(name), name, pa.array(paths, pa.string()))
    made = out / "input.csv"
    pyarrow.csv.write_csv(table, made)
    return made
