"""The footprint: what is loaded is what the scene needs, in a process of its own."""

import subprocess

import pytest

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.footprint import measure
from experiments.studies.footprint.view import STUDY

NEEDED = configs.task("footprint")["needed"]


def rows_of(scene, model="hdc"):
    return measure.footprint.rows(
        Run(), scenes=[scene], models=[model], frames=3, needed=NEEDED
    )


def test_a_scene_has_what_it_needs_and_no_more(tmp_path, write_measurement, drawn):
    (row,) = rows_of("touch")
    assert row["status"] == "ok"
    assert row["loaded"] == "scipy"
    assert 0 < row["torch_s"] < row["first_prediction_s"]
    assert 1e7 < row["peak_bytes"] < row["every_bytes"]
    skipped = {"scene": "fibre", "model": "hdc", "status": "skipped: no data"}
    write_measurement("footprint", [row, skipped])
    (table,) = STUDY.tables_of(Results(tmp_path))
    assert [cells[:2] for cells in table.cells()] == [
        ["touch", "HDC"],
        ["fibre", "HDC"],
    ]
    assert [cells[-1] for cells in table.cells()] == ["ok", "skipped: no data"]
    words = drawn(STUDY)["footprint"]
    assert f"−{(row['every_bytes'] - row['peak_bytes']) / 1e6:.3g}" in words


def test_a_process_that_fails_ends_the_experiment():
    with pytest.raises(subprocess.CalledProcessError, match="nowhere"):
        next(rows_of("nowhere"))
