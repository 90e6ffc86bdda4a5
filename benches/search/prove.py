"""Tables tuned over a box of gain and delay: how many `verify` proves, and what the judge finds at the box's corners.

python run.py --words "--uncertainty gain=5%,delay=5%" --label boxed --parallel 2
python prove.py [--tables boxed] [--count 200]            writes results/search_proofs.md
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import subprocess
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import judge
import law as laws
import machines
import plant as plants
import run

BOX = "gain=5%,delay=5%"


def scaled(p: plants.Plant, gain: float, delay: float) -> plants.Plant:
    """The same plant with another gain and delay."""
    return dataclasses.replace(
        p,
        pairs=tuple((q, r * gain) for q, r in p.pairs),
        reals=tuple((q, r * gain) for q, r in p.reals),
        double=p.double * gain,
        single=p.single * gain,
        delay_s=p.delay_s * delay,
    )


def corners(folder: Path, name: str, table: Path) -> tuple[float, str]:
    """The judge's largest violation over the box's corners, and the limit it belongs to. The objective has no limit and is left out."""
    here = folder / "specs" / name
    meta, (spec, profile) = json.loads((here / "meta.json").read_text()), judge.read_spec(here / "spec.toml")
    spec = {**spec, "objective": {**spec.get("objective", {}), "minimise": "bandwidth"}}
    p, law = plants.read(folder / f"machines/{meta['machine']}.toml"), laws.read(table)
    worst, what = -np.inf, ""
    for gain in (0.95, 1.05):
        for delay in (0.95, 1.05):
            found = judge.judge(judge.Bench(scaled(p, gain, delay), law.sample_time_s, 30_000), spec, profile, law)
            if found.worst > worst:
                worst = found.worst
                what = (
                    max(found.violations, key=found.violations.get, default="unstable") if found.stable else "unstable"
                )
    return float(worst), what


def verify(program: str, folder: Path, name: str, kept: Path) -> dict:
    """The verdict on the table alone: a certificate beside it, of whatever build tuned it, is not looked at."""
    with tempfile.TemporaryDirectory() as alone:
        table = Path(alone) / kept.name
        table.write_bytes(kept.read_bytes())
        return _verify(program, folder, name, table)


def _verify(program: str, folder: Path, name: str, table: Path) -> dict:
    meta = json.loads((folder / "specs" / name / "meta.json").read_text())
    line = [program, "verify", "--json", str(table), "--plant", str(folder / f"machines/{meta['machine']}.toml")]
    line += ["--spec", str(folder / "specs" / name / "spec.toml"), "--uncertainty", BOX]
    began = time.perf_counter()
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=300)
    out = {
        "id": name,
        "machine": meta["machine"],
        "kind": meta["machine_kind"],
        "code": done.returncode,
        "time_s": time.perf_counter() - began,
    }
    if done.returncode == 2:
        out["error"] = (done.stderr.strip().splitlines() or ["nothing said"])[-1][:200]
    try:
        said = json.loads(done.stdout)
        out["lacks"] = [
            f"{l['name']}: {l['verdict'].replace('_', ' ')}, at most {high:.5g} proved, {l['required']:.5g} asked for"
            if l["side"] == "at_most" and (high := l["proven"].get("high")) is not None
            else f"{l['name']}: {l['verdict'].replace('_', ' ')}"
            for case in said["cases"]
            for l in case["limits"]
            if l["verdict"] != "proved"
        ]
    except json.JSONDecodeError:
        pass
    return out


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--folder", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--program", default=str(machines.ROOT / "target/release/servotune"))
    a.add_argument("--tables", default="boxed")
    a.add_argument("--count", type=int, default=200)
    w = a.parse_args()
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    outcomes = json.loads((w.folder / "runs" / f"{w.tables}.json").read_text())
    names = sorted(o["id"] for o in outcomes if o.get("verdict") == "tuned")[: w.count]
    refused = Counter(o.get("verdict", "stopped after 300 s") for o in outcomes if o.get("verdict") != "tuned")
    with ThreadPoolExecutor(2) as pool:
        rows = list(
            pool.map(lambda n: verify(w.program, w.folder, n, w.folder / "tables" / w.tables / f"{n}.toml"), names)
        )
    for row in rows:
        row["corner"], row["corner_of"] = corners(
            w.folder, row["id"], w.folder / "tables" / w.tables / f"{row['id']}.toml"
        )
    proved = [r for r in rows if r["code"] == 0]
    wrong = [r for r in proved if r["corner"] > run.MET]
    per = Counter(r["kind"] for r in rows)
    lines = [
        "# Search: tables proved over a box",
        "",
        f'Made by `python benches/search/run.py --words "--uncertainty {BOX}" --label boxed` and `python benches/search/prove.py --count {w.count}`: `servotune verify',
        f"--uncertainty {BOX}` of {len(rows)} tables, each tuned over the same box and said to meet its limits; beside it the judge at the four corners of the box.",
        "",
        f"Proved: {len(proved)} of {len(rows)}. Proved, yet a limit fails at a corner by the judge: {len(wrong)}"
        + (f" ({', '.join(r['id'] for r in wrong[:10])})." if wrong else "."),
        "",
    ]
    if refused:
        said = ", ".join(f"{n} {v}" for v, n in sorted(refused.items()))
        lines += [f"Of {len(outcomes)} specs tuned over the box the others came to no such table: {said}.", ""]
    if rows:
        lines += [
            f"Time of a proof: median {np.median([r['time_s'] for r in rows]):.2f} s, longest {max(r['time_s'] for r in rows):.2f} s.",
            "",
        ]
    lines += ["| kind of machine | tables | proved |", "|---|---|---|"]
    lines += [f"| {k} | {n} | {sum(r['kind'] == k for r in proved)} |" for k, n in sorted(per.items())]
    short = [r for r in rows if r["code"] != 0]
    if short:
        lines += [
            "",
            "| not proved | machine | what lacks | worst at a corner, by the judge |",
            "|---|---|---|---|",
        ]
        lines += [
            f"| {r['id']} | {r['machine']} | {r.get('error') or '; '.join(r.get('lacks', []))} | {r['corner_of']} {r['corner']:+.2e} |"
            for r in short
        ]
    (machines.ROOT / "results/search_proofs.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(lines[5])


if __name__ == "__main__":
    main()
