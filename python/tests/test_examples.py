"""The notebooks run from top to bottom, and lie there as they ran."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import servotune

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")

#: What each needs beside numpy; `program` is the program.
NOTEBOOKS = {
    "first_sweep": [],
    "mismatch": [],
    "floor_on_ray": ["ray", "program"],
    "python_control": ["control"],
}


def words(notebook) -> str:
    """All that its cells printed."""
    return "".join(o.get("text", "") for c in notebook.cells for o in c.get("outputs", []))


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebook(name, root, program_file, shared, monkeypatch):
    for need in NOTEBOOKS[name]:
        if need == "program":
            if program_file is None:
                pytest.skip("the program is not built: cargo build, or name it in SERVOTUNE")
            monkeypatch.setenv("SERVOTUNE", str(program_file))
        else:
            pytest.importorskip(need)
    # The package of this process, wherever the kernel starts.
    there = Path(servotune.__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(there), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("SERVOTUNE_TESTERS", "1")
    monkeypatch.setenv("SERVOTUNE_SHARED", str(shared))
    monkeypatch.setenv("RAY_worker_niceness", "0")
    notebook = nbformat.read(root / "examples/python" / f"{name}.ipynb", as_version=4)
    assert all(c.execution_count and c.outputs for c in notebook.cells if c.cell_type == "code" and "print" in c.source)
    # A cell that fails ends this test with its traceback.
    client = nbclient.NotebookClient(notebook, timeout=None, resources={"metadata": {"path": str(root)}})
    found = words(client.execute())
    if name == "mismatch" and not (shared / "practice/emps").is_dir():
        assert "practice/emps is absent" in found
        pytest.skip("../shared/practice/emps is absent: the notebook said so and diagnosed nothing")
    if name == "mismatch":
        assert "friction" in found


def test_the_mismatch_notebook_without_its_data(root, tmp_path, monkeypatch):
    there = Path(servotune.__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(there), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("SERVOTUNE_SHARED", str(tmp_path))
    notebook = nbformat.read(root / "examples/python/mismatch.ipynb", as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=None, resources={"metadata": {"path": str(root)}})
    assert "practice/emps is absent: there are no records to diagnose" in words(client.execute())
