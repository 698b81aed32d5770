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
    table, left_out = STUDY.tables_of(Results(tmp_path))
    assert [cells[:2] for cells in table.cells()] == [
        ["touch", "HDC"],
        ["fibre", "HDC"],
    ]
    assert [cells[-1] for cells in table.cells()] == ["ok", "skipped: no data"]
    assert left_out.data.scene.tolist() == ["touch"]  # the other did not run
    assert left_out.data.scipy.tolist() == ["loaded"]
    assert left_out.data.pandas.tolist() == ["left out"]


def test_a_module_too_much_is_told_from_one_that_is_needed(
    tmp_path, write_measurement, drawn
):
    row = {"scene": "touch", "model": "hdc", "peak_bytes": 3e8, "torch_s": 1.0}
    row |= {"first_prediction_s": 2.0, "loaded": "pandas scipy"}
    write_measurement("footprint", [{**row, "status": "fails: loads pandas"}])
    _, left_out = STUDY.tables_of(Results(tmp_path))
    (line,) = left_out.data.to_dict("records")
    assert (line["pandas"], line["scipy"], line["cv2"]) == (
        "not needed",
        "loaded",
        "left out",
    )
    words = drawn(STUDY)["footprint"]
    assert "not needed" in words
    assert "300 MB" in words


def test_a_process_that_fails_ends_the_experiment():
    with pytest.raises(subprocess.CalledProcessError, match="nowhere"):
        next(
            measure.footprint.rows(Run(), scenes=["nowhere"], models=["hdc"], frames=5)
        )
