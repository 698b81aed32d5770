"""The numbers of a row against the records they come from; which records a row takes."""

import csv
import io
import json
import re

import hydra
import numpy as np
import pytest
from omegaconf import OmegaConf
from scipy.stats import binomtest

from experiments import pooling, table_text, tables
from experiments.selection import Records, numbers, sweep


def epochs(*accuracies, step=10.0):
    return [
        {"training_s": step * (k + 1), "loss": 1.0, "train_accuracy": a, "test_accuracy": a}
        for k, a in enumerate(accuracies)
    ]


def line(tmp_path, model, n_train=None, pixels=None):
    records = Records(tmp_path)
    hdc = records.group("touch", "hdc", n_train, pixels)
    return tables.row(records.group("touch", model, n_train, pixels), hdc)


def test_numbers_are_those_of_the_records(tmp_path, write_run, read_run):
    times = [0.4, 0.1, 0.3]
    ids = [
        write_run("hdc", seed=s, wrong=range(s), curve=[{"training_s": t, "train_accuracy": a}])
        for s, (t, a) in enumerate(zip(times, (1, 0.9, 0.95), strict=True))
    ]
    row, records = line(tmp_path, "hdc"), [read_run(i) for i in ids]
    assert row["seeds"] == 3
    assert row["status"] == "ok"
    assert row["training_time_s"] == pytest.approx(np.median(times))
    assert row["training_time_q25_s"] == pytest.approx(np.quantile(times, 0.25))
    assert row["training_time_q75_s"] == pytest.approx(np.quantile(times, 0.75))
    assert row["train_accuracy_max"] == pytest.approx(
        np.mean([r["train_accuracy_max"] for r in records])
    )
    assert row["test_accuracy_final"] == pytest.approx((300 - 0 - 1 - 2) / 300)
    wilson = binomtest(297, 300).proportion_ci(0.95, "wilson")
    assert (row["test_ci_low"], row["test_ci_high"]) == pytest.approx((wilson.low, wilson.high))
    assert row["n_train"] == 400
    assert row["pixels"] == 250_000
    assert row["model_bytes"] == 1000
    assert row["code"] == "current"


def test_the_time_of_an_iterative_model_is_that_to_90_percent(tmp_path, write_run):
    write_run("hdc", curve=[{"training_s": 2.0}])
    write_run("cnn1", curve=epochs(0.5, 0.9, 0.95, 0.99))
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == row["time_to_90_train_s"] == 30.0  # 0.9 does not exceed 90 %
    assert row["total_time_s"] == 40.0
    assert row["training_time_over_hdc"] == pytest.approx(15.0)
    assert row["published_training_time_over_hdc"] == pytest.approx(101.3 / 1.24)


def test_not_reached_is_said_never_a_number(tmp_path, write_run):
    write_run("hdc")
    write_run("cnn1", curve=epochs(0.5, 0.6))
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == "not reached in 20 s"
    assert row["training_time_over_hdc"] is None
    assert table_text.time_cell(row) == "not reached in 20 s"
    for seed, curve in ((1, epochs(0.95)), (2, epochs(0.5, 0.95))):
        write_run("cnn1", seed=seed, curve=curve)
    row = line(tmp_path, "cnn1")
    assert row["training_time_s"] == 20.0
    assert row["training_time_q75_s"] == "not reached in 20 s"
    assert table_text.time_cell(row) == "20.0 (15.0…> 20)"


def test_mcnemar_is_exact_on_the_same_samples(tmp_path, write_run):
    for seed in (0, 1):
        write_run("hdc", seed=seed, wrong=[0])
        write_run("softmax", seed=seed, wrong=[0, 1, 2, 3], curve=epochs(0.95))
    row = line(tmp_path, "softmax")
    assert row["mcnemar_p"] == pytest.approx(binomtest(0, 6).pvalue)  # 3 a seed, HDC alone right
    write_run("hdc", seed=2)
    write_run("softmax", seed=2, wrong=range(50), curve=epochs(0.95),
              data_sha256={"train": "", "test": "others"})  # fmt: skip
    assert line(tmp_path, "softmax")["mcnemar_p"] == pytest.approx(binomtest(0, 6).pvalue)
    assert line(tmp_path, "hdc")["mcnemar_p"] is None


