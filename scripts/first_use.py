#!/usr/bin/env python3
"""results/first_use.md: every line of the list of the first use that this program answers otherwise now, with the answer as it is given.

python3 scripts/first_use.py [--program target/debug/servotune] [--out results/first_use.md]

Runs the program in a folder of its own; the first lines of each answer that hold the words asked for are shown.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Where in the list, what stood in the way, the commands, the words of the answer that are shown.
LINES = [
    ("1", "`specs/...` paths work only inside the clone; no `init`; the README's files exist nowhere",
     ["servotune init stage mystage"], ["files for", "servotune", "Every key"]),
    ("1", "`twin` is not in `servotune --help`", ["servotune --help"], ["  twin", "  init", "  check", "  export", "  completions"]),
    ("1", "reader notes: four long lines on every sweep", ["servotune margins --frf mystage/sweep.csv --controller mystage/controller.toml --quiet"], ["phase margin"]),
    ("1", "`train` with a wrong label lists 350 column names (9 kB)", ["servotune train wide.csv --label label --out gate.json"], ["error:"]),
    ("2.0", "no `check`; the meaning of a file is a riddle", ["servotune check plant.toml controller.toml spec.toml"], [""]),
    ("2.0", "\"dc gain\" is not the gain at rest", ["servotune identify vcm/sweep.csv --order 30 --out vcm/plant.toml"], ["Gain at rest", "dc_gain of the body"]),
    ("2.3", "intervals of 60 decades, and no sentence says that the numbers mean nothing",
     ["servotune identify vcm/sweep.csv --order 30 --out vcm/plant.toml"], ["does not tell", "not told"]),
    ("4.9", "rad/s under a header `Frequency`, ends not round: taken as Hz with a note", ["servotune margins --frf odd.csv --controller controller.toml --quiet"], ["warning"]),
    ("4.11", "radians under `Phase (deg)`: wrong advice (conjugate)", ["servotune margins --frf radians.csv --controller controller.toml"], ["error:"]),
    ("4.13", "inverted sensor silently taken for a phase-margin display", ["servotune margins --frf inverted.csv --controller controller.toml"], ["error:"]),
    ("4.16", "typo in a key: \"did you mean\" missing", ["servotune margins --plant plant.toml --controller typo.toml"], ["error:"]),
    ("4.17", "missing `kd_s` taken as 0 in silence", ["servotune check nokd.toml"], [""]),
    ("4.18", "kp = \"0.27\": a Rust word", ["servotune margins --plant plant.toml --controller text.toml"], ["error:"]),
    ("4.19", "sample_time_s = 39.6 (us): cause not named, 17 digits", ["servotune margins --plant plant.toml --controller micro.toml"], ["error:"]),
    ("4.19", "the same without filters is accepted", ["servotune check bare.toml"], [""]),
    ("4.20", "`--out` is a device: replaced by a file", ["servotune identify sweep.csv --out /dev/full"], ["error:"]),
    ("4.20", "`--out -` writes a file named `-`", ["servotune identify sweep.csv --out -"], ["error:"]),
    ("4.20", "`identify -` is not stdin", ["servotune margins --frf - --controller controller.toml < sweep.csv"], ["phase margin"]),
    ("4.21", "an output that is an input is overwritten", ["servotune identify sweep.csv --out sweep.csv"], ["error:"]),
    ("4.22", "what exists is overwritten in silence", ["servotune identify sweep.csv --out mine.toml", "servotune identify sweep.csv --out mine.toml --force"], ["error:", "kept as"]),
    ("4.22", "the demo overwrites a folder without a word", ["servotune demo --out ."], ["error:"]),
    ("4.24", "disk full: half results, no advice", ["sh -c \"trap '' XFSZ; ulimit -f 0; exec servotune identify sweep.csv --out full.toml\""], ["error:"]),
    ("1", "one help sentence for approve, apply and rollback", ["servotune fleet --help"], ["  approve", "  apply", "  rollback"]),
    ("4.2", "`--out no/such/p.toml` makes the folders in silence", ["servotune identify sweep.csv --out no/such/p.toml"], ["wrote"]),
    ("4.4, 4.5", "a folder for a file, an empty file", ["servotune identify vcm --out x.toml", "servotune identify empty.csv --out x.toml"], ["error:"]),
    ("4.6", "a decimal comma in a comma file is not named", ["servotune identify comma.csv --out x.toml"], ["error:"]),
    ("4.20", "a link is replaced by a file", ["ln -s kept.toml link.toml && touch kept.toml && servotune identify sweep.csv --out link.toml --force --quiet", "readlink link.toml; head -1 kept.toml"], ["kept", "position_unit", "error:"]),
    ("4.26", "impossible spec: two tables that disagree", ["servotune tune --plant plant.toml --spec impossible.toml --controller controller.toml --out no.toml --quiet"],
     ["No gains", "missed", "In conflict", "max sensitivity"]),
    ("4.28", "a gain table edited by hand: no file name, no way out", ["servotune margins --plant plant.toml --controller hand.toml"], ["error:"]),
    ("4.29", "`verify` with another plant: 40 lines of `Changed`", ["servotune verify gains.toml --plant another.toml --spec spec.toml --quiet"], ["Another", "Its [after]", "Changed", "PROVED"]),
    ("4.31", "`--uncertainty gain=5`: \"did you mean 5%\"", ["servotune verify gains.toml --plant plant.toml --spec spec.toml --uncertainty gain=5"], ["error:"]),
    ("4.33", "`--json` and an error: nothing on stdout", ["servotune check gone.toml --json"], ["{", "schema", "\"error\"", "exit_code", "}"]),
    ("5", "no completions, no man page", ["servotune completions bash | wc -l", "servotune completions man | head -1"], [""]),
    ("5", "no export", ["servotune export controller.toml --as c --out c.h", "servotune export controller.toml --as fixed --word-length 24 --plant plant.toml --out f.h",
                        "servotune export controller.toml --as st --out c.st", "servotune export controller.toml --as matlab --out c.m"], ["sections", "Words", "Margins"]),
    ("5", "no import of .mat and Touchstone; HDF5 refused without a way out",
     ["servotune identify frd.mat --out a.toml --quiet", "servotune identify axis.s1p --out b.toml --quiet", "servotune identify new.mat --out c.toml"], ["Model against", "error:"]),
    ("5", "no plants from or to other forms", ["servotune export plant.toml --as python --out p.py", "servotune export plant.toml --as ss --out p.json", "servotune check p.json"], ["p.py", "p.json"]),
    ("5", "no schema for editors", ["servotune schema spec | head -4"], [""]),
    ("5", "no progress on tune and pareto", ["servotune pareto --plant plant.toml --spec spec.toml --controller controller.toml --out front.html 2>&1 >/dev/null | grep left | head -2"], [""]),
    ("5", "LICENSE is one line", ["wc -l LICENSE"], [""]),
]

# What this page does not run, and where its answer is to be seen.
OPEN = [
    ("1", "the demo's closing words and \"what next\"; texts of fleet and diagnosis: `servotune demo --out demo`, held by `tests/first_steps.rs`"),
    ("1", "`classify`'s column `why` in the terminal; README's rollback example is of a slot that may keep its gains"),
    ("2.1 to 2.5", "the search and what a spec can ask for: `specs/tuning.md`, `results/search.md`; worked machines: `results/worked_machines.md`"),
    ("3", "pages: `book/src/pictures.md`; held in a browser at three widths, light and dark, by `tests/report_browser.rs`. Open: `machines.html` of the demo has no links to gains; its tables are not certified, which it says"),
    ("5", "Python: `results/python.md`; documentation site: `scripts/site.sh`; glossary: `book/src/glossary.md`; not there: HDF5, plug-ins for MATLAB, a server"),
]


def spiral_files(folder: Path, run) -> None:
    """The folder's files: a spiral writer's beginning, and the slips of the list made in copies."""
    run("servotune init spiral .", folder)
    run("servotune init stage mystage", folder)
    run("servotune init vcm vcm", folder)
    (folder / "plant.toml").write_text((ROOT / "specs/machines/healthy.toml").read_text())
    rows = [[float(x) for x in line.split(",")[:3]] for line in (folder / "sweep.csv").read_text().splitlines()[2:]]

    def sweep(name: str, header: str, change) -> None:
        (folder / name).write_text(header + "\n" + "".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in map(change, rows)))

    sweep("inverted.csv", "Frequency (Hz),Magnitude (dB),Phase (deg)", lambda r: (r[0], r[1], r[2] - 180 if r[2] > 0 else r[2] + 180))
    sweep("radians.csv", "Frequency (Hz),Magnitude (dB),Phase (deg)", lambda r: (r[0], r[1], r[2] * 3.141592653589793 / 180))
    sweep("odd.csv", "Frequency,Magnitude (dB),Phase (deg)", lambda r: (r[0] * 1.2345, r[1], r[2]))
    (folder / "wide.csv").write_text(",".join(f"feature_{i}" for i in range(350)) + "\n" + (",".join("1.0" for _ in range(350)) + "\n") * 2)
    text = (folder / "controller.toml").read_text()
    for name, old, new in (
        ("typo.toml", "kd_s", "kd_ss"),
        ("nokd.toml", "kd_s = 3.7e-4\n", ""),
        ("text.toml", "kp = 0.27", 'kp = "0.27"'),
        ("micro.toml", "39.6e-6", "39.6"),
    ):
        assert old in text, name
        (folder / name).write_text(text.replace(old, new))
    (folder / "bare.toml").write_text("sample_time_s = 39.6\n[pid]\nkp = 0.27\n")
    (folder / "mine.toml").write_text("# mine\n")
    (folder / "empty.csv").write_text("")
    (folder / "comma.csv").write_text("Frequency (Hz),Magnitude (dB),Phase (deg)\n" + "".join(",".join(repr(x).replace(".", ",") for x in r) + "\n" for r in rows))
    for name in ("frd.mat", "axis.s1p"):
        (folder / name).write_bytes((ROOT / "tests/data" / name).read_bytes())
    (folder / "new.mat").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    text = (folder / "spec.toml").read_text()
    assert "max_sensitivity = 2.4" in text
    (folder / "impossible.toml").write_text(text.replace("max_sensitivity = 2.4", "max_sensitivity = 1.05"))
    run("servotune tune --plant plant.toml --spec spec.toml --controller controller.toml --out gains.toml", folder)
    table = (folder / "gains.toml").read_text()
    at = table.index("kp = ")
    (folder / "hand.toml").write_text(table[:at] + "kp = 0.3" + table[table.index("\n", at) :])
    (folder / "LICENSE").write_text((ROOT / "LICENSE").read_text())
    # The list's first line makes it again; the line on another plant has one of its own.
    run("rm -rf mystage", folder)
    (folder / "another.toml").write_text((ROOT / "specs/machines/tunable.toml").read_text())


def main() -> None:
    a = argparse.ArgumentParser()
    a.add_argument("--program", type=Path, default=ROOT / "target/debug/servotune")
    a.add_argument("--out", type=Path, default=ROOT / "results/first_use.md")
    w = a.parse_args()
    path = f"{w.program.resolve().parent}{os.pathsep}{os.environ['PATH']}"

    def run(command: str, folder: Path) -> tuple[int, str]:
        done = subprocess.run(["bash", "-c", command], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    parts = [
        "# First use: the list and the new answers\n\n`python3 scripts/first_use.py` runs every command below and writes this page. The number is the line's place in the list; long lines are "
        "cut at 700 characters, and of long answers the lines that matter are shown.\n"
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        spiral_files(folder, run)
        for place, what, commands, words in LINES:
            parts.append(f"\n## {place}: {what}\n\n```\n")
            for command in commands:
                code, said = run(command, folder)
                lines = [line for line in said.splitlines() if line.strip() and any(word in line for word in words)]
                shown = [line if len(line) <= 700 else line[:700] + " ..." for line in lines[:12]]
                parts.append(f"$ {command}\n" + "".join(f"{line}\n" for line in shown) + f"[exit code {code}]\n")
            parts.append("```\n")
    parts.append("\n## Answered elsewhere, or open\n\n| place | what |\n|---|---|\n" + "".join(f"| {p} | {t} |\n" for p, t in OPEN))
    w.out.write_text("".join(parts))


if __name__ == "__main__":
    main()
