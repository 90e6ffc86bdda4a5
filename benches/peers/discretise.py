"""Zero-order hold of plants of order 22 and 40: worst error of every route against 50 digits."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import control
import numpy as np
from scipy import signal

import exact
import program
from clock import timed
from machine import Plant, random_plant
from realise import modal_state_space

SAMPLE_TIME_S = 39.6e-6
PLANTS = 20
SEED = 20
PAIRS = {22: 10, 40: 19}

Route = Callable[[Plant, np.ndarray], np.ndarray]


def _zeros_poles(plant: Plant) -> tuple[np.ndarray, np.ndarray, float]:
    def roots(pairs: list[tuple[float, float]]) -> np.ndarray:
        upper = np.array([w * complex(-d, np.sqrt(1 - d * d)) for w, d in pairs])
        return np.concatenate([upper, upper.conj()])

    return roots(plant.numerators()), roots(plant.denominators()), plant.leading_gain


def _polynomials(plant: Plant, unit_rad_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Expanded numerator and denominator with s in `unit_rad_s`."""
    z, p, k = _zeros_poles(plant)
    gain = k * unit_rad_s ** float(len(z) - len(p))
    return gain * np.real(np.poly(z / unit_rad_s)), np.real(np.poly(p / unit_rad_s))


def _evaluated(system: control.LTI, w: np.ndarray, t: float = SAMPLE_TIME_S) -> np.ndarray:
    return np.array([complex(np.squeeze(system(np.exp(1j * x * t)))) for x in w])


def control_tf(plant: Plant, w: np.ndarray) -> np.ndarray:
    system = control.tf(*_polynomials(plant, 1.0))
    return _evaluated(control.c2d(system, SAMPLE_TIME_S, "zoh"), w)


def control_tf_scaled(plant: Plant, w: np.ndarray) -> np.ndarray:
    unit = 1e4
    system = control.tf(*_polynomials(plant, unit))
    return _evaluated(control.c2d(system, SAMPLE_TIME_S * unit, "zoh"), w)


def control_zpk(plant: Plant, w: np.ndarray) -> np.ndarray:
    z, p, k = _zeros_poles(plant)
    return _evaluated(control.c2d(control.zpk(z, p, k), SAMPLE_TIME_S, "zoh"), w)


def scipy_zpk(plant: Plant, w: np.ndarray) -> np.ndarray:
    z, p, k, _ = signal.cont2discrete(_zeros_poles(plant), SAMPLE_TIME_S, "zoh")
    at = np.exp(1j * w * SAMPLE_TIME_S)
    return k * np.prod(at[:, None] - z[None, :], axis=1) / np.prod(at[:, None] - p[None, :], axis=1)


def scipy_zpk2ss(plant: Plant, w: np.ndarray) -> np.ndarray:
    a, b, c, d, _ = signal.cont2discrete(signal.zpk2ss(*_zeros_poles(plant)), SAMPLE_TIME_S, "zoh")
    return _solved(a, b, c, d, w)


def scipy_modal(plant: Plant, w: np.ndarray) -> np.ndarray:
    form = (*modal_state_space(plant), np.zeros((1, 1)))
    a, b, c, d, _ = signal.cont2discrete(form, SAMPLE_TIME_S, "zoh")
    return _solved(a, b, c, d, w)


def control_modal(plant: Plant, w: np.ndarray) -> np.ndarray:
    system = control.ss(*modal_state_space(plant), 0.0)
    return _evaluated(control.c2d(system, SAMPLE_TIME_S, "zoh"), w)


def _solved(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, w: np.ndarray) -> np.ndarray:
    eye = np.eye(len(a))
    at = np.exp(1j * w * SAMPLE_TIME_S)
    return np.array([(c @ np.linalg.solve(z * eye - a, b) + d)[0, 0] for z in at])


ROUTES: dict[str, Route] = {
    "python-control, tf in rad/s, c2d": control_tf,
    "python-control, tf with time in 0.1 ms, c2d": control_tf_scaled,
    "python-control, zpk, c2d": control_zpk,
    "scipy, cont2discrete of zeros, poles, gain": scipy_zpk,
    "scipy, zpk2ss, cont2discrete": scipy_zpk2ss,
    "scipy, block-diagonal state space by hand, cont2discrete": scipy_modal,
    "python-control, block-diagonal state space by hand, c2d": control_modal,
}


def _frequencies(plants: list[Plant]) -> np.ndarray:
    """200 points, even in the logarithm, and the poles of the first plant (rad/s)."""
    return np.union1d(2 * np.pi * np.geomspace(10.0, 12_500.0, 200), [w for w, _ in plants[0].denominators()])


def _summary(errors: list[float | str], seconds: list[float]) -> dict:
    numbers = [e for e in errors if not isinstance(e, str)]
    finite = [e for e in numbers if np.isfinite(e)]
    return {
        "refused": sorted({e for e in errors if isinstance(e, str)}),
        "refused_count": len(errors) - len(numbers),
        "not_a_number_count": len(numbers) - len(finite),
        "median_of_worst": float(np.median(finite)) if finite else None,
        "worst": float(np.max(finite)) if finite else None,
        "median_time_s": float(np.median(seconds)) if seconds else None,
    }


def _attempt(route: Route, plant: Plant, w: np.ndarray, truth: np.ndarray) -> tuple[float | str, float]:
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            value, seconds = timed(lambda: route(plant, w))
        except Exception as refusal:  # noqa: BLE001 - whatever a peer raises is its answer
            return type(refusal).__name__, 0.0
        return float(np.max(abs(value / truth - 1))), seconds


def compare_discretisation(folder: Path) -> dict:
    """Worst relative error over frequency for each plant; then median and worst over plants."""
    out: dict = {"plants": PLANTS, "orders": {}}
    for order, pairs in PAIRS.items():
        rng = np.random.default_rng(SEED)
        late = [random_plant(rng, pairs) for _ in range(PLANTS)]
        plants = [plant.without_delay() for plant in late]
        w = _frequencies(plants)
        truth = [exact.sampled_response(plant, SAMPLE_TIME_S, w) for plant in plants]
        rows = {}
        for name, route in ROUTES.items():
            tried = [_attempt(route, plant, w, true) for plant, true in zip(plants, truth)]
            rows[name] = _summary([e for e, _ in tried], [s for e, s in tried if not isinstance(e, str)])
        ours = program.sampled_responses(plants, SAMPLE_TIME_S, w, folder)
        rows["servotune"] = _summary([float(np.max(abs(a / b - 1))) for a, b in zip(ours, truth)], [])
        truth_late = [exact.sampled_response(plant, SAMPLE_TIME_S, w) for plant in late]
        ours_late = program.sampled_responses(late, SAMPLE_TIME_S, w, folder)
        errors = [float(np.max(abs(a / b - 1))) for a, b in zip(ours_late, truth_late)]
        rows["servotune, with a fractional delay of 40-80 us"] = _summary(errors, [])
        some = w[:: len(w) // 8]
        aliased = exact.aliased_response(late[0], SAMPLE_TIME_S, some)
        check = float(np.max(abs(aliased / truth_late[0][:: len(w) // 8] - 1)))
        out["orders"][str(order)] = {"routes": rows, "reference_against_aliasing_sum": check, "points": len(w)}
    return out
