#!/usr/bin/env python3
"""results/worked_machines.md: three machines that are no spiral writer, from a sweep to a proved table, by the commands of their READMEs.

python3 scripts/worked_machines.py [--program target/release/servotune] [--out results]

The pictures of the tunings' pages are taken by scripts/pictures.sh.
"""

import argparse
import shlex
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MACHINES = {"stage": "Linear stage", "galvo": "Scan mirror", "vcm": "Voice coil of a disk drive"}
SAID = {"identify": "Order by frequencies", "margins": "Margins", "tune": "Limits", "verify": "Machine 1"}
"""Where what a reader needs of each command's output begins."""


def commands(readme: Path) -> list[str]:
    return [line for line in readme.read_text(encoding="utf-8").splitlines() if line.startswith("servotune ")]


def walk(name: str, program: Path) -> list[str]:
    """The section of one machine."""
    # The book shows what lies between the anchors, with the picture on its own page.
    lines = [f"## {MACHINES[name]}", "", f"Files: `examples/{name}/`, the README there says what each is.", "", f"<!-- ANCHOR: {name} -->"]
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder) / name
        shutil.copytree(ROOT / "examples" / name, here)
        for line in commands(here / "README.md"):
            words = shlex.split(line)
            began = time.perf_counter()
            run = subprocess.run([program, *words[1:], "--quiet"], cwd=here, capture_output=True, text=True, check=False)
            took = time.perf_counter() - began
            said = run.stdout
            said = said[max(said.find(SAID[words[1]]), 0) :].strip()
            lines += ["```", f"$ {line}", said or run.stderr.strip(), "```", "", f"Exit code {run.returncode}, {took:.2f} s.", ""]
        lines += [f"<!-- ANCHOR_END: {name} -->", ""]
        lines += [f"![The page of the tuning](../book/src/pictures/worked_{name}.webp)", ""]
    return lines


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--program", type=Path, default=ROOT / "target/release/servotune")
    a.add_argument("--out", type=Path, default=ROOT / "results")
    w = a.parse_args()
    program, out = w.program.resolve(), w.out.resolve()
    lines = [
        "# Worked machines",
        "",
        "Made by `python3 scripts/worked_machines.py`: the commands of `examples/stage`, `examples/galvo` and `examples/vcm` as their READMEs give them, run in a folder of their own.",
        "The sweeps are made up (`servotune init`); their truths stand in the READMEs. Every table is tuned and proved over 5 % of gain and 5 % of delay. Times are of whole commands on two cores. Exit code 1: done, with something to look at (a number on a bound of its range).",
        "",
    ]
    for name in MACHINES:
        lines += walk(name, program)
    page = out / "worked_machines.md"
    part = page.with_suffix(".part")
    part.write_text("\n".join(lines), encoding="utf-8")
    part.rename(page)


if __name__ == "__main__":
    main()
