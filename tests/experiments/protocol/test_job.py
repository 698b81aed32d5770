"""One config, one record: named after what determines it, not repeated, kept when it breaks off."""

import io

import msgspec
import numpy as np
import pytest
import torch
from rich.console import Console

import hdc
from baselines import library
from experiments.protocol import job
from experiments.records import configs, locks, record, store
from experiments.records.environment import environment
from experiments.records.results import Results
from experiments.records.rows import unpack_labels


def the_record(results):
    (entry,) = store.read(results)
    return entry


def test_a_run_says_what_it_was_and_what_came_out(
    carry_out, results, frames_and_labels
):
    entry = carry_out()
    assert the_record(results) == entry
    assert (entry.status, entry.stop, entry.error) == ("finished", "finished", None)
    assert entry.scene.origin == "recorded"
    assert entry.scene.shape == (16, 16)
    assert entry.config["threads"] == entry.environment.threads == 1
    assert (entry.n_train, entry.n_test) == (40, 10)
    # Every figure again, from the predictions in the record.
    held = msgspec.json.decode((results / store.FILE).read_bytes())
    assert entry.test_accuracy_final == entry.right.mean()
    assert entry.train_accuracy_final == entry.train_accuracy_max > 0.5
    frames, labels = frames_and_labels()
    tested = unpack_labels(held["test_indices"])
    np.testing.assert_array_equal(entry.test_labels, labels[tested])
    train = np.setdiff1d(np.arange(50), tested)
    model = hdc.HDCClassifier().fit(frames[train], labels[train])
    np.testing.assert_array_equal(entry.predicted, model.predict(frames[tested]))
    assert entry.model_bytes == sum(
        t.nbytes for t in library.state_tensors(model).values()
    )
    assert 0 < entry.predict_single_s < 1
    assert 0 < entry.training_s < 10


def test_a_run_without_the_models_beside_it_that_are_asked_for_is_made_again(
    carry_out, results
):
    """Their times do not determine its id."""
    beside = "+beside.same.model._target_=hdc.HDCClassifier"
    alone = carry_out()
    both = carry_out(beside)
    assert (both.id, list(both.beside_s)) == (alone.id, ["same"])
    assert not carry_out.repeated
    for overrides in ([beside], []):
        assert carry_out(*overrides).beside_s == both.beside_s
        assert carry_out.repeated
    assert the_record(results) == both


IDENTITY = ["seed.run=1", "seed.pixels=7", "split.kind=ordered", "split.n_train=20",
            "data.pixels=100", "model.readout.ties=one", "scene.subsample=2"]  # fmt: skip


def test_the_id_is_a_function_of_config_and_data(carry_out, recording):
    path = recording()
    first = carry_out(scene=path).id
    ids = [carry_out(override, scene=path).id for override in IDENTITY]
    assert len({first, *ids}) == len(IDENTITY) + 1
    for override in ("force=true", "cache=false", "exclusive=false"):
        assert carry_out(override, scene=path).id == first
    torch.set_num_threads(2)
    assert carry_out(scene=path).id not in {first, *ids}
    torch.set_num_threads(1)
    with np.load(path) as held:
        frames, labels = held["frames"], held["labels"]
    frames[3, 0, 0] ^= 1
    np.savez(path, frames=frames, labels=labels)
    assert carry_out(scene=path).id not in {first, *ids}


def test_a_finished_run_is_not_repeated_unless_forced(carry_out, results, monkeypatch):
    first = carry_out()
    monkeypatch.setattr(job, "train_and_test", lambda *_: pytest.fail("run again"))
    assert carry_out() == first
    assert carry_out.repeated
    monkeypatch.setattr(
        job, "train_and_test", lambda *_: (_ for _ in ()).throw(ZeroDivisionError)
    )
    with pytest.raises(ZeroDivisionError):
        carry_out("force=true")
    assert the_record(results) == first  # the failed repetition leaves it


