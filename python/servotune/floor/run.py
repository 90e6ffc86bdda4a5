"""A run over the floor: pilots, library, slots, shared tables, files."""

from __future__ import annotations

import datetime
import getpass
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from servotune import ServotuneError, _core
from servotune.document import PathLike
from servotune.floor.source import fleet_file
from servotune.floor.task import Found, Spread, Task
from servotune.numbers import count

#: Engines and the modules that speak to them.
ENGINES = {
    "local": "servotune.floor.local",
    "ray": "servotune.floor.over_ray",
    "dask": "servotune.floor.over_dask",
    "spark": "servotune.floor.over_spark",
}


class EngineFailed(ServotuneError):
    """The engine gave up, mostly on a batch that ended its worker every time. What came back before is in the store."""


@dataclass(frozen=True)
class Ran:
    """What a run came to.

    run      : its name in the store
    slots    : number of slots
    verdicts : number of slots of each verdict
    files    : what was written, the store apart
    """

    run: str
    slots: int
    verdicts: dict[str, int]
    files: list[str]


def run(
    source: PathLike,
    spec: PathLike | None = None,
    engine: str = "local",
    *,
    out: PathLike,
    controller: PathLike | None = None,
    gate: PathLike | None = None,
    workers: int = 0,
    batch: int = 16,
    name: str | None = None,
    who: str | None = None,
    pages: int = 12,
    said: Callable[[str], Any] = lambda words: None,
) -> Ran:
    """Works on every slot and writes what `servotune fleet run` writes: the store, tables, gains, shared tables, work list, drift, the page.

    source  : FLEET.toml; or a folder tree or a table (CSV, Parquet) of slots, with `spec` and `controller`, and `gate` where there is one
    engine  : "local" (threads), "ray", "dask", "spark"
    out     : folder to write to; the workers need the source's files, not this folder, unless it holds the FLEET.toml
    workers : 0 for as many as the engine has
    batch   : slots in one task of the engine and in one transaction of the store
    name    : of the run in the store; without one an unfinished run with the same inputs goes on
    pages   : slots with a full report
    said    : is told how far it is
    """
    if engine not in ENGINES:
        raise ValueError(f"engine: found {engine!r}; expected one of: {', '.join(ENGINES)}")
    workers, batch, pages = count(workers, "workers"), count(batch, "batch"), count(pages, "pages")
    if batch == 0:
        raise ValueError("batch: found 0; expected at least one slot in a task")
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    fleet = fleet_file(source, spec, out, controller, gate).resolve()
    now = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    floor = _core.Floor(fleet, out, name, who or getpass.getuser(), now)
    # An engine is not started where all is done: what is left is the end.
    nothing_left = not (floor.pilots_left() or floor.slots_left())
    try:
        started = nullcontext(None) if nothing_left else import_module(ENGINES[engine]).engine(workers)
        with started as spread:
            on_slots(floor, fleet, spread, engine, workers, batch, said)
    except ServotuneError:
        raise
    except ModuleNotFoundError as e:
        raise ImportError(f"engine {engine}: found no package {e.name!r}; expected it here: pip install 'servotune[{engine}]'") from e
    except Exception as e:
        raise EngineFailed(
            f"{fleet}: {engine} gave up: {e}; {floor.slots() - len(floor.slots_left())} of {floor.slots()} slots are done and kept; "
            "start it again to go on, with batch=1 to lose no slot but the one that fails"
        ) from e
    said("shared tables and files")
    verdicts, files = floor.conclude(workers if engine == "local" else 0, pages)
    written = [str(f) for f in files]
    table = out / "slots.csv"
    if table.exists():
        written.append(parquet_beside(table))
    return Ran(floor.run(), floor.slots(), verdicts, written)


def on_slots(
    floor: _core.Floor,
    fleet: Path,
    spread: Spread | None,
    engine: str,
    workers: int,
    batch: int,
    said: Callable[[str], Any],
) -> None:
    """Pilots, library, slots: what is left of them."""
    pilots = floor.pilots_left()
    said(f"pilots: {len(pilots)} left")
    for found in over(spread, Task(str(fleet)), pilots, 1):
        floor.add_pilots(found)
    said("library")
    library = floor.library(workers if engine == "local" else 0)

    left = floor.slots_left()
    said(f"slots: {len(left)} of {floor.slots()} left")
    done = floor.slots() - len(left)
    for found in over(spread, Task(str(fleet), library), left, batch):
        floor.add_rows([text for _, text in found])
        done += len(found)
        said(f"slots: {done} of {floor.slots()}")


def over(spread: Spread | None, task: Task, places: list[int], size: int) -> Iterable[Found]:
    """What an engine finds on places, so many in a batch."""
    if spread is None or not places:
        return []
    return spread(task, [places[i : i + size] for i in range(0, len(places), size)])


def parquet_beside(table: Path) -> str:
    """A CSV table as Parquet beside it: numbers where every field is one, words elsewhere."""
    try:
        import pyarrow.csv
        import pyarrow.parquet
    except ImportError:
        # The tables are there as CSV.
        return str(table)
    made = table.with_suffix(".parquet")
    pyarrow.parquet.write_table(pyarrow.csv.read_csv(table), made)
    return str(made)
