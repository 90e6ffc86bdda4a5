"""Makes results/python_kills.md: `python python/bench/kills.py` with the package, its engines and the program at hand.

A floor is run again and again while workers of its engine are killed (SIGKILL) at random instants, until there were as many kills as asked. On Ray whole nodes are
killed too. Every run must end with the rows and the files of a `servotune fleet run` that nobody disturbed. `--engines ray dask spark`, `--kills 50`, `--nodes 10`.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sqlite3
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

from machine import ROOT, busy, children, fleet_file, program

from servotune import floor

SLOTS = 256
#: Files that say nothing of the time of the run.
FILES = ("slots.csv", "slots.jsonl", "coverage.csv", "shared.json", "work_list.csv", "untunable.json")


def workers(engine: str) -> list[int]:
    """Processes that work on slots for this one."""
    found = children(os.getpid())
    if engine == "ray":
        # A worker of Ray names what it works on.
        return [pid for pid, _, words in found if words.startswith("ray::") and "work" in words]
    if engine == "spark":
        # The daemon forks its workers, which keep its name.
        family = {pid for pid, _, words in found if "pyspark.daemon" in words}
        return [pid for pid, parent, _ in found if pid in family and parent in family]
    from distributed import default_client

    # Those that have joined: Dask gives a place up whose process dies while it starts.
    client = default_client()
    try:
        return list(client.sync(client._run, os.getpid, on_error="ignore", callback_timeout=5).values())
    except TimeoutError:
        # It asked one that had just been killed.
        return []


class Killer(threading.Thread):
    """Kills a worker, waits a random while, kills again."""

    def __init__(self, engine: str, left: int, seed: int) -> None:
        super().__init__(daemon=True)
        self.engine, self.left, self.kills = engine, left, 0
        self.random, self.over = random.Random(seed), threading.Event()

    def run(self) -> None:
        while self.kills < self.left and not self.over.wait(self.random.uniform(0.2, 3.0)):
            there = workers(self.engine)
            if not there or self.over.is_set():
                continue
            try:
                os.kill(self.random.choice(there), signal.SIGKILL)
                self.kills += 1
                print("killed", self.kills, flush=True)
            except ProcessLookupError:
                # It had just ended by itself.
                continue


def rows(folder: Path) -> list[tuple]:
    """Rows of the store."""
    with sqlite3.connect(folder / "fleet.db") as store:
        return store.execute("SELECT place, slot, digest, verdict, row FROM slots ORDER BY place").fetchall()


class Count:
    """What became of the runs of an engine."""

    def __init__(self) -> None:
        self.runs = self.kills = self.lost = self.doubled = self.other_rows = self.other_files = 0
        self.seconds = 0.0

    def add(self, found: Path, alone: Path, kills: int, seconds: float) -> None:
        """One run beside the undisturbed one."""
        ours, right = rows(found), rows(alone)
        places = [row[0] for row in ours]
        self.runs += 1
        self.kills += kills
        self.seconds += seconds
        self.lost += len({row[0] for row in right} - set(places))
        self.doubled += len(places) - len(set(places))
        self.other_rows += ours != right
        self.other_files += any((found / f).read_bytes() != (alone / f).read_bytes() for f in FILES)

    def line(self, what: str) -> str:
        """As a row of the table."""
        counts = (self.kills, self.runs, self.lost, self.doubled, self.other_rows, self.other_files)
        return f"| {what} | " + " | ".join(map(str, counts)) + f" | {self.seconds / max(self.runs, 1):.0f} |"


def killed_workers(engine: str, kills: int, fleet: Path, alone: Path, folder: Path) -> Count:
    """Runs on two workers that are killed one after the other."""
    count = Count()
    while count.kills < kills:
        killer, out, begun = (
            Killer(engine, kills - count.kills, count.runs),
            folder / f"{engine}{count.runs}",
            time.time(),
        )

        def said(words: str, killer: Killer = killer) -> None:
            # An engine that cannot start is not what is looked at.
            if words.endswith("left") and words.startswith("slots"):
                killer.start()

        floor.run(fleet, engine=engine, out=out, name="one", workers=2, batch=4, pages=0, said=said)
        killer.over.set()
        killer.join(30)
        count.add(out, alone, killer.kills, time.time() - begun)
        print(engine, count.line(""), flush=True)
    return count


def lost_nodes(losses: int, fleet: Path, alone: Path, folder: Path) -> Count:
    """Runs on a cluster of two nodes of one worker; one is killed, its processes and its objects with it, and another one comes."""
    import ray
    from ray.cluster_utils import Cluster

    count, chance = Count(), random.Random(1)
    while count.kills < losses:
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": 200_000_000})
        node = {"num_cpus": 1, "object_store_memory": 200_000_000}
        nodes = [cluster.add_node(**node) for _ in range(2)]
        ray.init(address=cluster.address, log_to_driver=False)
        out, begun, lost = folder / f"node{count.runs}", time.time(), 0

        with ThreadPoolExecutor(1) as pool:
            # Nodes are added by the main thread only.
            ran = pool.submit(floor.run, fleet, engine="ray", out=out, name="one", batch=4, pages=0)
            while not wait([ran], chance.uniform(6.0, 14.0)).done and count.kills + lost < losses:
                cluster.remove_node(nodes.pop(0), allow_graceful=False)
                nodes.append(cluster.add_node(**node))
                lost += 1
            ran.result()
        count.add(out, alone, lost, time.time() - begun)
        ray.shutdown()
        cluster.shutdown()
        print("node", count.line(""), flush=True)
    return count


def main() -> None:
    """Writes the page."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--engines", nargs="*", default=["ray", "dask", "spark"])
    words.add_argument("--kills", type=int, default=50)
    words.add_argument("--nodes", type=int, default=10)
    asked = words.parse_args()
    # Ray's own workers stand back behind everything else on a machine.
    os.environ.setdefault("RAY_worker_niceness", "0")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        fleet, alone = fleet_file(folder, SLOTS, pilots=2), folder / "alone"
        program("fleet", "run", fleet, "--out", alone, "--run", "one")
        for engine in asked.engines:
            put(f"a worker of {engine}", killed_workers(engine, asked.kills, fleet, alone, folder))
        if asked.nodes:
            put("a node of ray", lost_nodes(asked.nodes, fleet, alone, folder))


