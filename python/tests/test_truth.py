"""Against numpy and python-control, which share no code with the library."""

from __future__ import annotations

import numpy as np
import pytest

import servotune as st

control = pytest.importorskip("control")

PLANT = """position_unit = "um"
command_unit = "A"
[plant]
dc_gain = 75.0
natural_frequency_rad_s = 369.0
damping_ratio = 0.22
delay_s = 65e-6
resonance_gain = 1.0
[[plant.modes]]
zero_rad_s = 7483.0
zero_damping_ratio = 0.038
pole_rad_s = 7681.0
pole_damping_ratio = 0.037
"""
HZ = np.geomspace(1.0, 10e3, 300)


@pytest.fixture
def plant() -> st.Plant:
    return st.Plant.from_toml(PLANT)


def formula(hz: np.ndarray) -> np.ndarray:
    s = 2j * np.pi * hz
    body = 75.0 * 369.0**2 / (s**2 + 2 * 0.22 * 369.0 * s + 369.0**2)
    mode = (s**2 + 2 * 0.038 * 7483.0 * s + 7483.0**2) / (s**2 + 2 * 0.037 * 7681.0 * s + 7681.0**2)
    return np.exp(-65e-6 * s) * body * mode


def test_the_response_is_the_formula(plant):
    assert np.allclose(plant.response(HZ), formula(HZ), rtol=1e-13)
    assert plant.response(100.0).shape == ()


@pytest.mark.parametrize("form", ["zpk", "tf", "ss"])
def test_to_python_control_and_back(plant, form):
    system = plant.to_control(form)
    rational = np.squeeze(control.frequency_response(system, 2 * np.pi * HZ).complex)
    assert np.allclose(rational * np.exp(-2j * np.pi * HZ * plant.delay_s), formula(HZ), rtol=1e-9)
    back = st.Plant.from_control(system, plant.delay_s, "um", "A")
    assert np.allclose(back.response(HZ), formula(HZ), rtol=1e-8)
    assert (back.position_unit, back.command_unit) == ("um", "A")


@pytest.mark.parametrize("delay", ["0.0", "20e-6", "65e-6", "120e-6"])
def test_sampling_is_exact(delay):
    """The sampled response is the sum over the aliases of hold times plant."""
    plant = st.Plant.from_toml(PLANT.replace("delay_s = 65e-6", f"delay_s = {delay}"))
    t = 40e-6
    sampled = plant.discretise(t)
    hz = np.geomspace(10.0, 12e3, 50)
    n = sampled.a.shape[0]
    z = np.exp(2j * np.pi * hz * t)
    found = [(sampled.c @ np.linalg.solve(v * np.eye(n) - sampled.a, sampled.b) + sampled.d)[0, 0] for v in z]
    k = np.arange(-4000, 4001)[:, None]
    s = 2j * np.pi * (hz + k / t)
    images = plant.response((hz + k / t).ravel()).reshape(s.shape) * (1 - np.exp(-s * t)) / (s * t)
    assert np.allclose(found, images.sum(axis=0), rtol=2e-6)


def test_margins_agree_with_python_control(plant, nominal):
    t = nominal.sample_time_s
    found = st.margins(plant, nominal)
    sampled = plant.discretise(t)
    loop = control.ss(sampled.a, sampled.b, sampled.c, sampled.d, t) * control.ss(nominal.to_control())
    gm, pm, _, wpc, wgc, _ = control.stability_margins(
        control.frd(loop, np.geomspace(10.0, 0.999 * np.pi / t, 20_000)), returnall=False
    )
    assert found.stable
    assert found.phase_margin_deg == pytest.approx(pm, abs=1e-3)
    assert 2 * np.pi * found.gain_crossover_hz == pytest.approx(wgc, rel=1e-5)
    assert found.gain_margin_db == pytest.approx(20 * np.log10(gm), abs=1e-3)
    w = 2 * np.pi * np.geomspace(10.0, 0.999 / (2 * t), 20_000)
    value = np.squeeze(control.frequency_response(loop, w).complex)
    assert found.max_sensitivity == pytest.approx(np.max(1 / np.abs(1 + value)), rel=1e-5)


def test_a_sweep_goes_through_python_control(plant):
    frf = st.Frf(HZ, plant.response(HZ), "um", "A")
    back = st.Frf.from_control(frf.to_control(), "um", "A")
    assert np.allclose(back.frequency_hz, HZ, rtol=1e-14)
    assert np.array_equal(back.response, frf.response)


def test_a_controller_is_its_sections(nominal):
    hz = np.geomspace(1.0, 12e3, 100)
    z1 = np.exp(-2j * np.pi * hz * nominal.sample_time_s)
    value = np.ones_like(z1)
    for b0, b1, b2, a1, a2 in nominal.sections:
        value *= (b0 + b1 * z1 + b2 * z1**2) / (1 + a1 * z1 + a2 * z1**2)
    assert np.allclose(nominal.response(hz), value, rtol=1e-11)


def test_identify_finds_the_plant(plant):
    hz = np.geomspace(5.0, 5e3, 400)
    found = st.identify(st.Frf(hz, plant.response(hz), "um", "A"), order=4)
    assert np.allclose(found.response(hz), formula(hz), rtol=1e-3)
    assert found.delay_s == pytest.approx(65e-6, abs=1e-7)
    assert (found.position_unit, found.order) == ("um", 4)
