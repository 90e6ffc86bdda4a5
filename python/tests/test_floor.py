"""A floor over an engine is the floor of `fleet run`: the same rows, tables and pages."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import sys
import time
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path

import pytest

import servotune as st
from servotune import floor
from servotune.floor.task import Task

SETTINGS = """
[robust]
draws = 1
[tables]
pilots = 2
scouts = 2
candidates = 4
most = 2
[untunable]
explained = 1
"""


@pytest.fixture(scope="module")
def fleet(program, tmp_path_factory) -> Path:
    """A FLEET.toml of six slots, one of them poisoned."""
    folder = tmp_path_factory.mktemp("floor")
    program("twin", "fleet", "--out", folder, "--testers", 1)
    for slot in sorted((folder / "testers/T001/slots").iterdir())[6:]:
        shutil.rmtree(slot)
    (folder / "testers/T001/slots/S02/response.bod").write_text("nothing to read")
    names = "".join(f'{key} = "{file}"\n' for key, file in [("spec", "spec.toml"), ("controller", "controller.toml")])
    (folder / "FLEET.toml").write_text(f'{names}[input]\ntree = "testers"\n{SETTINGS}')
    return folder / "FLEET.toml"


@pytest.fixture(scope="module")
def alone(program, fleet, tmp_path_factory) -> Path:
    """What the program writes."""
    out = tmp_path_factory.mktemp("alone")
    program("fleet", "run", fleet, "--out", out, "--run", "one")
    return out


def rows(folder: Path) -> list[tuple]:
    with sqlite3.connect(folder / "fleet.db") as store:
        return store.execute("SELECT run, place, slot, digest, verdict, row FROM slots ORDER BY place").fetchall()


def same(found: Path, alone: Path) -> None:
    assert rows(found) == rows(alone)
    names = {p.relative_to(alone) for p in alone.rglob("*") if p.is_file() and "fleet.db" not in str(p)}
    assert {p.relative_to(found) for p in found.rglob("*") if p.is_file()} >= names
    for name in names:
        assert (found / name).read_bytes() == (alone / name).read_bytes(), name


def test_threads(fleet, alone, tmp_path):
    ran = floor.run(fleet, out=tmp_path, name="one", workers=2, batch=2)
    assert ran.slots == 6 and sum(ran.verdicts.values()) == 6 and ran.verdicts["failed"] == 1
    same(tmp_path, alone)
    assert (tmp_path / "slots.parquet").exists() or pytest.importorskip("pyarrow") is None


def test_ray(fleet, alone, tmp_path, monkeypatch):
    pytest.importorskip("ray")
    # Ray's own workers stand back behind everything else on a machine, which is shared here.
    monkeypatch.setenv("RAY_worker_niceness", "0")
    floor.run(fleet, engine="ray", out=tmp_path, name="one", workers=2, batch=2)
    same(tmp_path, alone)


def survives_dead_workers(engine, fleet, alone, tmp_path, monkeypatch):
    traps = tmp_path / "traps"
    traps.mkdir()

    class Deadly(Task):
        def __call__(self, places):
            trap = traps / str(places[0])
            if self.library is not None and not trap.exists():
                trap.touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return super().__call__(places)

    monkeypatch.setattr(import_module("servotune.floor.run"), "Task", Deadly)
    floor.run(fleet, engine=engine, out=tmp_path / "out", name="one", workers=2, batch=2)
    assert len(list(traps.iterdir())) == 3
    same(tmp_path / "out", alone)


def test_ray_survives_dead_workers(fleet, alone, tmp_path, monkeypatch):
    """Every batch of slots kills its worker's process at the first try."""
    pytest.importorskip("ray")
    monkeypatch.setenv("RAY_worker_niceness", "0")
    survives_dead_workers("ray", fleet, alone, tmp_path, monkeypatch)


