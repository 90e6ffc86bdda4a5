"""What Python gives is what the program gives, to the last bit."""

from __future__ import annotations

import pytest
from conftest import swept

import servotune as st

MACHINES = ["healthy", "tunable", "sensor_fault", "loose_pushpin"]
CONTROLLER = "specs/controllers/nominal.toml"


@pytest.mark.parametrize("machine", MACHINES)
def test_margins_of_a_model(machine, root, program, nominal):
    file = f"specs/machines/{machine}.toml"
    said, code = program("margins", "--plant", file, "--controller", CONTROLLER)
    found = st.margins(st.Plant.from_toml(root / file), nominal)
    assert found.to_dict() == said
    assert found.accepted == (code == 0) == said["stable"]
    assert found.phase_margin_deg == said["phase_margin_deg"]


def test_margins_of_a_sweep_and_identify(program, nominal, healthy, tmp_path):
    swept(healthy, 1).to_bod(tmp_path / "sweep.bod")
    frf = st.read_frf(tmp_path / "sweep.bod")
    said, _ = program("margins", "--frf", tmp_path / "sweep.bod", "--controller", CONTROLLER)
    assert st.margins(frf, nominal).to_dict() == said
    out = tmp_path / "plant.toml"
    said, code = program("identify", tmp_path / "sweep.bod", "--order", 6, "--out", out)
    found = st.identify(frf, order=6)
    assert found.to_dict() == said
    assert found.to_toml() == out.read_text()
    assert found.accepted == (code == 0)


def test_simulate(root, program, healthy, nominal):
    profile = "specs/profiles/spiral.toml"
    said, _ = program(
        "simulate", "--plant", "specs/machines/healthy.toml", "--controller", CONTROLLER, "--profile", profile
    )
    found = st.simulate(healthy, nominal, root / profile)
    assert found.to_dict() == said
    assert found.pes.tolist() == said["pes"]


def test_tune_on_a_model_and_verify(root, program, healthy, nominal, easy, tmp_path):
    plant, out = root / "specs/machines/healthy.toml", tmp_path / "gains.toml"
    said, _ = program(
        "tune", "--plant", plant, "--spec", easy / "spec.toml", "--controller", CONTROLLER, "--starts", 1, "--out", out
    )
    found = st.tune(healthy, easy / "spec.toml", nominal, starts=1)
    assert found.gains == out.read_text()
    assert found.certificate_text == out.with_suffix(".certificate.json").read_text()
    files = {"gain_table", "certificate", "report"}
    document = found.to_dict()
    assert {k: v for k, v in document.items() if k not in files} == {k: v for k, v in said.items() if k not in files}
    assert document["certificate"]["says"] == said["certificate"]["says"]
    found.save(tmp_path / "again.toml")
    assert (tmp_path / "again.certificate.json").read_text() == found.certificate_text
    proved, _ = program("verify", tmp_path / "again.toml", "--plant", plant, "--spec", easy / "spec.toml")
    again = st.verify(found, healthy, easy / "spec.toml")
    assert again.to_dict() == proved
    assert again.proved == found.certified


def test_tune_on_a_sweep(program, healthy, nominal, easy, tmp_path):
    swept(healthy, 2).to_bod(tmp_path / "sweep.bod")
    out = tmp_path / "gains.toml"
    words = ["--frf", tmp_path / "sweep.bod", "--spec", easy / "spec.toml", "--controller", CONTROLLER]
    said, code = program("tune", *words, "--starts", 1, "--order", 6, "--out", out)
    frf = st.read_frf(tmp_path / "sweep.bod")
    found = st.tune(frf, st.Spec.read(easy / "spec.toml"), nominal, starts=1, order=6)
    assert found.verdict == said["verdict"]
    assert found.tuned == (code == 0)
    if found.tuned:
        assert found.gains == out.read_text()


def test_gate(program, practice, tmp_path):
    features = tmp_path / "features.csv"
    program("features", practice / "machines", "--out", features)
    said, _ = program(
        "train", features, "--label", "label", "--out", tmp_path / "gate.json", "--folds", 0, "--epochs", 5
    )
    gate = st.Gate.train(features, "label", folds=0, epochs=5)
    gate.write(tmp_path / "python.json")
    assert (tmp_path / "python.json").read_text() == (tmp_path / "gate.json").read_text()
    report = gate.report.to_dict()
    assert {**report, "gate": said["gate"]} == said
    said, _ = program("classify", features, "--gate", tmp_path / "gate.json")
    pandas = pytest.importorskip("pandas")
    found = st.Gate.read(tmp_path / "gate.json").classify(pandas.read_csv(features))
    assert found.to_dict()["rows"] == said["rows"]


def test_diagnose(program, practice, tmp_path):
    said, _ = program("diagnose", practice / "PC001", "--out", tmp_path)
    found = st.diagnose(practice / "PC001")
    assert found.to_dict() == said
    assert found.report == (tmp_path / "report.html").read_text()
    if found.corrected is not None:
        assert found.corrected.to_toml() == (tmp_path / "plant_corrected.toml").read_text()


def test_every_attribute_is_its_key_of_the_document(healthy, nominal):
    document = st.margins(healthy, nominal).to_dict()
    assert {type(value) for value in document.values()} >= {bool, int, float, list}
    for key, value in document.items():
        # A result that nobody has looked at yet finds its number without the rest of the document.
        found = getattr(st.margins(healthy, nominal), key)
        assert (type(found), found) == (type(value), value), key
    with pytest.raises(AttributeError, match="expected one of: .*phase_margin_deg"):
        _ = st.margins(healthy, nominal).phase_margin
