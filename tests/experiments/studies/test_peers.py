"""Tables of torchhd's classifiers and of networks, and why trainings ended."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.records.rows import pack_labels
from experiments.studies.recordings import peers as view
from experiments.studies.recordings.measure import recordings
from experiments.studies.recordings.view import STUDY

TRUTH = np.zeros(10, int)


def row(model, draw, right, **more):
    """A row of recordings with so many of ten right at each n, asked after 5, 50 … frames."""
    said = [pack_labels((np.arange(10) >= count).astype(int)) for count in right]
    place = {"seed": 0, "split": "counts", "draw": draw, "model": model}
    return {
        **place,
        "n_test": 10,
        "n": [5, 50][: len(right)],
        "predicted": said,
        **more,
    }


def labels():
    return {"labels": pack_labels(TRUTH)}


def test_peers_stand_beside_hdc_with_the_range_of_draws(tmp_path, write_measurement):
    rows = [
        row("hdc", 0, [5, 6], **labels()),
        row("torchhd_onlinehd", 0, [4, 8]),
        row("hdc", 1, [7, 6], **labels()),
        row("torchhd_onlinehd", 1, [6, 10]),
    ]
    part = configs.part("model", "torchhd_onlinehd")
    config = {"models": {"torchhd_onlinehd": {"model": dict(part["model"])}}}
    write_measurement("recordings_peers", rows, scene="gelsight", config=config)
    table = view.peers(Results(tmp_path).frame("recordings_peers"))
    few, many = table.to_dict("records")
    assert (few["n"], few["hdc"], few["torchhd_onlinehd"]) == (5, 0.6, 0.5)
    assert many["torchhd_onlinehd"] == 0.9
    assert (many["torchhd_onlinehd_low"], many["torchhd_onlinehd_high"]) == (0.8, 1.0)
    (made,) = STUDY.tables_of(Results(tmp_path))
    assert f"for {part['model']['epochs']} epochs" in made.note
    assert "unfinished" not in table


def test_only_the_split_that_counts_has_accuracies(tmp_path, write_measurement):
    rows = [
        row("hdc", 0, [5, 6], **labels()),
        row("hdc", 0, [9, 10], **labels()) | {"split": "random"},
    ]
    write_measurement("recordings_networks", rows, scene="tactip")
    few, many = view.networks(Results(tmp_path).frame("recordings_networks")).to_dict(
        "records"
    )
    assert (few["hdc"], few["hdc_high"], many["hdc"]) == (0.5, 0.5, 0.6)
    write_measurement("recordings_networks", rows[1:], scene="tactip")
    assert view.networks(Results(tmp_path).frame("recordings_networks")).empty


def test_networks_that_were_not_finished_are_counted(tmp_path, write_measurement):
    rows = [
        row("hdc", 0, [5, 6], **labels()),
        row("cnn1_centred", 0, [5, 7], stopped=["trained", "steps"]),
        row("hdc", 1, [5, 6], **labels()),
        row("cnn1_centred", 1, [5, 7], stopped=["trained", "diverged"]),
    ]
    write_measurement("recordings_networks", rows, scene="tactip")
    few, many = view.networks(Results(tmp_path).frame("recordings_networks")).to_dict(
        "records"
    )
    assert (few["unfinished"], many["unfinished"]) == ("0 of 2", "2 of 2")
    assert many["cnn1_centred"] == 0.7


def test_times_are_a_row_for_each_recording(tmp_path, write_measurement):
    rows = [{"model": name, "n": 50, "fit_s": s} for name, s in (("hdc", 1), ("x", 2))]
    write_measurement("peers_costs", rows, scene="gelsight")
    (line,) = view.times(Results(tmp_path).frame("peers_costs")).to_dict("records")
    assert line == {"recording": "gelsight", "n": 50, "hdc": 1, "x": 2}


def test_without_records_there_is_no_table(tmp_path, write_measurement):
    write_measurement("recordings", [row("hdc", 0, [5], **labels())], scene="gelsight")
    names = {table.name for table in STUDY.tables_of(Results(tmp_path))}
    assert not names & {"peers", "peers_times", "networks"}


@pytest.mark.usefixtures("one_thread")
def test_rows_say_why_a_training_by_steps_ended(recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True)
    found = recordings.rows(
        run,
        of,
        {"counts": {"kind": "random", "test_fraction": 0.5}},
        {"hdc": configs.part("model", "hdc")},
        [1, 5],
        draws=1,
        by_steps={"softmax": configs.part("model", "softmax")},
        stop={"least_steps": 1, "most_steps": 3, "loss": 0.0},
        steps_n=[1, 5],
    )
    of_hdc, of_softmax = found
    assert "stopped" not in of_hdc
    assert of_softmax["stopped"] == ["steps", "steps"]
