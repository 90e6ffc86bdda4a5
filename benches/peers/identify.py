"""Identification of random plants from noisy sweeps: vector fitting of scikit-rf, AAA of scipy, servotune."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import skrf
from scipy.interpolate import AAA
from skrf.vectorFitting import VectorFitting

import program
from clock import timed
from machine import Plant, random_plant, read_plant

PLANTS, PAIRS, POINTS, NOISE, SEED = 20, 10, 400, 0.01, 7
BAND_HZ = (40.0, 5000.0)
ORDER = 2 + 2 * PAIRS

Model = Callable[[np.ndarray], np.ndarray]


def sweep(plant: Plant, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and a response with 1 % relative complex noise."""
    hz = np.geomspace(*BAND_HZ, POINTS)
    e = rng.normal(size=(2, POINTS)) * NOISE / np.sqrt(2)
    return hz, plant.response(2 * np.pi * hz) * (1 + e[0] + 1j * e[1])


def write_bod(path: Path, hz: np.ndarray, value: np.ndarray) -> None:
    columns = np.column_stack([hz, 20 * np.log10(abs(value)), np.degrees(np.angle(value))])
    np.savetxt(path, columns, fmt="%.17g", delimiter="\t")


def _vector_fit(hz: np.ndarray, value: np.ndarray, pairs: int) -> Model:
    network = skrf.Network(f=hz, f_unit="hz", s=value.reshape(-1, 1, 1), z0=50)
    fit = VectorFitting(network)
    fit.vector_fit(n_poles_real=0, n_poles_cmplx=pairs, init_pole_spacing="log", parameter_type="s")
    return lambda f: fit.get_model_response(0, 0, f)


def vector_fitting_raw(_: Plant, hz: np.ndarray, value: np.ndarray) -> Model:
    return _vector_fit(hz, value, ORDER // 2)


def vector_fitting_levelled(_: Plant, hz: np.ndarray, value: np.ndarray) -> Model:
    """After multiplication by f^2, which takes away the slope: what a user can do without knowing the plant."""

    def level(f: np.ndarray) -> np.ndarray:
        return (f / hz[-1]) ** 2

    fit = _vector_fit(hz, value * level(hz), ORDER // 2)
    return lambda f: fit(f) / level(f)


def vector_fitting_helped(plant: Plant, hz: np.ndarray, value: np.ndarray) -> Model:
    """After division by the true body and delay, which no user knows; ten pairs remain."""
    known = Plant(**{**plant.__dict__, "modes": ()})

    def smooth(f: np.ndarray) -> np.ndarray:
        return known.response(2 * np.pi * f)

    fit = _vector_fit(hz, value / smooth(hz), PAIRS)
    return lambda f: fit(f) * smooth(f)


def aaa(plant: Plant, hz: np.ndarray, value: np.ndarray) -> Model:
    """Best rational approximation of the raw sweep by conjugate points, at most 22 poles."""
    s = 2j * np.pi * hz
    found = AAA(np.concatenate([s, s.conj()]), np.concatenate([value, value.conj()]), max_terms=ORDER + 1)
    return lambda f: found(2j * np.pi * f)


def servotune(*words: str) -> Callable[[Plant, np.ndarray, np.ndarray, Path], Model]:
    def route(_: Plant, hz: np.ndarray, value: np.ndarray, folder: Path) -> Model:
        found = folder / "found.toml"
        program.run("identify", str(folder / "sweep.bod"), "--out", str(found), *words)
        model = read_plant(found)
        return lambda f: model.response(2 * np.pi * f)

    return route


def compare_identification(folder: Path) -> dict:
    """Relative error of the response on a grid ten times finer than the sweep, plant by plant."""
    peers = {
        "scikit-rf vector fitting, order 22, raw sweep": vector_fitting_raw,
        "scikit-rf vector fitting, order 22, sweep multiplied by f^2 first": vector_fitting_levelled,
        "scikit-rf vector fitting, order 20, true body and delay divided out first": vector_fitting_helped,
        "scipy AAA, at most 22 poles, raw sweep": aaa,
    }
    ours = {
        "servotune identify, order chosen": servotune(),
        "servotune identify, order 22 given": servotune("--order", str(ORDER)),
    }
    results: dict[str, list[tuple[float, float, float]]] = {name: [] for name in (*peers, *ours)}
    rng = np.random.default_rng(SEED)
    fine = np.geomspace(*BAND_HZ, 10 * POINTS)
    for _ in range(PLANTS):
        plant = random_plant(rng, PAIRS)
        hz, value = sweep(plant, rng)
        write_bod(folder / "sweep.bod", hz, value)
        truth = plant.response(2 * np.pi * fine)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            for name, route in peers.items():
                model, seconds = timed(lambda: route(plant, hz, value))
                results[name].append(_judged(model, fine, truth, seconds))
        for name, command in ours.items():
            model, seconds = timed(lambda: command(plant, hz, value, folder))
            results[name].append(_judged(model, fine, truth, seconds))
    settings = {"plants": PLANTS, "points": POINTS, "noise": NOISE, "order": ORDER, "band_hz": BAND_HZ}
    return {"settings": settings, "routes": {name: _summary(rows) for name, rows in results.items()}}


def _judged(model: Model, hz: np.ndarray, truth: np.ndarray, seconds: float) -> tuple[float, float, float]:
    error = abs(model(hz) / truth - 1)
    return float(np.median(error)), float(np.percentile(error, 95)), seconds


def _summary(rows: list[tuple[float, float, float]]) -> dict:
    medians, tails, seconds = np.array(rows).T
    return {
        "median_error": float(np.median(medians)),
        "p95_error": float(np.median(tails)),
        "worst_p95_error": float(np.max(tails)),
        "median_time_s": float(np.median(seconds)),
        "longest_time_s": float(np.max(seconds)),
    }
