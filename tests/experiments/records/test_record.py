"""Records: what is written is read again, and what is no record is named and skipped."""

import json

import pytest

from experiments.records import store
from experiments.records.rows import pack_labels


def lines(folder):
    return (folder / store.FILE).read_bytes().splitlines(keepends=True)


def test_a_run_is_read_as_it_was_written(tmp_path, write_run, write_measurement):
    curve = [
        {"training_s": 1.0, "loss": float("inf")},  # JSON has none: it is missing
        {"training_s": 2.0, "loss": 0.1, "epoch": 1.0},
    ]
    truth = [0] * 1000
    name = write_run("softmax", seed=3, wrong=range(7), curve=curve, truth=truth)
    (run,) = store.read(tmp_path)
    assert (run.id, run.config["seed"]["run"], run.status) == (name, 3, "finished")
    assert (run.results["right"], run.results["iterative"]) == (993, True)
    assert "training_s" not in run.results
    assert len(run.results["predicted"]) < 60
    first, second = run.curve
    assert not {"loss", "epoch"} & set(first)
    assert second["epoch"] == 1.0
    assert store.find(tmp_path, name) == run
    assert store.find(tmp_path, "touch-hdc-000000000000") is None
    # A reference is taken over record by record, and each call of it leaves the same bytes.
    write_measurement("drift", [{"a": 1, "b": None}, {"a": 0.1, "b": "x"}])
    before = lines(tmp_path)
    store.write_all(tmp_path, list(store.read(tmp_path)))
    assert lines(tmp_path) == before


RESULTS = [
    (
        "predicted",
        pack_labels([0]),
        "predicted: expected 100 labels from 0 to 4, found 1 to 0",
    ),
    ("predicted", pack_labels([5] * 100), "labels from 0 to 4, found 100 to 5"),
    ("n_test", None, "labels: expected None labels from 0 to 4, found 100"),
    ("test_accuracy_final", 0.9, "expected 1.000000 of the predictions beside it, f"),
]


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("schema", 7, "schema"),
        ("config", {}, "config.seed.run: expected a value, found none"),
        ("config.split", {}, "config.split.n_train: expected a value, found none"),
        ("rows", {}, "results: expected 'n_test', found none"),
        *((f"results.{key}", *rest) for key, *rest in RESULTS),
    ],
)
def test_a_malformed_record_is_named_with_its_key_and_skipped(
    tmp_path, write_run, key, value, expected
):
    write_run("hdc")
    entry = json.loads(lines(tmp_path)[0])
    group, _, name = key.rpartition(".")
    if group == "results":
        entry["rows"]["values"][-1][entry["rows"]["columns"].index(name)] = value
    else:
        (entry[group] if group else entry)[name] = value
    (tmp_path / store.FILE).write_text(json.dumps(entry))
    (error,) = store.read(tmp_path)
    assert str(error).startswith(f"{tmp_path / store.FILE}, line 1: ")
    assert expected in str(error)
