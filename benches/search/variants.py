"""The same specs asked in other ways: other seeds, fewer and more starts, limits in another order, the position in another unit.

    python variants.py --program target/release/servotune [--count 24]       writes results/search_variants.md

What comes out must be the same within 2 % in the objective; every table is judged in the original units.
"""

from __future__ import annotations

import argparse
import copy
import dataclasses
import json
import math
import os
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import judge
import law as laws
import machines
import page
import run
import toml_text

UNIT = 1000.0
"""So many of the new unit make one of the old: um for mm."""


def in_other_unit(text: str, spec: dict, profile: dict | None) -> tuple[str, dict, dict | None]:
    """Plant, spec and profile with the position in the new unit."""
    scale = lambda m: f"{m.group(1)} = {float(m.group(2)) * UNIT!r}"  # noqa: E731
    text = re.sub(r"^(dc_gain|acceleration_gain|gain) *= *([-+0-9.eE_]+)", scale, text, flags=re.M)
    s, p = copy.deepcopy(spec), copy.deepcopy(profile)
    for key in ("kp", "ki_per_s", "kd_s"):
        if key in s.get("search", {}).get("bounds", {}):
            s["search"]["bounds"][key] = [v / UNIT for v in s["search"]["bounds"][key]]
    limits, db = s.get("limits", {}), 20 * math.log10(UNIT)
    for key in ("dft_low", "dft_high"):
        if key in limits:
            limits[key] *= UNIT
    for h in limits.get("harmonics", []):
        h["amplitude"] *= UNIT
    for c in limits.get("curve", []):
        c["db"] = [d + {"PS": db, "CS": -db}.get(c["of"], 0.0) for d in c["db"]]
    if p:
        for key in ("velocity", "distance"):
            p["spiral"][key] *= UNIT
        if "encoder_rms" in p.get("noise", {}):
            p["noise"]["encoder_rms"] *= UNIT
    return text, s, p


def reversed_order(spec: dict) -> dict:
    """The limits the other way round, curves too."""
    s = copy.deepcopy(spec)
    for table in ("margins", "limits"):
        if table in s:
            s[table] = dict(reversed(s[table].items()))
    if "curve" in s.get("limits", {}):
        s["limits"]["curve"] = s["limits"]["curve"][::-1]
    return s


def ways(text: str, spec: dict, profile: dict | None) -> dict[str, tuple[str, dict, dict | None, list[str]]]:
    """Every way to ask: plant, spec, profile, words."""
    seeded = lambda n: {**spec, "search": {**spec["search"], "seed": n}}  # noqa: E731
    return {
        "as it is": (text, spec, profile, []),
        "seed 2": (text, seeded(2), profile, []),
        "seed 3": (text, seeded(3), profile, []),
        "4 starts": (text, spec, profile, ["--starts", "4"]),
        "60 starts": (text, spec, profile, ["--starts", "60"]),
        "limits reversed": (text, reversed_order(spec), profile, []),
        "other unit": (*in_other_unit(text, spec, profile), []),
    }


def asked(
    program: str, folder: Path, way: str, job: tuple[str, dict, dict | None, list[str]]
) -> tuple[laws.Law | None, str]:
    """The table in the original units, and what was said where there is none."""
    text, spec, profile, words = job
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    (folder / "spec.toml").write_text(toml_text.text(spec), encoding="utf-8")
    if profile:
        (folder / "profile.toml").write_text(toml_text.text(profile), encoding="utf-8")
    table = folder / "gains.toml"
    table.unlink(missing_ok=True)
    line = [
        program,
        "tune",
        "--json",
        "--plant",
        str(folder / "plant.toml"),
        "--spec",
        str(folder / "spec.toml"),
        "--out",
        str(table),
        "--no-certificate",
    ]
    done = subprocess.run(line + words, capture_output=True, text=True, check=False, timeout=300)
    if not table.exists():
        return None, "refused" if done.returncode == 2 else "infeasible"
    law = laws.read(table)
    if way == "other unit":
        law = dataclasses.replace(law, kp=law.kp * UNIT, ki_per_s=law.ki_per_s * UNIT, kd_s=law.kd_s * UNIT)
    return law, ""


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--folder", type=Path, default=machines.ROOT / "target/search")
    a.add_argument("--program", default=str(machines.ROOT / "target/release/servotune"))
    a.add_argument("--count", type=int, default=24)
    w = a.parse_args()
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    judges = run.Judges(w.folder)
    names = run.specs_of(w.folder, "r", False, "")
    names = names[3 :: max(len(names) // w.count, 1)][: w.count]
    rows, heads, apart = [], [], []
    for name in names:
        here = w.folder / "specs" / name
        meta, (spec, profile) = json.loads((here / "meta.json").read_text()), judge.read_spec(here / "spec.toml")
        text = (w.folder / f"machines/{meta['machine']}.toml").read_text()
        jobs = ways(text, spec, profile)
        heads = list(jobs)
        with ThreadPoolExecutor(2) as pool:
            found = dict(
                zip(
                    jobs,
                    pool.map(
                        lambda k: asked(w.program, w.folder / "variants" / f"{name}_{k.replace(' ', '_')}", k, jobs[k]),
                        jobs,
                    ),
                )
            )
        values = {}
        for way, (law, _) in found.items():
            j = judges.judge(meta["machine"], spec, profile, law) if law else None
            values[way] = j.objective if j and j.worst <= run.MET else math.inf
        best = min(values.values())
        gaps = {
            k: page.behind(v, best, judge.objective_name(spec)) if v < math.inf else math.inf for k, v in values.items()
        }
        apart.append(max(gaps.values()) if best < math.inf else 0.0)
        cells = [found[k][1] or page.percent(gaps[k]) for k in jobs]
        rows.append(f"| {name} | {meta['machine']} | {judge.objective_name(spec)} | " + " | ".join(cells) + " |")
        print(rows[-1], flush=True)
    same = sum(x <= page.NEAR for x in apart)
    lines = [
        "# Search: the same, asked in other ways",
        "",
        "Made by `python benches/search/variants.py`. How far each answer is behind the best of its row, judged in the original units.",
        "",
        f"All ways within 2 %: {same} of {len(rows)} specs.",
        "",
        "| spec | machine | objective | " + " | ".join(heads) + " |",
        "|---" * (len(heads) + 3) + "|",
    ]
    (machines.ROOT / "results/search_variants.md").write_text("\n".join(lines + rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