def test_a_slot_that_ends_every_worker(fleet, alone, tmp_path, monkeypatch):
    """It is given up, the others are kept, and a later run needs that one only."""
    pytest.importorskip("ray")
    from servotune.floor import over_ray

    monkeypatch.setenv("RAY_worker_niceness", "0")

    class Deadly(Task):
        def __call__(self, places):
            if self.library is not None and 5 in places:
                # The others have long come back.
                time.sleep(5.0)
                os.kill(os.getpid(), signal.SIGKILL)
            return super().__call__(places)

    with monkeypatch.context() as patch:
        patch.setattr(import_module("servotune.floor.run"), "Task", Deadly)
        patch.setattr(over_ray, "TRIES", 1)
        with pytest.raises(floor.EngineFailed, match="5 of 6 slots are done and kept"):
            floor.run(fleet, engine="ray", out=tmp_path, name="one", workers=2, batch=1)
    floor.run(fleet, out=tmp_path, name="one")
    same(tmp_path, alone)


def test_dask(fleet, alone, tmp_path):
    pytest.importorskip("distributed")
    floor.run(fleet, engine="dask", out=tmp_path, name="one", workers=2, batch=2)
    same(tmp_path, alone)


def test_dask_survives_dead_workers(fleet, alone, tmp_path, monkeypatch):
    """Every batch of slots kills its worker's process at the first try."""
    pytest.importorskip("distributed")
    survives_dead_workers("dask", fleet, alone, tmp_path, monkeypatch)


def test_dask_looks_for_no_worker_that_its_nanny_starts_again():
    """Dask drops a place for good where its worker is just starting again: the settings that keep it hold where its cluster is made."""
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    from servotune.floor import over_dask

    with over_dask.engine(1):
        waits = dask.utils.parse_timedelta(dask.config.get("distributed.deploy.lost-worker-timeout"))
        assert waits > 7 * 86400 and dask.config.get("distributed.scheduler.worker-saturation") == 1.0


def test_spark(fleet, alone, tmp_path):
    pytest.importorskip("pyspark")
    if shutil.which("java") is None:
        pytest.skip("Spark needs Java: apt-get install default-jre-headless")
    floor.run(fleet, engine="spark", out=tmp_path, name="one", workers=2, batch=2)
    same(tmp_path, alone)


def test_a_run_goes_on_where_it_ended(fleet, alone, tmp_path, monkeypatch):
    def torn(task, batches):
        """An engine that dies after one batch, and gives that one twice."""
        yield task(batches[0])
        yield task(batches[0])
        if task.library is not None:
            raise RuntimeError("the node is gone")
        for batch in batches[1:]:
            yield task(batch)

    from servotune.floor import local

    with monkeypatch.context() as patch:
        patch.setattr(local, "engine", lambda workers: nullcontext(torn))
        with pytest.raises(floor.EngineFailed, match="the node is gone; 2 of 6 slots are done and kept"):
            floor.run(fleet, out=tmp_path, name="one", batch=2)
    said = []
    floor.run(fleet, out=tmp_path, name="one", said=said.append)
    assert "slots: 4 of 6 left" in said
    same(tmp_path, alone)


def test_refusals(tmp_path):
    with pytest.raises(ValueError, match="expected one of: local, ray, dask, spark"):
        floor.run("FLEET.toml", engine="abacus", out=tmp_path)
    with pytest.raises(ValueError, match="expected spec= and controller="):
        floor.run(tmp_path, out=tmp_path)
    with pytest.raises(st.FleetRefused, match="FLEET.toml"):
        floor.run(tmp_path / "FLEET.toml", out=tmp_path / "out")


def test_numbers_and_packages_that_are_not_there(fleet, tmp_path, monkeypatch):
    for words, said in [({"batch": 0}, "batch: found 0"), ({"workers": -1}, "workers: found -1"), ({"pages": -2}, "pages: found -2")]:
        with pytest.raises(ValueError, match=said):
            floor.run(fleet, out=tmp_path / "none", **words)
    assert not (tmp_path / "none").exists()
    # As on a machine without Dask.
    monkeypatch.setitem(sys.modules, "dask", None)
    with pytest.raises(ImportError, match=r"engine dask: found no package 'dask'; expected it here: pip install 'servotune\[dask\]'"):
        floor.run(fleet, engine="dask", out=tmp_path)
