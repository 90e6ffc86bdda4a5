"""Whatever comes in is either taken as the numbers that it holds, or refused with the name, the place, what was found and what was expected."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import servotune as st

HZ = np.geomspace(40.0, 5000.0, 64)


@pytest.fixture
def value(healthy) -> np.ndarray:
    return healthy.response(HZ)


def same(frf: st.Frf, hz: np.ndarray, value: np.ndarray) -> bool:
    """The frequencies go to rad/s and back, which costs a rounding."""
    return np.allclose(frf.frequency_hz, hz, rtol=4e-16, atol=0.0) and np.array_equal(frf.response, value)


def test_layouts_of_an_array_are_all_the_same_numbers(value):
    wide_hz, wide_value = np.repeat(HZ, 2), np.repeat(value, 2)
    # Backwards in memory, every second value, a column of a matrix, the other order of bytes, not writable.
    assert same(st.Frf(HZ[::-1].copy()[::-1], value[::-1].copy()[::-1]), HZ, value)
    assert same(st.Frf(wide_hz[::2], wide_value[1::2]), HZ, value)
    assert same(st.Frf(np.column_stack([HZ, HZ])[:, 1], np.column_stack([value, value])[:, 0]), HZ, value)
    assert same(st.Frf(HZ.astype(">f8"), value.astype(">c16")), HZ, value)
    fixed_hz, fixed_value = HZ.copy(), value.copy()
    fixed_hz.setflags(write=False)
    fixed_value.setflags(write=False)
    assert same(st.Frf(fixed_hz, fixed_value), HZ, value)
    assert same(st.Frf(HZ.tolist(), tuple(value.tolist())), HZ, value)
    assert same(st.Frf(HZ.astype(object), value.astype(object)), HZ, value)


def test_numbers_of_other_widths_are_taken(value):
    short_hz, short = HZ.astype(np.float32), value.astype(np.complex64)
    assert same(st.Frf(short_hz, short), short_hz.astype(float), short.astype(complex))
    assert same(st.Frf(np.arange(1, 65, dtype=np.int16), value), np.arange(1.0, 65.0), value)


def test_what_came_in_is_not_changed(value):
    hz, before, after = HZ.copy(), value.copy(), value.copy()
    frf = st.Frf(hz, after)
    frf.response[:] = 0.0
    assert np.array_equal(hz, HZ) and np.array_equal(after, before) and np.array_equal(frf.response, before)


def test_columns_of_data_frames_are_taken(value):
    pandas = pytest.importorskip("pandas")
    # An index that does not begin at 0 is no order of the values.
    frame = pandas.DataFrame({"hz": HZ, "value": value}, index=range(100, 164))
    assert same(st.Frf(frame["hz"], frame["value"]), HZ, value)
    assert same(st.Frf(frame["hz"].astype("Float64"), frame["value"]), HZ, value)
    missing = frame["hz"].astype("Float64").mask(frame.index == 103)
    with pytest.raises((TypeError, st.FrfRefused), match="value 3: found <NA>|point 3: frequency NaN"):
        st.Frf(missing, frame["value"])
    empty = pandas.DataFrame()
    with pytest.raises(st.GateRefused, match="empty; expected a header line"):
        st.Gate.train(empty, "label")


@pytest.mark.parametrize(
    ("hz", "response", "refusal", "words"),
    [
        (["a", "b"], [1, 2], TypeError, r"frequency_hz: found <U1; expected real numbers"),
        ([True, False], [1, 2], TypeError, r"frequency_hz: found bool; expected real numbers"),
        ([1j, 2j], [1, 2], TypeError, r"frequency_hz: found complex128; expected real numbers"),
        ([1.0, None], [1, 2], TypeError, r"frequency_hz: value 1: found None; expected real numbers"),
        ([1.0, 2.0], [1, "x"], TypeError, r"response: found <U\d+; expected numbers"),
        (np.array(["2026-01-01"], "M8[D]"), [1], TypeError, r"frequency_hz: found datetime64\[D\]"),
        ([[1.0, 2.0]], [[1, 2]], ValueError, r"frequency_hz: found the shape \(1, 2\); expected one dimension"),
        (1.0, 2.0, ValueError, r"frequency_hz: found the shape \(\); expected one dimension"),
        ([[1.0], [1.0, 2.0]], [1, 2], ValueError, r"frequency_hz: .*expected real numbers in one shape"),
        (np.ma.array([1.0, 2.0], mask=[True, False]), [1, 2], ValueError, r"frequency_hz: found 1 masked values of 2"),
        ([1.0, 2.0], np.ma.array([1, 2], mask=[False, True]), ValueError, r"response: found 1 masked values of 2"),
        ([], [], st.FrfRefused, r"at least one point"),
        ([1.0, 2.0], [1.0], st.FrfRefused, r"2 frequencies, 1 values"),
        ([1.0, np.nan], [1, 2], st.FrfRefused, r"point 1: frequency NaN Hz; expected one between"),
        ([1.0, 2.0], [1, np.nan], st.FrfRefused, r"point 1 at 2 Hz: .*not finite"),
        ([1.0, 2.0], [np.inf, 1], st.FrfRefused, r"point 0 at 1 Hz: .*not finite"),
    ],
)
def test_a_response_that_is_none(hz, response, refusal, words):
    with pytest.raises(refusal, match=words):
        st.Frf(hz, response)


def test_frequencies_at_which_something_is_asked(healthy, nominal):
    for asked in (healthy, nominal):
        assert asked.response(np.full((2, 3), 100)).shape == (2, 3)
        assert asked.response([]).shape == (0,)
        with pytest.raises(ValueError, match="hz: value 1: found nan; expected a finite number"):
            asked.response([1.0, np.nan])
        with pytest.raises(TypeError, match="hz: value 0: found None"):
            asked.response(None)
        with pytest.raises(TypeError, match="hz: found complex128; expected real numbers"):
            asked.response(1j)


def test_what_is_no_machine_and_no_controller(healthy, nominal, easy):
    for wrong in (None, HZ, {"num": 1}):
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for a plant; expected a Plant"):
            st.margins(wrong, nominal)
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for a sweep; expected an Frf"):
            st.identify(wrong)
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for the controller; expected a path"):
            st.margins(healthy, wrong)
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for the profile; expected a path"):
            st.simulate(healthy, nominal, wrong)
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for the spec; expected a Spec"):
            st.tune(healthy, wrong)
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for the gains; expected a path"):
            st.verify(wrong, healthy, easy / "spec.toml")


def test_settings_out_of_range(healthy, nominal, value):
    frf = st.Frf(HZ, value)
    for order, refusal in ((-2, ValueError), (3, ValueError), (1000, ValueError), ("six", TypeError), (2.5, TypeError)):
        with pytest.raises(refusal, match=f"order: found {order!r}; expected"):
            st.identify(frf, order=order)
    for amplitudes in ((1,), (-1, 2), (2, 1), (0.1, float("nan")), 3, "ab"):
        with pytest.raises(ValueError, match="amplitudes: found .*expected two"):
            st.margins(healthy, nominal, amplitudes=amplitudes)
    with pytest.raises(st.PlantRefused, match="sample_time_s = NaN: expected a finite time above 0 s"):
        healthy.discretise(float("nan"))


def test_tables_of_features_that_are_none():
    with pytest.raises(ValueError, match=r"unequal length: {'a': 3, 'label': 2}"):
        # Cut to the shorter one it would train on rows that nobody wrote.
        st.Gate.train({"a": [1.0, 2.0, 3.0], "label": ["x", "y"]}, "label")
    for wrong in (None, np.zeros((3, 3)), 5):
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for a table; expected a path"):
            st.Gate.train(wrong, "label")
    with pytest.raises(st.GateRefused, match="table:2: column `a`: found `q`; expected a finite number"):
        st.Gate.train({"a": ["q"] * 9, "label": ["x", "y", "z"] * 3}, "label")


def test_records_that_are_none(healthy):
    good = {"time_s": np.arange(100) * 1e-4, "command": np.zeros(100), "position": np.zeros(100)}
    with pytest.raises(TypeError, match="a: column `command`: found <U1; expected real numbers"):
        st.diagnose([st.Record("a", {**good, "command": ["x"] * 100})], healthy)
    with pytest.raises(ValueError, match=r"a: column `command`: found the shape \(100, 1\)"):
        st.diagnose([st.Record("a", {**good, "command": np.zeros((100, 1))})], healthy)
    with pytest.raises(ValueError, match="a: column `command`, sample 0: expected a finite number"):
        st.diagnose([st.Record("a", {**good, "command": np.full(100, np.nan)})], healthy)
    with pytest.raises(st.RecordingRefused, match="expected at least one record to fit"):
        st.diagnose([], healthy)


def test_tables_of_sweeps_that_are_none(nominal, value):
    pa = pytest.importorskip("pyarrow")
    from servotune import batch

    columns = {
        "slot": ["a", "b"],
        "frequency_hz": [HZ, HZ],
        "magnitude_db": [20 * np.log10(abs(value))] * 2,
        "phase_deg": [np.degrees(np.angle(value))] * 2,
    }
    assert batch.margins(columns, nominal).column("error").null_count == 2
    for kind in (pa.large_list(pa.float64()), pa.list_(pa.float64(), 64), pa.list_(pa.float64())):
        lists = {k: v if k == "slot" else pa.array([list(x) for x in v], kind) for k, v in columns.items()}
        assert batch.margins(pa.table(lists), nominal).column("error").null_count == 2
    for wrong, found in ((["1", "2"], "string"), ([1.0, 2.0], "double"), ([["1"], ["x"]], "list<item: string>")):
        with pytest.raises(TypeError, match=f"column 'frequency_hz': found {found}; expected lists of numbers"):
            batch.margins({**columns, "frequency_hz": wrong}, nominal)
    for wrong in (None, [1, 2], np.zeros((2, 2))):
        with pytest.raises(TypeError, match=f"found {type(wrong).__name__} for a table; expected an Arrow table"):
            batch.margins(wrong, nominal)
    with pytest.raises(ValueError, match="no column 'slot'; found no column at all"):
        batch.margins({}, nominal)
    with pytest.raises(ValueError, match="expected columns of one length"):
        batch.margins({**columns, "plant": ["x"]}, nominal)
    with pytest.raises(ValueError, match="found the column 'slot' more than once"):
        batch.margins(pa.table([pa.array(["a"])] * 2, names=["slot", "slot"]), nominal)
    for threads, refusal in ((-1, ValueError), ("a", TypeError), (1.5, TypeError)):
        with pytest.raises(refusal, match=f"threads: found {threads!r}; expected a whole number"):
            batch.margins(columns, nominal, threads=threads)


def test_a_file_that_cannot_be_written_leaves_what_was_there(nominal, tmp_path):
    file = tmp_path / "controller.toml"
    file.write_text("before")
    with pytest.raises(st.DocumentRefused, match="controller.toml"):
        nominal.to_toml(file / "inside.toml")
    with pytest.raises(st.DocumentRefused):
        nominal.to_toml(tmp_path)
    assert file.read_text() == "before" and [f.name for f in tmp_path.iterdir()] == ["controller.toml"]
    nominal.to_toml(file)
    assert file.read_text() == nominal.to_toml() and [f.name for f in tmp_path.iterdir()] == ["controller.toml"]


def test_systems_of_many_channels():
    control = pytest.importorskip("control")
    first = control.tf([1.0], [1.0, 2.0])
    many = control.tf([[first.num[0][0]] * 2], [[first.den[0][0]] * 2])
    for system in (many, control.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]])):
        with pytest.raises(ValueError, match="found 2 inputs and 1 outputs; expected one of each"):
            st.Plant.from_control(system)


def test_plants_and_controllers_go_to_other_processes(healthy, nominal):
    for thing in (healthy, nominal):
        again = pickle.loads(pickle.dumps(thing))
        assert type(again) is type(thing) and again.to_toml() == thing.to_toml()
    assert copy.deepcopy(healthy).to_dict() == healthy.to_dict()
