"""The footprint: what is loaded is what the scene needs, in a process of its own."""

import subprocess

import pytest

from experiments.protocol.task import Context
from experiments.studies.footprint import measure
from tests.experiments import composed

NEEDED = composed.task("footprint")["needed"]


def rows_of(scene):
    return measure.Footprint([scene], ["hdc"], 3, NEEDED).rows(Context())


def test_a_scene_has_what_it_needs_and_no_more():
    (row,) = rows_of("touch")
    assert (row["status"], row["loaded"]) == ("ok", "scipy")
    assert 0 < row["torch_s"] < row["first_prediction_s"]
    assert 1e7 < row["peak_bytes"] < row["every_bytes"]


def test_a_process_that_fails_ends_the_experiment():
    with pytest.raises(subprocess.CalledProcessError, match="nowhere"):
        next(rows_of("nowhere"))
