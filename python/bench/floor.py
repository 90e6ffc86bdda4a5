"""Makes results/python_floor.md and .json: `python python/bench/floor.py` with the package, its engines and the program at hand.

One made-up floor, worked on by `servotune fleet run` and by `python -m servotune.floor` over each engine, on one and on two workers, each in processes of its own.
`--slots 1000`, `--engines local ray dask spark`, `--workers 2 1`. Each row is written when it is known, and a row that is known is not measured again without
`--again`: a long table may take several goes. Floors of other sizes stay on the page.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from machine import ROOT, children, fleet_file, program_file

#: Few, so that the stage before the slots is short; it is not what is measured.
PILOTS = 4
#: Files that say nothing of the time of the run.
FILES = ("slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json")


#: Of the rows.
ORDER = ("fleet run", "local", "ray", "dask", "spark")
#: Rows of all floors that were measured.
KEPT = ROOT / "results/python_floor.json"


@dataclass
class Way:
    """One way over the floor, measured.

    slots    : that were counted between the first and the last line about slots
    whole_s  : of the run (s)
    slots_s  : between those lines (s)
    busy_s   : of processors between them, all processes (s)
    driver_s : of these the process that was started (s); none where it was not looked at
    peak_mib : memory of all processes at once (proportional set size, MiB)
    start_s  : until the first word about pilots (s)
    same     : its files are those of the first way
    load     : average load of the machine over the last minutes of the run (1.0 is one busy core)
    """

    name: str
    workers: int
    slots: int
    whole_s: float
    slots_s: float
    busy_s: float
    driver_s: float | None
    peak_mib: float
    start_s: float
    same: bool
    load: float

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
        # Reading the memory of an engine with thirty processes is work by itself.
        while not self.over.wait(2.0):
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


def digests(out: Path) -> dict[str, str]:
    """What is compared of a run's files."""
    return {f: hashlib.sha256((out / f).read_bytes()).hexdigest() for f in FILES}


def run(name: str, workers: int, fleet: Path, out: Path, right: dict[str, str]) -> Way:
    """One way, from start to end; `right`: digests of the files that the first way made, none for the first."""
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
    same = digests(out) == (right or digests(out))
    seconds, busy_s, driver_s, slots = (b - a for a, b in zip(first, last))
    way = Way(name, workers, slots, whole, seconds, busy_s, driver_s, meter.peak_mib, pilots - begun, same, os.getloadavg()[1])
    print(way, flush=True)
    return way


def main() -> None:
    """Writes the page."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--slots", type=int, default=1000)
    words.add_argument("--engines", nargs="*", default=["local", "ray", "dask", "spark"])
    words.add_argument("--workers", nargs="*", type=int, default=[1, 2])
    words.add_argument("--again", action="store_true", help="measure rows that are known")
    asked = words.parse_args()
    os.environ.setdefault("RAY_worker_niceness", "0")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        fleet = fleet_file(folder, asked.slots, PILOTS)
        for workers in asked.workers:
            for name in ["fleet run", *asked.engines]:
                floor = floor_of(kept(), asked.slots)
                if asked.again or not any((way["name"], way["workers"]) == (name, workers) for way in floor["ways"]):
                    out = folder / f"{name}{workers}"
                    put(asked.slots, run(name, workers, fleet, out, floor["files"]), out)
                    shutil.rmtree(out, ignore_errors=True)


def put(slots: int, way: Way, out: Path) -> None:
    """A row onto the page; what another process measured meanwhile stays."""
    floors = kept()
    floor = floors[str(slots)] = floor_of(floors, slots)
    floor["ways"] = [w for w in floor["ways"] if (w["name"], w["workers"]) != (way.name, way.workers)] + [asdict(way)]
    floor["store"] = floor["store"] or (out / "fleet.db").stat().st_size
    floor["files"] = floor["files"] or digests(out)
    KEPT.write_text(json.dumps(floors, indent=1) + "\n")
    KEPT.with_suffix(".md").write_text("\n".join(page(floors)))


def floor_of(floors: dict[str, dict], slots: int) -> dict:
    """What is known of a floor's size."""
    return floors.get(str(slots), {"ways": [], "store": 0, "files": {}})


