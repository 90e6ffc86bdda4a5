"""One candidate: the figures of every route beside the reference, and what they cost."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import candidate
import exact
import program
import write
from clock import Timing, timing
from machine import ROOT, healthy_machine, nominal_controller, spiral_write
from realise import sampled, sections

PLANT = ROOT / "specs/machines/healthy.toml"
CONTROLLER = ROOT / "specs/controllers/nominal.toml"
PROFILE = ROOT / "specs/profiles/spiral.toml"
REPEATS = 25
ROUTES = {
    "python-control, FRD of 1000 points": candidate.control_frd,
    "python-control, block-diagonal state space": candidate.control_state_space,
    "python-control, disk margin on 1000 points": candidate.control_disk,
    "NumPy by hand, 1000 points": candidate.numpy_by_hand,
}


def _row(f: candidate.Figures, time: Timing | None, note: str) -> dict:
    return {**f.__dict__, "time": None if time is None else time.__dict__, "note": note}


def _reference(r: exact.ReferenceMargins) -> candidate.Figures:
    phase = min(r.gain_crossings, key=lambda x: abs(x[1]))
    gain = min(r.phase_crossings, key=lambda x: abs(x[1]))
    return candidate.Figures(phase[1], phase[0], gain[1], gain[0], r.max_sensitivity, r.disk_margin, None)


def compare_margins() -> dict:
    """Margins of the nominal loop on the healthy machine."""
    plant, controller = healthy_machine(), nominal_controller()
    s = sampled(plant, controller.sample_time_s)
    reference = exact.margins(s, sections(controller))
    ours = program.run("margins", "--plant", str(PLANT), "--controller", str(CONTROLLER))
    w = candidate.grid()
    prepared = candidate.prepare(s, exact.block_response(s, w), w)
    routes = {}
    for name, route in ROUTES.items():
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            figures = route(prepared, controller)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            time = timing(lambda: route(prepared, controller), REPEATS)
        routes[name] = _row(figures, time, "; ".join(sorted({str(x.message) for x in said})))
    keys = candidate.Figures.__dataclass_fields__
    routes["servotune margins"] = _row(candidate.Figures(**{k: ours[k] for k in keys}), None, "")
    routes["reference, 1e6 points and refinement"] = _row(_reference(reference), None, "")
    whole = timing(lambda: program.run("margins", "--plant", str(PLANT), "--controller", str(CONTROLLER)), REPEATS)
    return {
        "order": plant.order,
        "routes": routes,
        "against_reference": _differences(ours, reference),
        "command_time": whole.__dict__,
    }


def _differences(ours: dict, r: exact.ReferenceMargins) -> dict:
    """Largest differences of servotune from the reference over all crossings."""

    def pairs(found: list[dict], known: list[tuple[float, float]]) -> tuple[float, float]:
        if len(found) != len(known):
            raise RuntimeError(f"servotune lists {len(found)} crossings, the reference {len(known)}")
        hz = max(abs(f["hz"] - k[0]) for f, k in zip(found, known))
        return hz, max(abs(f["value"] - k[1]) for f, k in zip(found, known))

    gain_hz, degrees = pairs(ours["gain_crossings"], r.gain_crossings)
    phase_hz, decibels = pairs(ours["phase_crossings"], r.phase_crossings)
    return {
        "gain_crossings": len(r.gain_crossings),
        "phase_crossings": len(r.phase_crossings),
        "deg": degrees,
        "db": decibels,
        "hz": max(gain_hz, phase_hz),
        "max_sensitivity_relative": abs(ours["max_sensitivity"] / r.max_sensitivity - 1),
        "disk_margin_relative": abs(ours["disk_margin"] / r.disk_margin - 1),
    }


def compare_write(folder: Path) -> dict:
    """PES and DFT of the spiral write by every route, with noise and without."""
    quiet = folder / "quiet.toml"
    lines = PROFILE.read_text(encoding="utf-8").splitlines()
    quiet.write_text("\n".join(x for x in lines if "_rms" not in x) + "\n", encoding="utf-8")
    words = ("simulate", "--plant", str(PLANT), "--controller", str(CONTROLLER), "--profile")
    plant, controller = healthy_machine(), nominal_controller()
    s, rows, profile = sampled(plant, controller.sample_time_s), sections(controller), spiral_write()
    noiseless = write.quiet(profile)
    out: dict = {"routes": {}}
    routes = {
        "scipy.signal.dlsim": write.by_scipy,
        "python-control forced_response": write.by_control,
        "NumPy recursion by hand": write.by_numpy,
    }
    for name, route in routes.items():
        row = {}
        for kind, file, p in (("noise", PROFILE, profile), ("quiet", quiet, noiseless)):
            ours = program.run(*words, str(file))
            scene = write.scene(p, s, whole=True)
            pes = route(scene, rows)
            amplitudes = write.harmonics(pes, p)
            row[f"{kind}_pes_difference"] = float(np.max(abs(pes - np.array(ours["pes"]))))
            theirs = np.array([h["amplitude"] for h in ours["harmonics"]])
            row[f"{kind}_amplitude_difference"] = float(np.max(abs(amplitudes - theirs)))
        scene = write.scene(profile, s, whole=True)
        row["time"] = timing(lambda: route(scene, rows), REPEATS).__dict__
        out["routes"][name] = row
    ours = program.run(*words, str(PROFILE))
    out |= {"pes_range": ours["pes_range"], "dft_low": ours["dft_low"], "dft_high": ours["dft_high"]}
    out["samples"] = len(ours["pes"])
    out["command_time"] = timing(lambda: program.run(*words, str(PROFILE)), REPEATS).__dict__
    return out


def candidate_times() -> dict:
    """Margins, stability and DFT of one candidate, the write simulated to the end of the window."""
    plant, controller, profile = healthy_machine(), nominal_controller(), spiral_write()
    s, w = sampled(plant, controller.sample_time_s), candidate.grid()
    p = candidate.prepare(s, exact.block_response(s, w), w)
    scene = candidate.prepare_write(profile, s)
    calls = {
        "python-control (FRD of 1000 points, forced_response)": candidate.whole_by_control,
        "scipy (hand-written margins, dlsim)": candidate.whole_by_scipy,
        "NumPy by hand throughout": candidate.whole_by_numpy,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {name: timing(lambda: call(p, scene, controller), REPEATS).__dict__ for name, call in calls.items()}