def test_published_numbers_have_the_interval_of_100_samples(tmp_path):
    row = line(tmp_path, "softmax")
    assert row["published_training_time_s"] == 170
    assert row["published_train_accuracy"] == pytest.approx(0.992)
    wilson = binomtest(90, 100).proportion_ci(0.95, "wilson")
    assert row["published_test_ci_low"] == pytest.approx(wilson.low)
    assert line(tmp_path, "softmax", n_train=20)["published_training_time_s"] is None
    assert line(tmp_path, "ridge")["published_training_time_s"] is None


# Which records ------------------------------------------------------------------------------------


def test_a_row_without_records_is_missing_and_stays(tmp_path):
    rows = tables.table1(Records(tmp_path))
    assert [r["model"] for r in rows] == ["hdc", "softmax", "cnn1", "cnn3"]
    assert {r["status"] for r in rows} == {"missing"}
    assert [r["published_training_time_s"] for r in rows] == [1.24, 170, 101.3, 441.3]


def test_failures_are_told(tmp_path, write_run):
    write_run("cnn3", status="failed", error="RuntimeError: no memory")
    assert line(tmp_path, "cnn3")["status"] == "failed: RuntimeError: no memory"
    write_run("cnn3", seed=1, curve=epochs(0.95))
    row = line(tmp_path, "cnn3")
    assert row["status"] == "1 more failed: RuntimeError: no memory"
    assert row["seeds"] == 1
    write_run("cnn3", curve=epochs(0.95), stop="quick")  # seed 0, which failed with stop=paper
    assert line(tmp_path, "cnn3")["seeds"] == 1


def test_selection_is_by_content_not_by_name(tmp_path, write_run):
    write_run("softmax", curve=epochs(0.95), change={"model.lr": 1e-2})
    write_run("softmax", curve=epochs(0.95), change={"split.kind": "ordered"})
    write_run("softmax", curve=epochs(0.95), change={"scene.samples_per_class": 20})
    records = Records(tmp_path)
    assert records.group("touch", "softmax").status == "missing"
    assert len(records.skipped) == 3
    write_run("softmax", curve=epochs(0.95), change={"seed.split": 7, "stop.budget_s": 5})
    assert line(tmp_path, "softmax")["seeds"] == 1


def test_stops_are_not_mixed_but_what_finished_by_itself_counts_with_any(tmp_path, write_run):
    write_run("cnn1", seed=0, curve=epochs(0.95), stop="quick")
    write_run("cnn1", seed=1, curve=epochs(0.95), stop="quick")
    assert line(tmp_path, "cnn1")["seeds"] == 2
    write_run("cnn1", seed=2, curve=epochs(0.95, 0.99), stop="paper")
    row = line(tmp_path, "cnn1")
    assert (row["seeds"], row["train_accuracy_max"]) == (1, 0.99)
    for seed, stop in ((0, "quick"), (0, "paper"), (1, "reached")):
        write_run("hdc", seed=seed, stop=stop)
    assert line(tmp_path, "hdc")["seeds"] == 2


def test_all_samples_asked_for_by_number_are_all_samples(tmp_path, write_run):
    write_run("hdc", seed=0)
    write_run("hdc", seed=1, n_train=400)
    write_run("hdc", seed=0, n_train=100)
    assert line(tmp_path, "hdc")["seeds"] == line(tmp_path, "hdc", n_train=400)["seeds"] == 2
    assert line(tmp_path, "hdc", n_train=100)["seeds"] == 1