def kept() -> dict[str, dict]:
    """What was measured so far."""
    return json.loads(KEPT.read_text()) if KEPT.is_file() else {}


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
        "holds its object store. *Load*: of the machine, average of the last five minutes of the run; it has two cores, and above two a run shares them with other work.",
        f"*Files equal*: {', '.join(FILES)} by their SHA-256 those of the first row that was measured.",
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
    ways = sorted((Way(**w) for w in floor["ways"]), key=lambda way: (ORDER.index(way.name), way.workers))
    own = {way.workers: way for way in ways if way.name == "fleet run"}
    lines = [
        f"## {slots} slots",
        "",
        f"`python python/bench/floor.py --slots {slots} --engines {' '.join(e for e in ORDER[1:] if any(way.name == e for way in ways))}`, {os.cpu_count()} cores.",
        "",
        "| way | workers | slots/s | processor ms a slot | of these the driver | beside `fleet run` | whole run (s) | until the engine stands (s) | memory of all processes (MiB) | load | files equal |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for way in ways:
        fleet = way.name == "fleet run"
        beside = "" if fleet or way.workers not in own else f"{100 * (way.each_s() / own[way.workers].each_s() - 1):+.0f} %"
        driver = "" if fleet or way.driver_s is None else f"{1e3 * way.driver_s / way.slots:.1f}"
        lines.append(
            f"| {way.name} | {way.workers} | {way.slots / way.slots_s:.1f} | {1e3 * way.each_s():.1f} | {driver} | {beside} | {way.whole_s:.0f} | {way.start_s:.1f} "
            f"| {way.peak_mib:.0f} | {way.load:.0f} | {'yes' if way.same else '**no**'} |"
        )
    known = {(way.name, way.workers) for way in ways}
    left = [f"{name} on {workers}" for name in ORDER for workers in (1, 2) if (name, workers) not in known]
    return [*lines, "", *([f"Not measured at this size: {', '.join(left)}.", ""] if left else [])]


def million(slots: int, ways: list[Way], store: int) -> list[str]:
    """What the figures say of a million slots."""
    ray = next((way for way in ways if way.name == "ray" and way.workers == 2), None)
    own = next((way for way in ways if way.name == "fleet run" and way.workers == 2), None)
    if ray is None or own is None:
        return []
    many, machines, cores = 1_000_000, 100, 2
    each = ray.each_s()
    work = many * each / (machines * cores)
    row = store / slots
    rest = own.whole_s - own.slots_s
    driver = []
    if ray.driver_s is not None:
        own_s = ray.driver_s / ray.slots
        driver = [f"| the driver's own processor time | {1e3 * own_s:.2f} ms a slot, one core | {many * own_s / 60:.0f} min |"]
    return [
        "## A million slots on 100 machines, on paper",
        "",
        f"From the row of Ray on two workers over {slots} slots; machines like this one, nobody else on them. Nothing of it was run.",
        "",
        "| what | how | comes to |",
        "|---|---|---:|",
        f"| work on slots | {1e3 * each:.1f} ms of a processor a slot, {machines * cores} cores | {work / 60:.0f} min |",
        f"| rows to the driver | {row / 1024:.1f} KiB a slot in the store | {many * row / 2**30:.1f} GiB |",
        *driver,
        f"| their rate | over that time, one driver that adds {machines * cores / each:.0f} rows/s | {many * row / work / 2**20:.0f} MiB/s |",
        f"| pilots, library, explanations, shared tables, files | as they are here on one driver; they grow by the slots served, see `fleet_scale.md` | {rest:.0f} s for {slots} |",
        "",
        "What limits it: the driver, not the workers: the run lasts as long as the longest line. Engines also spend time on the driver by the second, busy or not; it is not told apart "
        "from what a slot costs, and counts the more the slower the workers are. The driver parses and stores every row, and the end of the run (shared tables, CSV) is one process that reads the store once; "
        "results/fleet_scale.md has the time of that end and the store's own limit. More machines than keep the driver's rate of rows below that limit do not help.",
        "",
    ]


if __name__ == "__main__":
    main()