def test_a_run_that_other_code_finished_is_run_again_and_why_is_said(
    composed_run, results, one_thread
):
    cfg = composed_run("exclusive=false")
    choices = {"scene": "recorded", "model": "hdc", "stop": "paper"}

    def run():
        console = Console(record=True, width=300, file=io.StringIO())
        entry, repeated = job.run(cfg, choices, [], console)
        return entry, repeated, console.export_text()

    first, *_ = run()
    assert run() == (first, True, "")
    (line,) = (results / store.FILE).read_bytes().splitlines()
    held = msgspec.json.decode(line)
    held["revisions"] |= {"experiments": 0, "hdc.HDCClassifier": 0}
    (results / store.FILE).write_bytes(msgspec.json.encode(held))
    again, repeated, said = run()
    assert not repeated
    assert again.id == first.id
    assert again.revisions == first.revisions
    reasons = [
        f"{name} (revision 0, now {first.revisions[name]})"
        for name in ("experiments", "hdc.HDCClassifier")
    ]
    start = f"{first.id}: made again, finished otherwise: "
    assert said in [f"{start}{', '.join(some)}\n" for some in (reasons, reasons[::-1])]
    assert run()[1]
    assert len((results / store.FILE).read_bytes().splitlines()) == 2


def test_a_run_that_breaks_off_is_kept_and_run_again(
    carry_out, results, monkeypatch, fake
):
    """By an error here; tests/experiments/test_run.py has the signals."""
    real = hdc.HDCClassifier
    error = RuntimeError("out of memory" + 20_000 * "!")  # more than a record can hold
    # Neither the warm-up nor the first report fails.
    fake({"samples_seen": 1, "loss": 1.0}, error)
    with pytest.raises(RuntimeError):
        carry_out()
    entry = the_record(results)
    assert entry.status == "failed"
    assert entry.error.startswith("RuntimeError: out of memory")
    assert len(entry.error) <= 2000
    assert len(entry.curve) == 1
    monkeypatch.setattr(hdc, "HDCClassifier", real)
    again = carry_out()
    assert again == the_record(results)
    assert (again.id, again.status, again.error) == (entry.id, "finished", None)


def test_a_run_that_another_process_is_at_is_left_to_it(carry_out, results):
    entry = carry_out()
    with locks.held(results / "cache" / "locks" / entry.id):
        assert carry_out() == entry  # a finished run can be shown
        with pytest.raises(locks.Held, match=entry.id):
            carry_out("force=true")


# Nothing trained is lost --------------------------------------------------------------------------


def breaks(*_):
    raise RuntimeError("not that way")


def test_a_model_whose_size_is_not_known_is_finished_without_it(
    composed_run, results, one_thread, fake
):
    fake({"samples_seen": 1}, state_tensors=lambda self: {"w": [1]})
    console = Console(record=True, width=300, file=io.StringIO())
    choices = {"scene": "recorded", "model": "hdc", "stop": "paper"}
    entry, _ = job.run(composed_run("exclusive=false"), choices, [], console)
    assert entry.model_bytes is None
    assert (
        "model_bytes: not known, 'list' object has no attribute"
        in console.export_text()
    )


def test_a_model_that_cannot_predict_in_the_end_leaves_its_times_and_curve(
    carry_out, results, fake
):
    calls = []

    def predict(self, frames):
        calls.append(len(frames))
        if len(calls) > 5:  # one in the warm-up, two a report
            raise RuntimeError("not that way")
        return np.zeros(len(frames), np.int64)

    fake(
        {"samples_seen": 1, "loss": 2.0},
        {"samples_seen": 2, "loss": 1.0},
        predict=predict,
    )
    with pytest.raises(RuntimeError, match="not that way"):
        carry_out()
    entry = the_record(results)
    assert (entry.status, entry.error) == ("failed", "RuntimeError: not that way")
    assert entry.training_s > 0
    assert len(entry.curve) == 2


def test_predictions_that_are_no_classes_are_a_failure_that_can_be_read(
    carry_out, results, fake
):
    fake({"samples_seen": 1}, predict=lambda self, frames: np.full(len(frames), 99))
    with pytest.raises(
        ValueError, match="predicted: expected labels from 0 to 4, found 99 to 99"
    ):
        carry_out()
    entry = the_record(results)
    assert (entry.status, entry.training_s > 0) == ("failed", True)
    assert Results(results).problems == []


# What a record says was changed -------------------------------------------------------------------

