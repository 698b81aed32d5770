"""The numbers of a row against the records they come from, and what stands around a table."""

import json

import numpy as np
import pytest
from scipy.stats import binomtest

from experiments.records import configs, record
from experiments.records.results import Results
from experiments.reporting import rows
from experiments.reporting.estimates import least_variance, mean_interval
from experiments.reporting.rows import COLUMNS, display_name, published_row, swept
from experiments.reporting.table import Table, frame


def epochs(*accuracies, step=10.0):
    return [
        {"training_s": step * (k + 1), "loss": 1.0, "train_accuracy": a, "test_accuracy": a}
        for k, a in enumerate(accuracies)
    ]


def line(tmp_path, model, n_train=None, pixels=None):
    results = Results(tmp_path)
    hdc = results.group("touch", "hdc", n_train, pixels)
    return rows.row(results.group("touch", model, n_train, pixels), hdc)


def test_numbers_are_those_of_the_records(tmp_path, write_run, read_run):
    times = [0.4, 0.3, 0.35]
    ids = [
        write_run("hdc", seed=s, wrong=range(s), curve=[{"training_s": t, "train_accuracy": a}])
        for s, (t, a) in enumerate(zip(times, (1, 0.9, 0.95), strict=True))
    ]
    row, records = line(tmp_path, "hdc"), [read_run(i) for i in ids]
    assert (row["seeds"], row["status"]) == (3, "ok")
    assert row["code"] == records[0]["environment"]["code"][:12]
    assert row["training_time_s"] == pytest.approx(np.median(times))
    assert row["training_time_q25_s"] == pytest.approx(np.quantile(times, 0.25))
    assert row["training_time_q75_s"] == pytest.approx(np.quantile(times, 0.75))
    assert row["train_accuracy_max"] == pytest.approx(
        np.mean([record["train_accuracy_max"] for record in records])
    )
    assert row["test_accuracy_final"] == pytest.approx((300 - 0 - 1 - 2) / 300)
    student = mean_interval([1, 0.99, 0.98], least_variance([1, 0.99, 0.98], 100))
    assert (row["test_ci_low"], row["test_ci_high"]) == pytest.approx((student.low, 1))
    assert (row["n_train"], row["pixels"], row["model_bytes"]) == (400, 250_000, 1000)
    assert (row["predict_single_s"], row["cpu"], row["threads"]) == (1e-3, "A CPU", 2)
    assert "over_hdc" not in row


def test_a_model_is_compared_with_hdc_on_the_same_samples(tmp_path, write_run):
    for seed in range(2):
        write_run("hdc", seed=seed, wrong=[0])
        write_run("ridge", seed=seed, wrong=range(1 + 4 * seed))
    made = Table("t", "T", frame([line(tmp_path, "ridge")]), COLUMNS)
    shown = dict(zip(made.heads, *made.cells(), strict=True))
    assert shown["− HDC, points [95 %]"] == "−2.0 [−27.4, +23.4]"
    assert shown["Seeds above, below HDC"] == "0, 1"


def test_the_time_of_an_iterative_model_is_that_to_90_percent(tmp_path, write_run):
    write_run("hdc", curve=[{"training_s": 2.0}])
    write_run("cnn1", curve=epochs(0.5, 0.9, 0.95, 0.99))
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == row["time_to_90_train_s"] == 30.0  # 0.9 does not exceed 90 %
    assert row["total_time_s"] == 40.0
    assert row["training_time_over_hdc"] == pytest.approx(15.0)


def test_not_reached_is_said_never_a_number(tmp_path, write_run):
    write_run("hdc")
    write_run("cnn1", curve=epochs(0.5, 0.6))
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == "not reached in 20 s"
    assert row["training_time_over_hdc"] is None
    assert rows.time_cell(row) == "not reached in 20 s"
    for seed, curve in ((1, epochs(0.95)), (2, epochs(0.5, 0.95))):
        write_run("cnn1", seed=seed, curve=curve)
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == 20.0
    assert row["training_time_q75_s"] == "not reached in 20 s"
    assert rows.time_cell(row) == "20.0 (15.0…> 20)"


def test_maxima_that_a_record_does_not_have_cost_their_cells_only(tmp_path, write_run):
    """So it is where every loss is NaN."""
    identity = write_run("hdc", train_accuracy_max=None, test_accuracy_max=None)
    (tmp_path / "runs" / identity / "curve.csv").write_text("training_s,loss\n0.5,nan\n")
    row = line(tmp_path, "hdc")
    assert row["train_accuracy_max"] is row["test_accuracy_max"] is None
    assert row["test_accuracy_final"] == 1
    write_run("hdc", seed=1, curve=[{"training_s": 0.5, "train_accuracy": 0.8}])
    assert line(tmp_path, "hdc")["train_accuracy_max"] == 0.8


def test_published_numbers_stand_beside_the_models_that_have_any():
    row = published_row("softmax")
    assert row["published_training_time_s"] == 170
    assert row["published_train_accuracy"] == pytest.approx(0.992)
    assert row["published_training_time_over_hdc"] == pytest.approx(170 / 1.24)
    wilson = binomtest(90, 100).proportion_ci(0.95, "wilson")
    assert row["published_test_ci_low"] == pytest.approx(wilson.low)
    assert set(published_row("ridge").values()) == {None}


def test_a_row_without_runs_is_missing_and_stays(tmp_path):
    row = line(tmp_path, "cnn3")
    assert (row["status"], row["seeds"]) == ("missing", 0)
    made = Table("t", "T", frame([row]), COLUMNS)
    shown = dict(zip(made.heads, *made.cells(), strict=True))
    assert shown["Training time, s"] == "missing"
    assert shown["Test accuracy, %, final [95 %]"] == "–"


