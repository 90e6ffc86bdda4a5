"""Tables in, tables out: rows are independent, bytes are the program's."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import swept

import servotune as st

pa = pytest.importorskip("pyarrow")
from servotune import batch  # noqa: E402


def floor(plant: st.Plant, rows: int, points: int = 160) -> pa.Table:
    sweeps = [swept(plant, seed, points) for seed in range(rows)]
    return pa.table(
        {
            "slot": [f"T001/S{i:02}" for i in range(rows)],
            "frequency_hz": [s.frequency_hz for s in sweeps],
            "magnitude_db": [s.magnitude_db for s in sweeps],
            "phase_deg": [s.phase_deg for s in sweeps],
        }
    )


def as_file(table: pa.Table, row: int) -> str:
    lists = [table.column(c)[row].as_py() for c in batch.SWEEP]
    head = "Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n"
    return head + "".join(f"{number(f)}\t{number(m)}\t{number(p)}\n" for f, m, p in zip(*lists))


def number(x: float) -> str:
    return repr(x).removesuffix(".0")


def test_rows_are_the_program_s(healthy, nominal, easy, program, tmp_path):
    table = floor(healthy, 2)
    found = batch.tune(table, easy / "spec.toml", nominal, starts=1, order=6)
    assert found.column_names[:9] == [
        "slot", "verdict", "objective", "phase_margin_deg", "gain_margin_db", "max_sensitivity", "gains", "certified", "error",
    ]  # fmt: skip
    assert found.column("error").null_count == 2
    for row in range(2):
        (tmp_path / "sweep.bod").write_text(as_file(table, row))
        out = tmp_path / f"{row}.toml"
        words = ["--frf", tmp_path / "sweep.bod", "--spec", easy / "spec.toml", "--starts", 1, "--order", 6]
        said, _ = program("tune", *words, "--controller", "specs/controllers/nominal.toml", "--out", out)
        assert found.column("verdict")[row].as_py() == said["verdict"]
        assert found.column("objective")[row].as_py() == said["objective"]["value"]
        gains = found.column("gains")[row].as_py()
        assert gains == (out.read_text() if out.exists() else None)


def test_a_bad_row_is_a_row_with_its_error(healthy, nominal):
    table = floor(healthy, 4)
    lists = {name: table.column(name).to_pylist() for name in table.column_names}
    lists["phase_deg"][1] = lists["phase_deg"][1][:-1]
    lists["magnitude_db"][2] = None
    lists["magnitude_db"][3] = [float("nan")] * 160
    found = batch.margins(pa.table(lists), nominal).to_pydict()
    alone = batch.margins(table, nominal, threads=1).to_pydict()
    assert found["error"][0] is None and alone["error"] == [None] * 4
    assert {k: v[0] for k, v in found.items()} == {k: v[0] for k, v in alone.items()}
    assert "expected lists of one length" in found["error"][1]
    assert all(e and "\n" not in e for e in found["error"][1:])
    assert found["stable"][1:] == [None] * 3
    assert batch.margins(pa.table(lists), nominal, threads=2).to_pydict() == found


def test_identify_margins_and_verify_go_together(healthy, nominal, easy):
    table = floor(healthy, 3)
    models = batch.identify(table, order=6)
    assert models.column("error").null_count == 3
    one = st.identify(st.Frf(*(np.array(x) for x in sweep(table, 0))), order=6)
    assert models.column("order")[0].as_py() == one.order == 6
    found = batch.margins(models, nominal)
    assert found.column("stable").to_pylist() == [True] * 3
    plant = st.Plant.from_toml(models.column("plant")[1].as_py())
    assert found.column("document")[1].as_py() == st.margins(plant, nominal).to_json()
    gains = st.tune(plant, easy / "spec.toml", nominal, starts=1).gains
    proved = batch.verify(models.append_column("gains", [["x = 1\n", gains, None]]), easy / "spec.toml").to_pydict()
    assert proved["error"][1] is None and proved["document"][1] == st.verify(gains, plant, easy / "spec.toml").to_json()
    assert "unknown field" in proved["error"][0] and "no gains" in proved["error"][2]


def sweep(table: pa.Table, row: int):
    hz, db, deg = (np.array(table.column(c)[row].as_py()) for c in batch.SWEEP)
    return hz, 10 ** (db / 20) * np.exp(1j * np.radians(deg))


def test_other_tables_are_taken(healthy, nominal):
    table = floor(healthy, 5)
    whole = batch.margins(table, nominal)
    assert batch.margins(table.slice(2, 2), nominal).equals(whole.slice(2, 2).combine_chunks())
    pieces = pa.concat_tables([table.slice(0, 1), table.slice(1)])
    assert batch.margins(pieces, nominal).equals(whole)
    reader = pa.RecordBatchReader.from_batches(table.schema, table.to_batches())
    assert batch.margins(reader, nominal).equals(whole)
    assert batch.margins(table.slice(0, 0), nominal).num_rows == 0
    with pytest.raises(ValueError, match="no column 'slot'"):
        batch.margins(table.drop_columns(["slot"]), nominal)


def test_classify(practice, program, tmp_path):
    features = tmp_path / "features.csv"
    program("features", practice / "machines", "--out", features)
    gate = st.Gate.train(features, "label", folds=0, epochs=5)
    import pyarrow.csv

    table = pyarrow.csv.read_csv(features)
    found = batch.classify(table, gate).to_pydict()
    rows = gate.classify(features).rows
    assert found["class"] == [r["class_name"] for r in rows]
    assert found["probability"] == [r["probability"] for r in rows]
    assert found["slot"] == [r["id"] for r in rows]


def test_diagnose(practice):
    found = batch.diagnose({"case": [str(practice / "PC001"), "nowhere"]}).to_pydict()
    assert found["error"][0] is None and found["verdict"][0]
    assert "case.toml" in found["error"][1] and found["verdict"][1] is None
