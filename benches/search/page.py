"""results/search.md from the outcomes that were kept and the reference."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path

import numpy as np

NEAR, LOOSER = 0.02, 0.01


def behind(objective: float, best: float, name: str) -> float:
    """How far an objective is behind the best, as a share of it; of a room, the difference in share of the limit."""
    return objective - best if name == "room" else objective / best - 1


class Kept:
    """Specs, outcomes of one label, and the reference."""

    def __init__(self, folder: Path, reference: Path, met: float) -> None:
        import judge

        self.met, self.meta, self.objective = met, {}, {}
        for p in sorted((folder / "specs").iterdir()):
            if (p / "meta.json").exists():
                self.meta[p.name] = json.loads((p / "meta.json").read_text())
                self.objective[p.name] = judge.objective_name(judge.read_spec(p / "spec.toml")[0])
        known = json.loads(reference.read_text()) if reference.exists() else {}
        self.best = {
            k: v["objective"] for k, v in known.items() if k in self.meta and v["digest"] == self.meta[k]["digest"]
        }

    def feasible(self, o: dict) -> bool:
        return o.get("objective") is not None and o["worst"] <= self.met

    def gap(self, o: dict) -> float:
        """Behind the best known; infinite without a table that meets its limits."""
        return behind(o["objective"], self.best[o["id"]], self.objective[o["id"]]) if self.feasible(o) else math.inf

    def summary(self, outcomes: list[dict]) -> dict:
        judged = [o for o in outcomes if o["id"] in self.best]
        gaps = {o["id"]: self.gap(o) for o in judged}
        finite = [g for g in gaps.values() if math.isfinite(g)]
        said_met = [o for o in outcomes if o.get("verdict") in ("tuned", "tuned_without_guard")]
        return {
            "specs": len(outcomes),
            "feasible": len(judged),
            "near": sum(g <= NEAR for g in gaps.values()),
            "worst": max(finite, default=math.nan),
            "worst_id": max((k for k in gaps if math.isfinite(gaps[k])), key=lambda k: gaps[k], default=""),
            "no_table": sum(not math.isfinite(g) for g in gaps.values()),
            "false_infeasible": sorted(o["id"] for o in judged if o.get("verdict") == "infeasible"),
            "false_met": sorted(o["id"] for o in said_met if o.get("worst") is None or o["worst"] > self.met),
            "false_feasible": sorted(
                o["id"] for o in said_met if self.meta[o["id"]]["kind"] == "infeasible" and self.feasible(o)
            ),
            "errors": sorted(o["id"] for o in outcomes if o.get("error")),
            "times": [o["time_s"] for o in outcomes],
            "processor": [o["processor_s"] for o in outcomes if "processor_s" in o],
        }

    def chains(self, outcomes: list[dict]) -> tuple[int, int, float, str]:
        """Steps compared, steps at which a looser limit gave a worse objective by more than 1 % (or none), the largest such, its chain."""
        rows = defaultdict(list)
        for o in outcomes:
            m = self.meta[o["id"]]
            if m["kind"] == "chain":
                rows[m["chain"]].append((m["step"], o))
        steps = bad = 0
        worst, where = 0.0, ""
        for chain, found in rows.items():
            best = math.inf
            for _, o in sorted(found, key=lambda x: x[0]):
                value = o["objective"] if self.feasible(o) else math.inf
                if best < math.inf:
                    steps += 1
                    by = behind(value, best, self.objective[o["id"]]) if value < math.inf else math.inf
                    if by > LOOSER:
                        bad += 1
                    if by > worst:
                        worst, where = by, chain
                best = min(best, value)
        return steps, bad, worst, where


def percent(x: float) -> str:
    return "no table" if math.isinf(x) else "-" if math.isnan(x) else f"{100 * x:.2f} %"


def listed(ids: list[str]) -> str:
    return "0" if not ids else f"{len(ids)} ({', '.join(ids[:12])}{', ...' if len(ids) > 12 else ''})"


def write(folder: Path, reference: Path, page: Path, met: float) -> None:
    kept, runs = Kept(folder, reference, met), {}
    for p in sorted((folder / "runs").glob("*.json")):
        runs[p.stem] = [o for o in json.loads(p.read_text()) if o["id"] in kept.meta]
    columns = {name: runs[name] for name in ("before", "now", "unseen") if name in runs}
    if "before" in columns and "now" in columns:
        ids = {o["id"] for o in columns["before"]}
        columns = {
            "before": columns["before"],
            "now, the same specs": [o for o in columns["now"] if o["id"] in ids],
            **{k: v for k, v in columns.items() if k != "before"},
        }
    if not columns:
        return
    s = {name: kept.summary(o) for name, o in columns.items()}
    c = {name: kept.chains(o) for name, o in columns.items()}
    seconds = lambda t, q: f"{np.quantile(t, q):.2f} s" if t else "-"  # noqa: E731
    rows = [
        ("specs", lambda n: s[n]["specs"]),
        ("of them known to be feasible", lambda n: s[n]["feasible"]),
        (
            "within 2 % of the best known",
            lambda n: f"{s[n]['near']} ({100 * s[n]['near'] / max(s[n]['feasible'], 1):.1f} %)",
        ),
        ("farthest behind, of tables that meet their limits", lambda n: f"{percent(s[n]['worst'])} {s[n]['worst_id']}"),
        ("no table that meets its limits", lambda n: s[n]["no_table"]),
        ('false "infeasible"', lambda n: listed(s[n]["false_infeasible"])),
        ("said to meet every limit, does not by the judge", lambda n: listed(s[n]["false_met"])),
        ("met, though an argument says it cannot be", lambda n: listed(s[n]["false_feasible"])),
        ("refused or broken", lambda n: listed(s[n]["errors"])),
        ("steps to a looser limit", lambda n: c[n][0]),
        ("of them worse by more than 1 %", lambda n: c[n][1]),
        ("largest such step", lambda n: f"{percent(c[n][2])} {c[n][3]}"),
        ("processor time, median", lambda n: seconds(s[n]["processor"], 0.5)),
        ("processor time, 90 % below", lambda n: seconds(s[n]["processor"], 0.9)),
        ("processor time, longest", lambda n: seconds(s[n]["processor"], 1.0)),
        ("time, median", lambda n: seconds(s[n]["times"], 0.5)),
        ("time, 90 % below", lambda n: seconds(s[n]["times"], 0.9)),
        ("time, longest", lambda n: seconds(s[n]["times"], 1.0)),
    ]
    lines = ["# Search: three hundred specs", ""]
    lines += [
        "Made by `python benches/search/run.py` (see `benches/search/README.md`). Objectives and limits are the judge's (`judge.py`), which shares no code",
        f"with the program; a table counts as meeting its limits within {met:g} of each. Best known: the least objective of any table that does, ever found, from",
        "`benches/search/reference.json`. Of the objective `room` the difference of the rooms counts. Times are of the whole command, one thread each; on a shared machine only its processor time says something.",
        "The program of before held only the named crossing to `gain_crossover_hz`; the judge holds every one.",
        "",
    ]
    lines += ["| | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    lines += [f"| {word} | " + " | ".join(str(f(n)) for n in columns) + " |" for word, f in rows]
    for key, title in (("machine_kind", "By kind of machine"), (None, "By objective")):
        lines += [
            "",
            f"## {title}",
            "",
            "| | " + " | ".join(f"{n}: feasible, within 2 %, farthest behind" for n in columns) + " |",
            "|---" * (len(columns) + 1) + "|",
        ]
        of = lambda i: kept.meta[i][key] if key else kept.objective[i]  # noqa: E731
        for group in sorted({of(o["id"]) for rows_ in columns.values() for o in rows_}):
            cells = []
            for rows_ in columns.values():
                g = kept.summary([o for o in rows_ if of(o["id"]) == group])
                cells.append(f"{g['feasible']}, {g['near']}, {percent(g['worst'])}" if g["specs"] else "")
            lines.append(f"| {group} | " + " | ".join(cells) + " |")
    last = list(columns.values())[-1]
    far = sorted((o for o in last if o["id"] in kept.best and kept.gap(o) > NEAR), key=kept.gap, reverse=True)
    if far:
        lines += [
            "",
            "## Behind by more than 2 %",
            "",
            "| spec | machine | objective | behind | verdict | worst limit |",
            "|---|---|---|---|---|---|",
        ]
        for o in far[:40]:
            why = o.get("error") or o.get("verdict")
            limit = f"{o['worst_of']} {o['worst']:+.2e}" if o.get("worst") is not None else ""
            lines.append(
                f"| {o['id']} | {kept.meta[o['id']]['machine']} | {kept.objective[o['id']]} | {percent(kept.gap(o))} | {why} | {limit} |"
            )
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"wrote {page}")
