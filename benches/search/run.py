"""Tunes every spec, judges every table, and writes the page.

    python run.py --program target/release/servotune [--starts N] [--seed N] [--only PREFIX] [--unseen]
    python run.py --before PATH              the program of before, on what the first edition can say
    python run.py --reference --starts 1200 --seeds 1,2,3     many times the work; the best ever found is kept in reference.json
    python run.py --page                     the reference and the page again from the runs that were kept

Tables stay in target/search/tables/LABEL/ID.toml, outcomes in target/search/runs/LABEL.json.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import tempfile
import threading
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import first_edition
import judge
import law as laws
import machines
import page
import plant as plants
import toml_text

HERE = Path(__file__).resolve().parent
REFERENCE = HERE / "reference.json"
MET = 1e-4
"""The judge's own figures and the program's may differ by rounding of their grids; a table counts as meeting its limits within this."""


LONGEST_S = 300.0
"""A run that takes longer counts as broken."""


class Judges:
    """One bench a machine, made when first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._kept = folder, {}

    def judge(self, machine: str, spec: dict, profile: dict | None, law: laws.Law) -> judge.Judged:
        key = (machine, law.sample_time_s)
        if key not in self._kept:
            self._kept[key] = judge.Bench(plants.read(self.folder / f"machines/{machine}.toml"), law.sample_time_s)
        return judge.judge(self._kept[key], spec, profile, law)


def specs_of(folder: Path, only: str, unseen: bool, on: str) -> list[str]:
    """Names of specs that begin with one of the words of `only`, on machines that begin with one of the words of `on`."""
    names = sorted(p.name for p in (folder / "specs").iterdir() if p.is_dir())
    names = [
        n
        for n in names
        if n.startswith(tuple(only.split(","))) and n.startswith("u") == unseen and n.startswith("p_") == only.startswith("p_")
    ]
    machine = lambda n: json.loads((folder / "specs" / n / "meta.json").read_text())["machine"]  # noqa: E731
    return [n for n in names if machine(n).startswith(tuple(on.split(",")))]


def timed(line: list[str]) -> tuple[int, float, str, str]:
    """Exit code (negative where it was stopped), processor time, and both outputs: on a shared machine only processor time says something."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = subprocess.Popen(line, stdout=out, stderr=err)
        stop = threading.Timer(LONGEST_S, child.kill)
        stop.start()
        _, status, usage = os.wait4(child.pid, 0)
        stop.cancel()
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        return child.returncode, usage.ru_utime + usage.ru_stime, out.read(), err.read()


def tune(
    program: str, folder: Path, name: str, label: str, words: list[str], before: bool, seed: int | None
) -> dict | None:
    """One run of the program: exit code, verdict, objective as it says, wall time."""
    here, table = folder / "specs" / name, folder / "tables" / label / f"{name}.toml"
    table.parent.mkdir(parents=True, exist_ok=True)
    table.unlink(missing_ok=True)
    meta = json.loads((here / "meta.json").read_text())
    spec, _ = judge.read_spec(here / "spec.toml")
    path = here / "spec.toml"
    if before:
        text = first_edition.translated(spec)
        if text is None or not meta.get("first_edition"):
            return None
        path = here / "first_edition.toml"
        path.write_text(text, encoding="utf-8")
    if seed is not None:
        path = here / f"seed_{seed}.toml"
        document = tomllib.loads(text) if before else spec
        path.write_text(toml_text.text({**document, "search": {**document["search"], "seed": seed}}), encoding="utf-8")
    plant = f"machines/{'before/' if before else ''}{meta['machine']}.toml"
    line = [program, "tune", "--json", "--plant", str(folder / plant), "--spec", str(path), "--out", str(table)]
    # Over a box the program proves what it writes.
    line += words if "--uncertainty" in words else ["--no-certificate", *words]
    if before:
        line += ["--sample-time-s", repr(spec["sample_time_s"])]
    began = time.perf_counter()
    code, used, stdout, stderr = timed(line)
    out = {"id": name, "seed": seed, "code": code, "time_s": time.perf_counter() - began, "processor_s": used}
    if code < 0:
        return {**out, "error": "timeout"}
    try:
        said = json.loads(stdout)
    except json.JSONDecodeError:
        return {**out, "error": (stderr.strip().splitlines() or ["no document"])[-1][:300]}
    out["verdict"] = said.get("verdict")
    if isinstance(said.get("objective"), dict):
        out["said"] = {k: said["objective"].get(k) for k in ("value", "lower_bound", "starts", "starts_at_best")}
    if "work" in said:
        out["evaluations"] = said["work"].get("evaluations")
    return out


def judged(judges: Judges, folder: Path, label: str, outcome: dict) -> dict:
    """The outcome with the judge's figures of its table."""
    name = outcome["id"]
    table = folder / "tables" / label / f"{name}.toml"
    if not table.exists():
        return outcome
    here = folder / "specs" / name
    meta, (spec, profile) = json.loads((here / "meta.json").read_text()), judge.read_spec(here / "spec.toml")
    try:
        found = judges.judge(meta["machine"], spec, profile, laws.read(table))
    except ValueError as e:
        return {**outcome, "error": f"the table cannot be judged: {e}"}
    worst = max(found.violations, key=found.violations.get, default="")
    return {
        **outcome,
        "objective": found.objective if found.stable else None,
        "worst": found.worst if found.stable else None,
        "worst_of": worst,
        "stable": found.stable,
    }


