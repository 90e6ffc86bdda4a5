"""Makes results/python_floor.md and .json: `python python/bench/floor.py` with the package, its engines and the program at hand.

One made-up floor, worked on by `servotune fleet run` and by `python -m servotune.floor` over each engine, on one and on two workers, each in processes of its own.
`--slots 1000`, `--engines local ray dask spark`. Floors of other sizes that were measured before stay on the page; each row is written when it is known.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from machine import ROOT, busy, children, fleet_file, program_file

#: Few, so that the stage before the slots is short; it is not what is measured.
PILOTS = 4
#: Files that say nothing of the time of the run.
FILES = ("slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json")


#: Rows of all floors that were measured.
KEPT = ROOT / "results/python_floor.json"


@dataclass
class Way:
    """One way over the floor, measured.

    slots    : that were counted between the first and the last line about slots
    whole_s  : of the run (s)
    slots_s  : between those lines (s)
    busy_s   : of processors between them, all processes (s)
    driver_s : of these the process that was started (s)
    peak_mib : memory of all processes at once (proportional set size, MiB)
    start_s  : until the first word about pilots (s)
    same     : its files are those of the first way
    """

    name: str
    workers: int
    slots: int
    whole_s: float
    slots_s: float
    busy_s: float
    driver_s: float
    peak_mib: float
    start_s: float
    same: bool

    def each_s(self) -> float:
        """Of a processor for a slot (s)."""
        return self.busy_s / self.slots


class Meter(threading.Thread):
    """Memory and processor time of a process and of all that descend from it."""

    def __init__(self, of: int) -> None:
        super().__init__(daemon=True)
        self.of, self.peak_mib, self.over = of, 0.0, threading.Event()
        #: Seconds of each process that was ever seen.
        self.seconds: dict[int, float] = {}

    def run(self) -> None:
        while not self.over.wait(0.5):
            self.look()

    def look(self) -> tuple[float, float]:
        """Processor time so far (s): of all, of the process itself."""
        all_kib = 0.0
        for pid in [self.of, *(pid for pid, _, _ in children(self.of))]:
            try:
                stat = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                found = re.search(r"^Pss:\s+(\d+)", Path(f"/proc/{pid}/smaps_rollup").read_text(), re.M)
            except OSError:
                continue
            self.seconds[pid] = (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")
            all_kib += float(found[1]) if found else 0.0
        self.peak_mib = max(self.peak_mib, all_kib / 1024)
        return sum(self.seconds.values()), self.seconds.get(self.of, 0.0)


def run(name: str, workers: int, fleet: Path, out: Path, alone: Path | None) -> Way:
    """One way, from start to end."""
    common = [str(fleet), "--out", str(out), "--run", "one", "--pages", "0"]
    if name == "fleet run":
        words = [str(program_file()), "fleet", "run", *common, "--threads", str(workers)]
    else:
        words = [sys.executable, "-m", "servotune.floor", *common, "--engine", name, "--workers", str(workers)]
    begun = time.time()
    ran = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    meter = Meter(ran.pid)
    meter.start()
    first = last = pilots = None
    said = []
    for line in ran.stderr:
        said.append(line)
        now = time.time()
        if pilots is None and re.match(r"pilots", line):
            pilots = now
        if count := re.match(r"slots:? (\d+) of (\d+)( left)?", line):
            done = int(count[2]) - int(count[1]) if count[3] else int(count[1])
            last = (now, *meter.look(), done)
            first = first or last
    code, whole = ran.wait(), time.time() - begun
    meter.over.set()
    meter.join()
    if code not in (0, 1):
        raise RuntimeError("".join(said[-20:]))
    same = alone is None or all((out / f).read_bytes() == (alone / f).read_bytes() for f in FILES)
    seconds, busy_s, driver_s, slots = (b - a for a, b in zip(first, last))
    way = Way(name, workers, slots, whole, seconds, busy_s, driver_s, meter.peak_mib, pilots - begun, same)
    print(way, flush=True)
    return way


def main() -> None:
    """Writes the page."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--slots", type=int, default=1000)
    words.add_argument("--engines", nargs="*", default=["local", "ray", "dask", "spark"])
    asked = words.parse_args()
    os.environ.setdefault("RAY_worker_niceness", "0")
    floors = json.loads(KEPT.read_text()) if KEPT.is_file() else {}
    floor = {"ways": [], "machine": "", "store": 0, "engines": asked.engines}
    floors[str(asked.slots)] = floor
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        fleet = fleet_file(folder, asked.slots, PILOTS)
        alone = folder / "fleet run1"
        for name in ["fleet run", *asked.engines]:
            for workers in (1, 2):
                way = run(name, workers, fleet, folder / f"{name}{workers}", alone if floor["ways"] else None)
                floor["ways"].append(asdict(way))
                floor["machine"], floor["store"] = busy(), (alone / "fleet.db").stat().st_size
                KEPT.write_text(json.dumps(floors, indent=1) + "\n")
                KEPT.with_suffix(".md").write_text("\n".join(page(floors)))


