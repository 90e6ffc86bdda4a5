"""A refusal is an exception of its room that says file, place, what was found and what was expected."""

from __future__ import annotations

import numpy as np
import pytest

import servotune as st


def test_a_wrong_key_is_named_with_its_place(tmp_path):
    file = tmp_path / "plant.toml"
    file.write_text('position_unit = "um"\ncommand_unit = "A"\n[plant]\ndc_gian = 1.0\n')
    with pytest.raises(st.DocumentRefused, match=r"plant\.toml:4:1: .*dc_gian"):
        st.Plant.from_toml(file)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(st.DocumentRefused, match="nothing.toml"):
        st.Controller.from_toml(tmp_path / "nothing.toml")
    with pytest.raises(st.FrfRefused, match="nothing.bod"):
        st.read_frf(tmp_path / "nothing.bod")
    with pytest.raises(st.RecordingRefused, match="case.toml"):
        st.diagnose(tmp_path)


def test_each_room_has_its_class(healthy, nominal, easy):
    with pytest.raises(st.FrfRefused, match="point 1: frequency"):
        st.Frf([10.0, 5.0], [1.0, 1.0])
    with pytest.raises(st.PlantRefused, match="damping_ratio"):
        st.Plant.from_toml(healthy.to_toml().replace("damping_ratio = 0.22", "damping_ratio = -1.0", 1))
    with pytest.raises(st.ControllerRefused, match="sample_time_s"):
        st.Controller.from_toml(nominal.to_toml().replace("39.6e-6", "-1.0"))
    with pytest.raises(st.MarginsRefused):
        st.margins(st.Frf([2e4, 3e4, 4e4], [1.0, 0.5, 0.2]), nominal)
    with pytest.raises(st.TuneRefused, match="sample time"):
        st.tune(healthy, st.Spec.parse('[margins]\nphase_margin_deg = 30.0\n[objective]\nminimise = "bandwidth"\n'))
    with pytest.raises(st.TuneRefused, match="guard"):
        st.Spec.parse('guard = 2.0\n[objective]\nminimise = "bandwidth"\n')
    with pytest.raises(st.GateRefused, match="no column|column"):
        st.Gate.train({"a": [1.0, 2.0], "label": ["x", "y"]}, "nothing")
    assert issubclass(st.GateRefused, st.ServotuneError)


def test_an_unknown_keyword_is_named(healthy, tmp_path):
    frf = st.Frf([10.0, 20.0], [1.0, 1.0])
    with pytest.raises(TypeError, match="`ordre`; expected one of: order"):
        st.identify(frf, ordre=4)
    with pytest.raises(ValueError, match="phase: found `sideways`; expected one of: auto, margin, response"):
        st.read_frf(tmp_path / "any.bod", phase="sideways")
    with pytest.raises(AttributeError, match="phase_margin_deg"):
        _ = st.margins(healthy, st.Controller.from_toml(CONTROLLER)).phase_margin


CONTROLLER = """sample_time_s = 39.6e-6
[pid]
kp = 0.27
ki_per_s = 60.0
kd_s = 3.7e-4
derivative_filter_s = 12e-6
"""


def test_records_are_checked(healthy):
    columns = {"time_s": np.arange(100) * 1e-4, "command": np.zeros(100), "position": np.zeros(99)}
    with pytest.raises(ValueError, match="column `(command|time_s)` has 100 samples; expected 99"):
        st.diagnose([st.Record("a", columns)], healthy)
    with pytest.raises(TypeError, match="plant="):
        st.diagnose([st.Record("a", columns)])