def update_reference(folder: Path, outcomes: list[dict], source: str) -> int:
    """The best feasible objective of each spec, from tables that the judge finds to meet every limit."""
    known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
    better, known_ids = 0, {p.name for p in (folder / "specs").iterdir()}
    for o in outcomes:
        if (
            o["id"] not in known_ids
            or o.get("objective") is None
            or o["worst"] > MET
            or not math.isfinite(o["objective"])
        ):
            continue
        digest = json.loads((folder / "specs" / o["id"] / "meta.json").read_text())["digest"]
        old = known.get(o["id"])
        if old is None or old["digest"] != digest or o["objective"] < old["objective"] - 1e-9 * abs(old["objective"]):
            known[o["id"]] = {"objective": o["objective"], "source": source, "digest": digest}
            better += 1
    digests = {n: json.loads((folder / "specs" / n / "meta.json").read_text())["digest"] for n in known_ids}
    known = {k: v for k, v in known.items() if digests.get(k, v["digest"]) == v["digest"]}
    _along_chains(folder, known)
    REFERENCE.write_text(
        "{\n" + ",\n".join(f' "{k}": {json.dumps(known[k])}' for k in sorted(known)) + "\n}\n", encoding="utf-8"
    )
    return better


def _along_chains(folder: Path, known: dict) -> None:
    """A table that meets a tighter step meets every looser one: its objective is known there too, unless it is the room itself."""
    chains: dict[str, list] = {}
    for p in sorted((folder / "specs").iterdir()):
        meta = json.loads((p / "meta.json").read_text())
        if meta["kind"] == "chain" and judge.objective_name(judge.read_spec(p / "spec.toml")[0]) != "room":
            chains.setdefault(meta["chain"], []).append((meta["step"], p.name, meta["digest"]))
    for steps in chains.values():
        best = None
        for _, name, digest in sorted(steps):
            own = known.get(name)
            own = own if own and own["digest"] == digest else None
            if best and (own is None or best["objective"] < own["objective"]):
                known[name] = own = {
                    "objective": best["objective"],
                    "source": best["source"].split(" at ")[0] + f" at {best['id']}",
                    "digest": digest,
                }
            if own and (best is None or own["objective"] < best["objective"]):
                best = {**own, "id": name}


def keep(file: Path, outcomes: list[dict]) -> None:
    """Adds to what the file holds of other specs and seeds, so that a run can go on where it was stopped."""
    fresh = {(o["id"], o["seed"]) for o in outcomes}
    old = [o for o in json.loads(file.read_text()) if (o["id"], o["seed"]) not in fresh] if file.exists() else []
    whole = file.with_suffix(".part")
    whole.write_text(json.dumps(sorted(old + outcomes, key=lambda o: o["id"]), indent=1), encoding="utf-8")
    whole.rename(file)


def witnesses(folder: Path, names: list[str]) -> list[dict]:
    """The controllers from which the specs were made, as outcomes; not those whose command peak was limited without a look at its noise."""
    out = []
    for name in names:
        meta = json.loads((folder / "specs" / name / "meta.json").read_text())
        limited = "command_peak" in judge.read_spec(folder / "specs" / name / "spec.toml")[0].get("limits", {})
        if "witness" in meta and not limited:
            out.append({"id": name, "objective": meta["witness_objective"], "worst": 0.0})
    return out


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--folder", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--program", default=str(machines.ROOT / "target/release/servotune"))
    a.add_argument("--before", default=None)
    a.add_argument("--starts", type=int)
    a.add_argument("--seeds", default="")
    a.add_argument("--label", default=None)
    a.add_argument("--only", default="")
    a.add_argument(
        "--on", default="", help="only machines whose names begin with one of these words, comma between them"
    )
    a.add_argument("--every", type=int, default=1, help="only one spec in so many")
    a.add_argument("--unseen", action="store_true")
    a.add_argument("--reference", action="store_true")
    a.add_argument("--page", action="store_true")
    a.add_argument("--words", default="", help="further words for the program")
    a.add_argument("--parallel", type=int, default=2)
    w = a.parse_args()
    names = specs_of(w.folder, w.only, w.unseen, w.on)[:: w.every]
    label = w.label or ("before" if w.before else "reference" if w.reference else "now")
    runs = w.folder / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    if not w.page:
        os.environ.setdefault("RAYON_NUM_THREADS", "1")
        judges, outcomes = Judges(w.folder), []
        words = (["--starts", str(w.starts)] if w.starts else []) + w.words.split()
        for seed in w.seeds.split(",") if w.seeds else [""]:

            def one(name: str) -> dict | None:
                return tune(
                    w.before or w.program,
                    w.folder,
                    name,
                    label + seed,
                    words,
                    bool(w.before),
                    int(seed) if seed else None,
                )

            with ThreadPoolExecutor(w.parallel) as pool:
                for o in pool.map(one, names):
                    if o is not None:
                        outcomes.append(judged(judges, w.folder, label + seed, o))
                        keep(runs / f"{label}.json", outcomes)
        better = update_reference(w.folder, outcomes, label)
        update_reference(w.folder, witnesses(w.folder, names), "witness")
        print(f"{len(outcomes)} outcomes, {better} of the reference better than before")
    else:
        kept = [(p.stem, json.loads(p.read_text())) for p in sorted(runs.glob("*.json"))]
        print(
            sum(update_reference(w.folder, outcomes, label) for label, outcomes in kept),
            "of the reference better than before",
        )
        update_reference(w.folder, witnesses(w.folder, names), "witness")
    page.write(w.folder, REFERENCE, machines.ROOT / "results/search.md", MET)


if __name__ == "__main__":
    main()
