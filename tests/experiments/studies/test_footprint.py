"""The footprint: what is loaded is what the scene needs, in a process of its own."""

import subprocess

import pytest

from experiments.protocol.experiment import Run
from experiments.records.results import Results
from experiments.studies.footprint import measure
from experiments.studies.footprint.view import STUDY


def test_a_scene_has_what_it_needs_and_no_more(tmp_path, write_measurement):
    (row,) = measure.footprint.rows(Run(), scenes=["touch"], models=["hdc"], frames=3)
    assert row["status"] == "ok"
    assert row["loaded"] == "scipy"
    assert 0 < row["torch_s"] < row["first_prediction_s"]
    assert row["peak_bytes"] > row["torch_bytes"] > 1e7
    write_measurement("footprint", [row])
    (table,) = STUDY.tables_of(Results(tmp_path))
    (cells,) = table.cells()
    assert cells[:2] == ["touch", "HDC"]
    above = row["peak_bytes"] - row["torch_bytes"]
    assert table.csv().splitlines()[1].endswith(f",{above}")


def test_a_scene_without_data_is_a_row_that_says_so(tmp_path, write_measurement):
    full = dict.fromkeys(("torch_s", "first_prediction_s", "frame_s"), 1.0)
    full |= {"scene": "fibre", "model": "hdc", "modules": 9, "loaded": "", "status": "ok"}
    full |= {"peak_bytes": 3 * 10**6, "torch_bytes": 10**6}
    skipped = {"scene": "fibre", "model": "hdc", "status": "skipped: no data"}
    write_measurement("footprint", [full, skipped])
    (table,) = STUDY.tables_of(Results(tmp_path))
    assert [cells[-1] for cells in table.cells()] == ["ok", "skipped: no data"]
    assert "2.00 MB" in table.cells()[0]


def test_a_process_that_fails_says_why(monkeypatch):
    failed = subprocess.CompletedProcess([], 1, stdout="", stderr="no such scene\n")
    monkeypatch.setattr(measure.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(RuntimeError, match="footprint of nowhere, hdc: no such scene"):
        next(measure.footprint.rows(Run(), scenes=["nowhere"], models=["hdc"], frames=5))
