"""The examples run from top to bottom."""

from __future__ import annotations

import subprocess
import sys

import pytest

#: The floor's example is what test_floor.py does with a smaller one.
SCRIPTS = {"first_sweep.py": [], "from_python_control.py": ["control"]}


@pytest.mark.parametrize("script", SCRIPTS)
def test_example(script, root):
    for module in SCRIPTS[script]:
        pytest.importorskip(module)
    ran = subprocess.run(
        [sys.executable, root / "examples/python" / script], capture_output=True, text=True, cwd=root, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout


def test_missing_physics(root, practice):
    ran = subprocess.run(
        [sys.executable, root / "examples/python/missing_physics.py"], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "friction" in ran.stdout