def test_failures_and_their_errors_are_told(tmp_path, write_run):
    write_run("cnn3", status="failed", error="RuntimeError: no memory")
    assert line(tmp_path, "cnn3")["status"] == "failed: RuntimeError: no memory"
    write_run("cnn3", seed=1, curve=epochs(0.95))
    assert line(tmp_path, "cnn3")["status"] == "1 more failed: RuntimeError: no memory"
    write_run("cnn3", curve=epochs(0.95), stop="quick")  # seed 0, which failed with stop=paper
    assert line(tmp_path, "cnn3")["seeds"] == 1


def test_a_sweep_has_a_row_for_all_that_it_asks_for(tmp_path, a_full_set):
    params = configs.sweep("accuracy_vs_n")
    found = swept(Results(tmp_path), ["accuracy_vs_n"])
    assert len(found) == len(params["model"]) * len(params["split.n_train"])
    assert {row["model"] for row in found} == set(params["model"])
    measured = {(row["model"], row["n_train"]): row["seeds"] for row in found if row["seeds"]}
    assert measured["hdc", 20] == measured["ridge", 100] == 2
    twice = swept(Results(tmp_path), ["accuracy_vs_n", "accuracy_vs_n"])
    assert len(twice) == len(found)


@pytest.mark.parametrize(
    "experiment",
    ["table1", "table1_extended", "accuracy_vs_n", "accuracy_vs_n_cnn", "accuracy_vs_d",
     "work_precision"],
)  # fmt: skip
def test_every_model_of_an_experiment_has_a_config_and_a_name(experiment):
    params = configs.sweep(experiment)
    for model in params["model"]:
        assert configs.of_model(model) is not None
        assert configs.display(model)["colour"] != "#666666"
    assert all(configs.of_scene(scene) for scene in params["scene"])
    for key in ("split.n_train", "data.pixels"):
        assert configs.numbers(params.get(key, ["null"]))


# Around a table -----------------------------------------------------------------------------------


def test_names_keep_what_was_changed():
    assert display_name("cnn1") == "CNN, 1 layer"
    assert display_name("cnn1 (lr=0.01)") == "CNN, 1 layer (lr=0.01)"
    assert display_name("of_my_own") == "of_my_own"


def test_a_caption_says_where_the_frames_are_from_and_on_what_they_were_timed(tmp_path, write_run):
    assert rows.caption([line(tmp_path, "hdc")], "Some") == ("Some, on the scene “touch”: no runs.")
    write_run("hdc")
    assert rows.caption([line(tmp_path, "hdc")], "Some") == (
        "Some, on simulated frames, scene “touch”. Measured on A CPU, 2 threads."
    )


def test_notes_name_what_was_stopped_early(tmp_path, write_run):
    write_run("hdc")
    write_run("cnn1", curve=epochs(0.95), stop="reached")
    shown = rows.columns("Model", "Status")
    assert "reached" not in rows.notes([line(tmp_path, "hdc")], shown)
    stopped = {**line(tmp_path, "cnn1"), "stop": "steps; reached"}
    assert "reached (*): stopped at 90 % in training" in rows.notes([stopped], shown)


def test_notes_are_of_the_columns_that_are_there(tmp_path, write_run):
    write_run("hdc")
    lines = [line(tmp_path, "hdc")]
    for head in ("Training time, s", "− HDC, points [95 %]"):
        said = rows.notes(lines, rows.columns(head))
        assert [name in said for name in ("Training time:", "− HDC:")] == [
            head.startswith(name) for name in ("Training", "−")
        ]


def test_a_command_for_all_models_with_the_same_seeds(tmp_path, write_run):
    for model, seeds in (("hdc", 2), ("softmax", 2), ("cnn1", 1)):
        for seed in range(seeds):
            write_run(model, seed=seed)
    results = Results(tmp_path)
    groups = [results.group("touch", model) for model in ("hdc", "softmax", "cnn1", "cnn3")]
    command = "python -m experiments.run -m scene=touch model={} stop=paper seed.run={}"
    assert rows.commands(groups) == [
        command.format("hdc,softmax", "0,1"), command.format("cnn1", "0"),
    ]  # fmt: skip
    assert rows.commands(groups[3:]) == []


def test_a_command_says_what_was_changed_and_how_many_samples_there_were(tmp_path, write_run):
    write_run("cnn1", change={"model.lr": 0.01}, n_train=20, pixels=100)
    (group,) = Results(tmp_path).groups()
    assert rows.commands([group]) == [
        "python -m experiments.run -m scene=touch model=cnn1 stop=paper seed.run=0 "
        "split.n_train=20 data.pixels=100 model.lr=0.01"
    ]


def test_a_command_says_where_a_recording_lies_and_keeps_what_was_changed_apart(
    tmp_path, write_run
):
    write_run("hdc")
    write_run("ridge")
    write_run("ridge", change={"model.alpha": 2.0})
    for path in tmp_path.glob("runs/*/record.json"):
        entry = json.loads(path.read_text())
        entry["config"]["scene"]["path"] = "/my frames/$a.npz"
        model, seen = entry["choices"]["model"], entry["scene"]["fingerprint"]
        entry["id"] = record.run_id("touch", model, entry["config"], seen)
        path.write_text(json.dumps(entry))
        path.parent.rename(path.parent.with_name(entry["id"]))
    found = rows.commands(Results(tmp_path).groups())
    start = "python -m experiments.run -m scene=touch 'scene.path=/my frames/$a.npz' model="
    assert sorted(found) == [
        f"{start}hdc,ridge stop=paper seed.run=0",
        f"{start}ridge stop=paper seed.run=0 model.alpha=2.0",
    ]