def test_other_devices_and_broken_files_are_left_out(tmp_path, write_run):
    write_run("hdc", change={"device": "cuda"})
    for name, text in (("a", "{"), ("b", "[]"), ("c", '{"schema": 1, "status": "finished"}')):
        (tmp_path / "runs" / name).mkdir()
        (tmp_path / "runs" / name / "record.json").write_text(text)
    (tmp_path / "runs" / "empty").mkdir()
    records = Records(tmp_path)
    assert records.group("touch", "hdc").status == "missing"
    assert [p.split(":")[0] for p in records.problems] == ["a", "b", "c"]
    assert Records(tmp_path, "cuda").group("touch", "hdc").status == "ok"


OLD = {"code": "0" * 64, "sources": {"hdc/bits.py": "0" * 12}}


def test_runs_of_other_code_are_never_pooled_with_those_of_todays(tmp_path, write_run):
    for seed in (1, 2):
        write_run("hdc", seed=seed, environment={"cpu": "A CPU", "threads": 2, **OLD})
    write_run("hdc", seed=0)
    row = line(tmp_path, "hdc")
    assert (row["seeds"], row["code"]) == (1, "current")
    assert row["status"] == "2 more left out: made by other code"


def test_a_row_of_other_code_says_so(tmp_path, write_run):
    write_run("softmax", environment={"cpu": "A CPU", "threads": 2, **OLD})
    write_run("hdc")
    rows = tables.table1(Records(tmp_path))
    row = next(r for r in rows if r["model"] == "softmax")
    assert row["code"] == "hdc/bits.py"
    assert "other code than this (hdc/bits.py changed since): Softmax" in table_text.notes(rows)


def seen_by(fingerprint):
    return {
        "name": "touch", "origin": "simulated", "classes": ["L1", "L2", "R1", "R2", "None"],
        "shape": [500, 500], "fingerprint": fingerprint,
    }  # fmt: skip


@pytest.fixture
def todays_frames(monkeypatch):
    monkeypatch.setattr(pooling, "fingerprint", lambda scene: "now")


def test_runs_of_other_frames_are_never_pooled_with_those_of_todays(
    tmp_path, write_run, todays_frames
):
    for seed in (1, 2):
        write_run("hdc", seed=seed, scene=seen_by("before"))
    assert line(tmp_path, "hdc")["status"] == "of other frames than the scene's now"
    assert line(tmp_path, "hdc")["seeds"] == 2
    write_run("hdc", seed=0, scene=seen_by("now"))
    row = line(tmp_path, "hdc")
    assert (row["seeds"], row["status"]) == (1, "2 more left out: of other frames")
    write_run("hdc", seed=3, scene=seen_by("now"), environment={"threads": 2, "cpu": "A", **OLD})
    status = line(tmp_path, "hdc")["status"]
    assert status == "1 more left out: made by other code; 2 more left out: of other frames"


def test_the_fingerprint_of_today_is_that_of_the_scene_as_configured(composed):
    cfg = composed("touch", "hdc", "paper")
    scene = OmegaConf.to_container(cfg, resolve=True)["scene"]
    today = pooling.fingerprint(json.dumps(scene))
    assert today == hydra.utils.instantiate(cfg.scene, _convert_="all").fingerprint()
    scene["sensor"]["seed"] += 1
    assert pooling.fingerprint(json.dumps(scene)) not in (None, today)
    gone = {"_target_": "scenes.recorded.open_recording", "path": "nowhere"}
    assert pooling.fingerprint(json.dumps(gone)) is None


def test_frames_of_today_are_known_again_from_a_record_on_disk(tmp_path, write_run, composed):
    """A record is written with its keys sorted; the order of the classes is part of the frames."""
    scene = hydra.utils.instantiate(composed("touch", "hdc", "paper").scene, _convert_="all")
    write_run("hdc", scene=seen_by(scene.fingerprint()))
    assert line(tmp_path, "hdc")["status"] == "ok"
    write_run("hdc", scene=seen_by("f" * 64))
    assert line(tmp_path, "hdc")["status"] == "of other frames than the scene's now"


