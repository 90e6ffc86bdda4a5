#!/usr/bin/env python3
"""results/manager.md: one concealed machine, what the simulation got wrong and what was left out, for a reader who is no engineer.

python3 scripts/manager.py [--program target/release/servotune]

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
#: Positions in track; what acts is pivot friction.
CASE = ROOT.parent / "shared/practice/PA002"


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
    w = a.parse_args()
    answer = CASE.parent / f"answers/{CASE.name}.json"
    if not (CASE / "case.toml").is_file() or not answer.is_file():
        sys.exit(f"{CASE} with its answer {answer.name} is absent: nothing is written")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder).resolve() / "out"
        subprocess.run([w.program, "--quiet", "diagnose", CASE, "--out", out], stdout=subprocess.DEVNULL, check=True)
        found = json.loads((out / "diagnosis.json").read_text())
        shown = [n for n, s, h in PICTURES if picture(out / "report.html", s, h, ROOT / f"results/figures/manager_{n}.png")]
    truth = json.loads(answer.read_text())
    h, law = found["fit"]["holdout"], found["findings"][0]
    if truth["effects"] != [law["effect"]]:
        sys.exit(f"found {law['effect']}, but {truth['effects']} acts: no such page is written")
    noise, unit = h["noise_floor"], "track"
    said = law["parameters"]
    found_length, length = said["sliding_length"], truth["answer"][law["effect"]]["sliding_length"]
    inside = found_length["low"] <= length <= found_length["high"]
    rows = [
        ("simulation against recording, model as given", f"{h['rms_before']:.4f} {unit} rms, {h['rms_before'] / noise:.1f} times the noise"),
        ("the best that a linear model can do", f"{h['rms_refit_linear']:.4f} {unit} rms, {h['rms_refit_linear'] / noise:.1f} times"),
        ("with the physics that was left out", f"{h['rms_after']:.4f} {unit} rms, {h['rms_after'] / noise:.2f} times"),
        ("share of the error above the noise that is explained", f"{100 * h['explained_share']:.1f} %"),
        ("friction level; length over which the bearing gives way", f"{said['level_command']['value']:.4f} V; {found_length['value']:.2f} {unit}"),
    ]
    text = [
        "# One machine, in five numbers",
        "",
        f"Made by `python3 scripts/manager.py` from the practice case {CASE.name}: records of a simulated arm made by another program, with what it leaves out kept in a file that the",
        "diagnosis does not read. Its model is the best linear fit to one of its own records, so that most of the effect is hidden in the model.",
        "",
        "**Simulation and recording differ.** The bearing sticks: after each reversal it first gives way like a spring, then drags with a constant force. The linear",
        "model cannot have that, whatever its numbers.",
        "",
        "| on records that the fit never saw | |",
        "|---|---|",
        *[f"| {name} | {value} |" for name, value in rows],
        "",
        f"What was hidden: pivot friction, giving way over {length:.2f} {unit}; the interval that was found, {found_length['low']:.2f} to {found_length['high']:.2f}, {'holds' if inside else 'does not hold'} it.",
        "",
        "What to do: use the corrected plant for tuning, and look at the bearing; `report.html` says which record would prove it best.",
        "",
        *[f"![{n.replace('_', ' ')}](figures/manager_{n}.png)\n" for n in shown],
    ]
    (ROOT / "results/manager.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    main()