def page(floors: dict[str, dict]) -> list[str]:
    """The page's lines."""
    lines = [
        "# The floor on an engine, measured",
        "",
        f"Floors of made-up slots, drawn when they are needed, {PILOTS} pilots. Pilots, library, shared tables and files are in the whole run; the engine works on the",
        "pilots and on the slots.",
        "",
        "*Slots/s*: of the stage of slots. *Processor ms a slot*: of all processes of the run in that stage, their start included where an engine starts workers late; it is what",
        "other work on the machine does not change much. *Of these the driver*: the process that was started; `fleet run` is one process, Spark's driver works in a Java machine",
        "beside it. *Beside `fleet run`*: processor time, relative to the program on as many threads. *Memory*: proportional set size, so that shared pages count once; Ray's",
        f"holds its object store. *Files equal*: {', '.join(FILES)} byte by byte those of the first row.",
        "",
    ]
    for slots in sorted(floors, key=int, reverse=True):
        lines += table(int(slots), floors[slots])
    largest = max((int(s) for s, f in floors.items() if any(w["name"] == "ray" and w["workers"] == 2 for w in f["ways"])), default=None)
    if largest:
        floor = floors[str(largest)]
        lines += million(largest, [Way(**w) for w in floor["ways"]], floor["store"])
    return lines


def table(slots: int, floor: dict) -> list[str]:
    """A floor's rows."""
    ways = [Way(**w) for w in floor["ways"]]
    own = {way.workers: way for way in ways if way.name == "fleet run"}
    lines = [
        f"## {slots} slots",
        "",
        f"`python python/bench/floor.py --slots {slots} --engines {' '.join(floor['engines'])}`. {floor['machine']}",
        "",
        "| way | workers | slots/s | processor ms a slot | of these the driver | beside `fleet run` | whole run (s) | until the engine stands (s) | memory of all processes (MiB) | files equal |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for way in ways:
        fleet = way.name == "fleet run"
        beside = "" if fleet else f"{100 * (way.each_s() / own[way.workers].each_s() - 1):+.0f} %"
        driver = "" if fleet else f"{1e3 * way.driver_s / way.slots:.1f}"
        lines.append(
            f"| {way.name} | {way.workers} | {way.slots / way.slots_s:.1f} | {1e3 * way.each_s():.1f} | {driver} | {beside} | {way.whole_s:.0f} | {way.start_s:.1f} "
            f"| {way.peak_mib:.0f} | {'yes' if way.same else '**no**'} |"
        )
    return [*lines, ""]


def million(slots: int, ways: list[Way], store: int) -> list[str]:
    """What the figures say of a million slots."""
    ray = next((way for way in ways if way.name == "ray" and way.workers == 2), None)
    own = next(way for way in ways if way.name == "fleet run" and way.workers == 2)
    if ray is None:
        return []
    many, machines, cores = 1_000_000, 100, 2
    each = ray.each_s()
    work = many * each / (machines * cores)
    row = store / slots
    rest = own.whole_s - own.slots_s
    return [
        "## A million slots on 100 machines, on paper",
        "",
        f"From the row of Ray on two workers over {slots} slots; machines like this one, nobody else on them. Nothing of it was run.",
        "",
        "| what | how | comes to |",
        "|---|---|---:|",
        f"| work on slots | {1e3 * each:.1f} ms of a processor a slot, {machines * cores} cores | {work / 60:.0f} min |",
        f"| rows to the driver | {row / 1024:.1f} KiB a slot in the store | {many * row / 2**30:.1f} GiB |",
        f"| the driver's own processor time | {1e3 * ray.driver_s / ray.slots:.2f} ms a slot, one core | {many * ray.driver_s / ray.slots / 60:.0f} min |",
        f"| their rate | over that time, one driver that adds {machines * cores / each:.0f} rows/s | {many * row / work / 2**20:.0f} MiB/s |",
        f"| pilots, library, explanations, shared tables, files | as they are here on one driver; they grow by the slots served, see `fleet_scale.md` | {rest:.0f} s for {slots} |",
        "",
        "What limits it: the driver, not the workers. It parses and stores every row, and the end of the run (shared tables, CSV) is one process that reads the store once; "
        "results/fleet_scale.md has the time of that end and the store's own limit. More machines than keep the driver's rate of rows below that limit do not help.",
        "",
    ]


if __name__ == "__main__":
    main()
