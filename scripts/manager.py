#!/usr/bin/env python3
"""results/manager.md: one concealed machine, what the simulation got wrong and what was left out, for a reader who is no engineer.

python3 scripts/manager.py [--program target/release/servotune] [--case ../shared/practice/PA002]

Needs the practice cases and, for the pictures, chromium; it says so where either is absent.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: Name of a picture, section of the report (fourth: before and after; sixth: the law), height (px).
PICTURES = [("before_and_after", "s4", 1000), ("law", "s6", 900)]
WHAT = {"pivot_friction": "the bearing sticks: after each reversal it first gives way like a spring, then drags with a constant force"}


def picture(report: Path, section: str, height: int, out: Path) -> bool:
    """A section of the report as a picture."""
    browser = shutil.which("chromium")
    if browser is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        alone = Path(folder) / "section.html"
        rule = f"<style>main > *, header, footer, nav, section, p {{ display: none }} #{section}, #{section} p {{ display: block }}</style>"
        alone.write_text(report.read_text().replace("</head>", f"{rule}</head>"))
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={folder}"]
        words += [f"--window-size=1000,{height}", f"--screenshot={out}", f"file://{alone}"]
        subprocess.run([browser, *words], capture_output=True, check=True)
    return True


def main() -> None:
    """Writes the page and its pictures."""
    a = argparse.ArgumentParser(description=__doc__)
    a.add_argument("--program", type=Path, default=ROOT / "target/release/servotune")
    a.add_argument("--case", type=Path, default=ROOT.parent / "shared/practice/PA002")
    w = a.parse_args()
    answer = w.case.parent / f"answers/{w.case.name}.json"
    if not (w.case / "case.toml").is_file() or not answer.is_file():
        sys.exit(f"{w.case} with its answer {answer.name} is absent: nothing is written")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder).resolve() / "out"
        subprocess.run([w.program, "--quiet", "diagnose", w.case, "--out", out], stdout=subprocess.DEVNULL, check=True)
        found = json.loads((out / "diagnosis.json").read_text())
        shown = [n for n, s, h in PICTURES if picture(out / "report.html", s, h, ROOT / f"results/figures/manager_{n}.png")]
    truth = json.loads(answer.read_text())
    h, law = found["fit"]["holdout"], found["findings"][0]
    noise, unit = h["noise_floor"], "track"
    said = law["parameters"]
    length = truth["answer"].get(law["effect"], {}).get("sliding_length")
    rows = [
        ("simulation against recording, model as given", f"{h['rms_before']:.4f} {unit} rms, {h['rms_before'] / noise:.1f} times the noise"),
        ("the best that a linear model can do", f"{h['rms_refit_linear']:.4f} {unit} rms, {h['rms_refit_linear'] / noise:.1f} times"),
        ("with the physics that was left out", f"{h['rms_after']:.4f} {unit} rms, {h['rms_after'] / noise:.2f} times"),
        ("share of the error above the noise that is explained", f"{100 * h['explained_share']:.1f} %"),
        ("friction level; length over which the bearing gives way", f"{said['level_command']['value']:.4f} V; {said['sliding_length']['value']:.2f} {unit}"),
    ]
    text = [
        "# One machine, in five numbers",
        "",
        f"Made by `python3 scripts/manager.py` from the practice case {w.case.name}: records of a simulated arm made by another program, with what it leaves out kept in a file that the",
        "diagnosis does not read. Its model is the best linear fit to one of its own records, so that most of the effect is hidden in the model.",
        "",
        f"**Simulation and recording differ.** {WHAT[law['effect']].capitalize()}. The linear model cannot have that, whatever its numbers.",
        "",
        "| on records that the fit never saw | |",
        "|---|---|",
        *[f"| {name} | {value} |" for name, value in rows],
        "",
        f"What was hidden (opened afterwards): {', '.join(truth['effects'])}" + (f", giving way over {length:.2f} {unit}." if length else "."),
        "",
        "What to do: use the corrected plant for tuning, and look at the bearing; `report.html` says which record would prove it best.",
        "",
        *[f"![{n.replace('_', ' ')}](figures/manager_{n}.png)\n" for n in shown],
    ]
    if found["findings"][0]["effect"] not in truth["effects"]:
        sys.exit(f"found {law['effect']}, but {truth['effects']} acts: no such page is written")
    (ROOT / "results/manager.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    main()
