"""Makes results/python.md: `python python/bench/results.py` with the package, python-control, the program and its example at hand
(`cargo build --release --bin servotune --example margins_of_many -p servotune-cli -p servotune`).

What is measured: the time of a call of `margins` from Python and of its parts, python-control on the same loops with its agreement, and 1000 slots through
the program, the single call and the batch, to the last bit.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import control
import numpy as np
import pyarrow as pa
from machine import ROOT, program_file

import servotune as st
from servotune import _core, batch

SLOTS = 1000
LOOPS = 25


def plant(random: np.random.Generator) -> str:
    """A machine around the paper's, ten pairs of modes, as plant.toml."""
    modes = ""
    for centre in np.geomspace(900.0, 4600.0, 10).tolist():
        pole = 2 * np.pi * centre * random.uniform(0.97, 1.03)
        damping = random.uniform(0.02, 0.05)
        modes += (
            f"[[plant.modes]]\nzero_rad_s = {pole * random.uniform(0.985, 1.015)!r}\nzero_damping_ratio = {damping!r}\n"
            f"pole_rad_s = {pole!r}\npole_damping_ratio = {damping * random.uniform(0.9, 1.1)!r}\n"
        )
    return (
        'position_unit = "track"\ncommand_unit = "V"\n[plant]\n'
        f"dc_gain = {random.uniform(65.0, 85.0)!r}\nnatural_frequency_rad_s = {random.uniform(340.0, 400.0)!r}\n"
        f"damping_ratio = {random.uniform(0.15, 0.3)!r}\ndelay_s = {random.uniform(50e-6, 80e-6)!r}\nresonance_gain = 1.0\n{modes}"
    )


def microseconds(call: Callable[[], object], repeats: int) -> tuple[float, float, float]:
    """Median and best of so many calls, and the processor's time for one."""
    times = []
    busy = time.process_time()
    for _ in range(repeats):
        begun = time.perf_counter()
        call()
        times.append(1e6 * (time.perf_counter() - begun))
    return statistics.median(times), min(times), 1e6 * (time.process_time() - busy) / repeats


def speed(machine: st.Plant, law: st.Controller) -> list[str]:
    """Time of a call and of its parts."""
    core_plant, core_law = machine._core, law._core
    whole, best, whole_cpu = microseconds(lambda: st.margins(machine, law).phase_margin_deg, 500)
    inside, inside_best, inside_cpu = microseconds(lambda: _core.margins_of_model(core_plant, core_law, 0.15, 15.0), 500)
    answer = _core.margins_of_model(core_plant, core_law, 0.15, 15.0)
    reading, reading_best, reading_cpu = microseconds(lambda: json.loads(answer.json), 500)
    finding, finding_best, finding_cpu = microseconds(lambda: answer.plain("phase_margin_deg"), 500)
    empty, empty_best, empty_cpu = microseconds(lambda: answer.accepted, 500)
    table = pa.table({"slot": [str(i) for i in range(SLOTS)], "plant": [machine.to_toml()] * SLOTS})
    row, row_best, row_cpu = (us / SLOTS for us in microseconds(lambda: batch.margins(table, law, threads=1), 5))
    return [
        "| what | median us | best us | processor us |",
        "|---|---:|---:|---:|",
        f"| `margins(plant, controller).phase_margin_deg` | {whole:.1f} | {best:.1f} | {whole_cpu:.1f} |",
        f"| of which the library, with its document as JSON | {inside:.1f} | {inside_best:.1f} | {inside_cpu:.1f} |",
        f"| of which Python: arguments, the number found in the document | {whole - inside:.1f} | {best - inside_best:.1f} | {whole_cpu - inside_cpu:.1f} |",
        f"| a number found in the document | {finding:.1f} | {finding_best:.1f} | {finding_cpu:.1f} |",
        f"| the whole document taken apart, which a list of crossings asks for | {reading:.1f} | {reading_best:.1f} | {reading_cpu:.1f} |",
        f"| an attribute of a result | {empty:.2f} | {empty_best:.2f} | {empty_cpu:.2f} |",
        f"| a row of `batch.margins`, its plant.toml read, of {SLOTS} on one thread | {row:.1f} | {row_best:.1f} | {row_cpu:.1f} |",
        "",
        "*Processor*: of this process, mean of all calls; what other work on the machine does not change much. A batch works beside the thread that asked for it, so",
        "that its rows share the processors with all that runs, while a single call is over before its turn is.",
    ]