def put(what: str, count: Count) -> None:
    """Writes a row of the page; the rows of what was not killed this time stay."""
    file = ROOT / "results/python_kills.md"
    before = file.read_text().splitlines() if file.exists() else []
    rows = {line.split(" | ")[0]: line for line in before if line.startswith("| a ")}
    rows[f"| {what}"] = count.line(what)
    page = [
        "# Killed workers and lost nodes",
        "",
        f"Made by `python python/bench/kills.py`. A floor of {SLOTS} made-up slots on two workers, batches of 4; once the slots have begun a worker that is at work is killed by",
        "SIGKILL 0.2 to 3 s after the one before, whichever it hits. A node is one of two, killed with its worker and its objects 6 to 14 s after the one before; another one",
        f"comes in its place. Every run that ended is held against one `servotune fleet run` that nobody disturbed. {busy()}",
        "",
        "| killed | kills | runs | slots lost | slots doubled | runs with other rows | runs with other files | seconds a run |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
        *rows.values(),
        "",
        f"Rows: place, slot, digest, verdict and the row itself, byte by byte. Files: {', '.join(FILES)}, byte by byte.",
        "A row that cannot be read, or that stops this program, is a row `failed` with its words; a slot that ends its worker's process every time is given up after ten",
        "tries, and the others are kept (`python/tests/test_floor.py`).",
        "",
    ]
    file.write_text("\n".join(page))


if __name__ == "__main__":
    main()