def test_other_test_samples_of_the_same_seed_are_told(tmp_path, write_run):
    write_run("hdc")
    write_run("ridge")
    write_run("correlation", data_sha256={"train": "a", "test": "others"})
    write_run("ridge", seed=1)
    assert line(tmp_path, "hdc")["status"] == line(tmp_path, "ridge")["status"] == "ok"
    assert line(tmp_path, "correlation")["status"] == (
        "1 with other test samples than other models of the same seed"
    )
    write_run("hdc", seed=1, data_sha256={"train": "a", "test": "others"})  # one against one
    for model in ("hdc", "ridge"):
        assert line(tmp_path, model)["status"].startswith("1 with other test samples")


def test_times_taken_beside_other_runs_are_told(tmp_path, write_run):
    write_run("hdc", environment={"cpu": "A", "threads": 2, "exclusive": False, **OLD})
    assert line(tmp_path, "hdc")["status"] == "1 timed beside other runs"


@pytest.mark.parametrize(
    "experiment",
    ["table1", "table1_extended", "accuracy_vs_n", "accuracy_vs_n_cnn", "accuracy_vs_d",
     "work_precision"],
)  # fmt: skip
def test_every_model_of_an_experiment_has_a_config_and_a_name(experiment, composed):
    params = sweep(experiment)
    for model in params["model"]:
        composed(params["scene"][0], model, params["stop"][0])
        assert model in table_text.NAMES
    numbers(params.get("split.n_train", []) + params.get("data.pixels", []))


# Text ---------------------------------------------------------------------------------------------


def test_csv_reads_back(tmp_path, a_full_set):
    rows = tables.table1(Records(tmp_path))
    read = list(csv.DictReader(io.StringIO(table_text.to_csv(rows, tables.TABLE1))))
    assert [r["model"] for r in read] == ["hdc", "softmax", "cnn1", "cnn3"]
    for text, row in zip(read, rows, strict=True):
        for key in tables.TABLE1:
            value = row.get(key)
            if isinstance(value, float):
                assert float(text[key]) == pytest.approx(value, rel=1e-5)
            else:
                assert text[key] == ("" if value is None else str(value))


def test_markdown_has_a_cell_for_every_column(tmp_path, a_full_set):
    rows = tables.table1(Records(tmp_path))
    text = table_text.to_markdown(rows, table_text.TABLE1_COLUMNS, "Table I")
    body = [x for x in text.splitlines() if x.startswith("|")]
    assert len(body) == 2 + len(rows)
    assert {x.count("|") for x in body} == {len(table_text.TABLE1_COLUMNS) + 1}
    assert "simulated frames" in text.splitlines()[0]
    assert "failed: RuntimeError: no memory" in body[-1]


def test_latex_is_balanced(tmp_path, write_run, a_full_set):
    write_run("ridge", status="failed", error=r"Odd: 50% of {a_b} & #1 \x ~ ^ $")
    rows = tables.table1(Records(tmp_path)) + tables.table1(Records(tmp_path), "table1_extended")
    text = table_text.to_latex(rows, table_text.TABLE1_COLUMNS, "Table I", "table1")
    assert re.findall(r"\\begin\{(\S+?)\}", text) == re.findall(r"\\end\{(\S+?)\}", text)[::-1]
    bare = re.sub(r"\\[{}&%#$_]", "", text)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    body = bare[bare.index("\\midrule") : bare.index("\\bottomrule")].strip().splitlines()[1:]
    assert len(body) == len(rows)
    assert {x.count("&") for x in body} == {len(table_text.TABLE1_COLUMNS) - 1}
    assert all(x.endswith(r"\\") for x in body)
    for rule in ("toprule", "midrule", "bottomrule"):
        assert text.count(rule) == 1
    assert "%" not in bare.split("\n", 1)[1]
    assert bare.isascii() or set(re.sub(r"[\x00-\x7f]", "", bare)) <= set("é")


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0, "0"), (0.0439, "0.0439"), (1.24, "1.24"), (441.3, "441"), (1574.0, "1574"),
     (2e-5, "2.0e-05"), ("mixed", "mixed")],
)  # fmt: skip
def test_three_digits(value, text):
    assert table_text.number(value) == text