def beside_control(machines: list[st.Plant], law: st.Controller) -> list[str]:
    """python-control on the same loops: exactly sampled plant times sections, its margins on the function."""
    t = law.sample_time_s
    off = {"phase margin (deg)": [], "gain margin (dB)": [], "Ms (relative)": []}
    times = {"found": [], "control": [], "frd": []}
    grid = np.geomspace(2 * np.pi * 10.0, 0.999 * np.pi / t, 4000)
    for machine in machines:
        begun = time.perf_counter()
        ours = st.margins(machine, law)
        _ = ours.phase_margin_deg
        times["found"].append(time.perf_counter() - begun)
        sampled = machine.discretise(t)
        loop = control.ss(sampled.a, sampled.b, sampled.c, sampled.d, t) * control.ss(law.to_control())
        begun = time.perf_counter()
        response = control.frd(loop, grid)
        times["frd"].append(time.perf_counter() - begun)
        gm, pm, sm, wpc, wgc, wms = control.stability_margins(response, returnall=True)
        times["control"].append(time.perf_counter() - begun)
        pm = pm[np.argmin(np.abs(pm))]
        gm = 20 * np.log10(gm)
        off["phase margin (deg)"].append(abs(pm - ours.phase_margin_deg))
        off["gain margin (dB)"].append(abs(gm[np.argmin(np.abs(gm))] - ours.gain_margin_db))
        off["Ms (relative)"].append(abs(1 / np.min(sm) / ours.max_sensitivity - 1))
    ms = {name: 1e3 * statistics.median(found) for name, found in times.items()}
    lines = [
        f"{len(machines)} machines of order 22 under `specs/controllers/nominal.toml`; python-control {control.__version__}: `frd` of the exactly sampled plant times",
        f"the controller at {len(grid)} frequencies, then `stability_margins`. It is given the sampled plant: its own `c2d` knows no dead time.",
        "",
        "| | median ms a loop |",
        "|---|---:|",
        f"| servotune | {ms['found']:.3f} |",
        f"| python-control | {ms['control']:.2f} |",
        f"| of which its frequency response | {ms['frd']:.2f} |",
        "",
        "| difference | median | largest |",
        "|---|---:|---:|",
    ]
    return lines + [f"| {name} | {statistics.median(d):.1e} | {max(d):.1e} |" for name, d in off.items()]


def same(machines: list[st.Plant], law: st.Controller, law_file: Path) -> list[str]:
    """1000 slots through the program, the single call and the batch."""
    table = pa.table({"slot": [str(i) for i in range(SLOTS)], "plant": [m.to_toml() for m in machines]})
    begun = time.perf_counter()
    rows = batch.margins(table, law).column("document").to_pylist()
    spent = time.perf_counter() - begun
    single = [st.margins(m, law).to_json() for m in machines]
    named = program_file()
    with tempfile.TemporaryDirectory() as folder:

        def one(i: int) -> dict:
            file = Path(folder) / f"{i}.toml"
            file.write_text(machines[i].to_toml())
            words = [str(named), "--json", "margins", "--plant", str(file), "--controller", str(law_file)]
            return json.loads(subprocess.run(words, capture_output=True, check=False).stdout)

        with ThreadPoolExecutor(2) as pool:
            said = list(pool.map(one, range(SLOTS)))
        files = [Path(folder) / f"{i}.toml" for i in range(SLOTS)]
        lines = subprocess.run([named.parent / "examples/margins_of_many", law_file, *files], capture_output=True, check=True).stdout
        library = [json.loads(line) for line in lines.splitlines()]
    library_equal = sum(found == document for found, document in zip(library, said))
    batch_equal = sum(json.loads(row) == document for row, document in zip(rows, said))
    single_equal = sum(json.loads(text) == document for text, document in zip(single, said))
    bytes_equal = sum(a == b for a, b in zip(rows, single))
    numbers = sum(text.count(":") for text in single)
    return [
        f"{SLOTS} plants of order 22. The documents of `servotune margins --json` (program built in `{named.parent.name}`), read by Python's json, against:",
        "",
        "| way | slots equal in every key and bit |",
        "|---|---:|",
        f"| the Rust library, called by `crates/servotune/examples/margins_of_many.rs` | {library_equal} of {SLOTS} |",
        f"| `margins` | {single_equal} of {SLOTS} |",
        f"| `batch.margins` ({SLOTS / spent:.0f} slots/s on {os.cpu_count()} cores) | {batch_equal} of {SLOTS} |",
        f"| `margins` and `batch.margins`, byte by byte | {bytes_equal} of {SLOTS} |",
        "",
        f"{numbers} keys were compared in each.",
    ]


def main() -> None:
    """Writes the page."""
    random = np.random.default_rng(1)
    machines = [st.Plant.from_toml(plant(random)) for _ in range(SLOTS)]
    law_file = ROOT / "specs/controllers/nominal.toml"
    law = st.Controller.from_toml(law_file)
    load = os.getloadavg()[0]
    page = [
        "# The Python package, measured",
        "",
        f"Made by `python python/bench/results.py`; {platform.python_implementation()} {platform.python_version()}, numpy {np.__version__},"
        f" {os.cpu_count()} cores, load {load:.1f} as it began (1.0 is one busy core; a load above the cores makes medians longer, the best tells the machine).",
        "",
        "## A call of `margins`",
        "",
        "One loop of order 22 with two filters.",
        "",
        *speed(machines[0], law),
        "",
        "## Beside python-control",
        "",
        *beside_control(machines[:LOOPS], law),
        "",
        "## The same figures",
        "",
        *same(machines, law, law_file),
        "",
    ]
    (ROOT / "results/python.md").write_text("\n".join(page))


if __name__ == "__main__":
    main()
