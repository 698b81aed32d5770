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
    assert row["peak_bytes"] > 1e7
    skipped = {"scene": "fibre", "model": "hdc", "status": "skipped: no data"}
    write_measurement("footprint", [row, skipped])
    (table,) = STUDY.tables_of(Results(tmp_path))
    assert [cells[:2] for cells in table.cells()] == [
        ["touch", "HDC"],
        ["fibre", "HDC"],
    ]
    assert [cells[-1] for cells in table.cells()] == ["ok", "skipped: no data"]


def test_a_process_that_fails_ends_the_experiment():
    with pytest.raises(subprocess.CalledProcessError, match="nowhere"):
        next(
            measure.footprint.rows(Run(), scenes=["nowhere"], models=["hdc"], frames=5)
        )