FILES = {
    ("scene", "touch"): {
        "scene": {"n": 100, "seed": 0, "sensor": {"sampling_seed": 0, "noise": 0.1}},
        "split": {"kind": "random", "n_train": None},
    },
    ("model", "softmax"): {"model": {"lr": 0.1, "seed": 0, "device": "cpu"}},
    ("stop", "paper"): {"stop": {"target": 0.9, "budget_s": 1800}},
}
CHOICES = {"scene": "touch", "model": "softmax", "stop": "paper"}
# As it is run: four values of files are others. So are seeds, devices and the number of training
# samples, which is where a row stands and no change.
CONFIG = {
    "scene": {"n": 100, "seed": 3, "sensor": {"sampling_seed": 3, "noise": 0.2}},
    "split": {"kind": "ordered", "n_train": 5},
    "model": {"lr": 0.05, "seed": 3, "device": "cuda"},
    "stop": {"target": 0.9, "budget_s": 60},
    "data": {"pixels": 100},
    "seed": {"run": 3},
    "device": "cpu",
}
ALL = {
    "scene.sensor.noise": "0.2",
    "split.kind": '"ordered"',
    "model.lr": "0.05",
    "stop.budget_s": "60",
}
OF_SCENE = {key: ALL[key] for key in ("scene.sensor.noise", "split.kind")}
WHICH = ["scene=touch", "+model=softmax", "stop=paper", "+experiment=table1", "seed.run=3",
         "split.n_train=5", "data.pixels=100", "scene.path=x.npz", "device=cuda", "threads=1",
         "exclusive=false", "cache=false", "force=true", "hydra/launcher=joblib",
         "hydra.sweeper.n=1"]  # fmt: skip


@pytest.mark.parametrize(
    ("choices", "words", "expected"),
    [
        # Which run of a config it is, and how it is carried out, is no change of it.
        ({}, [], {}),
        ({}, WHICH, {}),
        ({}, [*WHICH, "model.lr=0.05"], ALL),
        ({}, ["++model.lr=0.05"], ALL),
        ({}, ["~model.momentum"], ALL),
        ({"experiment": "table1_extended"}, WHICH, ALL),
        # Of what is in no file, what was typed.
        (
            {"model": None},
            ["+model.lr=0.05", "model=x", "stop.budget_s=60", "+model.a.b={c: 1=2}"],
            {**OF_SCENE, "model.lr": "0.05", "model.a.b": "{c: 1=2}"}
            | {"stop.budget_s": "60"},
        ),
        (
            {"scene": "mine"},
            ["scene.noise=3", "split.kind=grouped", "sensor.a=1"],
            {"scene.noise": "3", "split.kind": "grouped", "model.lr": "0.05"}
            | {"stop.budget_s": "60"},
        ),
    ],
)
def test_values_that_are_not_those_of_the_files_are_in_the_record(
    monkeypatch, choices, words, expected
):
    monkeypatch.setattr(configs, "part", lambda *names: FILES.get(names))
    given = {**CHOICES, **choices}
    assert job.changed_keys(CONFIG, given, words) == expected
    on_gpu = job.changed_keys({**CONFIG, "device": "cuda:1"}, given, words)
    assert on_gpu == {**expected, "model.device": "cuda:1"}  # its times do not compare


def test_a_line_says_which_run_it_was_and_how_it_was_called(
    composed_run, results, one_thread, monkeypatch
):
    monkeypatch.setattr("sys.argv", ["run.py", "model=hdc", "a=[1, 2]"])
    seen = []
    monkeypatch.setattr(
        job, "changed_keys", lambda *given: seen.append(given) or {"a": "1"}
    )
    whole = composed_run("exclusive=false", "seed.run=2")
    choices = {
        "scene": "recorded",
        "model": "hdc",
        "stop": None,
        "experiment": "table1",
    }
    words = ["seed.run=2", "exclusive=false"]
    job.run(whole, choices, words, Console(quiet=True))
    entry = the_record(results)
    carried = record.NOT_IDENTITY
    config = {key: value for key, value in whole.items() if key not in carried}
    assert seen == [(config, choices, words)]
    assert entry.id == record.name_of("recorded-hdc", config, entry.data)
    assert entry.command == "python -m experiments.run model=hdc 'a=[1, 2]'"
    assert msgspec.to_builtins(entry.choices) == {
        "scene": "recorded",
        "model": "hdc",
        "stop": "custom",
    }
    assert (entry.experiment, entry.overrides) == ("table1", words)
    assert (entry.config, entry.changed) == (config, {"a": "1"})
    assert (entry.display["name"], entry.scene_display["name"]) == (
        "HDC",
        "Own recording",
    )
    assert (entry.scene.n, len(entry.scene.classes)) == (50, 5)
    here = msgspec.structs.replace(environment("cpu", 1), exclusive=False)
    assert entry.environment == here
