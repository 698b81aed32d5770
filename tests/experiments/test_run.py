"""One config, one record: run in this process on small scenes, and from the command line."""

import copy
import csv
import os
import re
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import hydra
import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

import hdc
from experiments import locks, record, run, summary

CHECKOUT = Path(__file__).resolve().parents[2]
HEAVY = ("cv2", "sklearn", "threadpoolctl", "pandas", "matplotlib", "scipy.stats", "baselines.cnn")


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    return tmp_path / "results"


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def frames_and_labels(n=50, classes=5, side=16):
    rng = np.random.default_rng(0)
    labels = np.arange(n) % classes
    base = rng.integers(0, 150, (classes, side, side))
    return (base[labels] + rng.integers(0, 90, (n, side, side))).astype(np.uint8), labels


@pytest.fixture
def archive(tmp_path):
    frames, labels = frames_and_labels()
    np.savez(tmp_path / "frames.npz", frames=frames, labels=labels)
    return tmp_path / "frames.npz"


def compose(archive, *overrides):
    with hydra.initialize_config_dir(str(CHECKOUT / "configs"), version_base="1.3"):
        return hydra.compose(
            "config",
            ["scene=recorded", f"scene.path={archive}", "threads=1", *overrides],
        )


CHOICES = {"scene": "recorded", "model": "hdc", "stop": "paper"}


def carry_out(archive, *overrides):
    return run.run(compose(archive, *overrides), CHOICES)


def on_disk(entry):
    return record.read_record(record.results_dir() / "runs" / entry["id"])


class FakeModel:
    """Yields the reports of its class, whatever it is shown."""

    reports: tuple = ()

    def __init__(self, **_):
        pass

    def train(self, frames, labels):
        for report in self.reports:
            if isinstance(report, BaseException):
                raise report
            yield report

    def predict(self, frames):
        return np.zeros(len(frames), np.int64)

    def state_tensors(self):
        return {"w": torch.zeros(3)}


def fake(monkeypatch, *reports):
    monkeypatch.setattr(hdc, "HDCClassifier", type("Fake", (FakeModel,), {"reports": reports}))


# Records ---------------------------------------------------------------------------------------


def test_a_run_says_what_it_was_and_what_came_out(archive):
    entry = on_disk(carry_out(archive))
    assert entry["status"] == "finished"
    assert entry["stop"] == "finished"
    assert entry["scene"]["origin"] == "recorded"
    assert entry["scene"]["shape"] == [16, 16]
    assert entry["scene"]["skipped"] == []
    assert entry["config"]["threads"] == entry["environment"]["threads"] == 1
    assert (entry["n_train"], entry["n_test"]) == (40, 10)
    assert "error" not in entry
    # Every figure again, from the predictions in the record.
    predicted, labels = np.array(entry["predicted"]), np.array(entry["test_labels"])
    right = (predicted == labels).mean()
    assert entry["test_accuracy_final"] == right
    assert np.trace(entry["confusion"]) / np.sum(entry["confusion"]) == right
    assert entry["test_ci_low"] <= right <= entry["test_ci_high"]
    frames, all_labels = frames_and_labels()
    np.testing.assert_array_equal(labels, all_labels[entry["test_indices"]])
    train = np.setdiff1d(np.arange(50), entry["test_indices"])
    model = hdc.HDCClassifier().fit(frames[train], all_labels[train])
    np.testing.assert_array_equal(predicted, model.predict(frames[entry["test_indices"]]))
    assert entry["model_bytes"] == sum(t.nbytes for t in model.state_tensors().values())
    assert 0 < entry["predict_single_s"] < 1
    assert 0 < entry["training_s"] < 10


def test_the_curve_holds_every_report(archive):
    entry = carry_out(archive)
    with (record.results_dir() / "runs" / entry["id"] / "curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["training_s", "samples_seen", "train_accuracy", "test_accuracy"]
    assert len(rows) == entry["reports"]
    assert float(rows[-1]["training_s"]) <= entry["training_s"]
    assert float(rows[-1]["test_accuracy"]) == entry["test_accuracy_final"]
    seen = [float(row["training_s"]) for row in rows]
    assert seen == sorted(seen)


IDENTITY = [
    "seed.run=1",
    "seed.sensor=7",
    "seed.samples=7",
    "seed.split=7",
    "seed.init=7",
    "seed.pixels=7",
    "split.kind=ordered",
    "split.test_fraction=0.4",
    "split.n_train=20",
    "data.pixels=100",
    "model.ties=one",
    "stop.patience=6",
    "scene.subsample=2",
]


def test_the_id_is_a_function_of_config_and_data(archive, tmp_path):
    first = carry_out(archive)["id"]
    ids = [carry_out(archive, override)["id"] for override in IDENTITY]
    assert len({first, *ids}) == len(IDENTITY) + 1
    assert {
        carry_out(archive, o)["id"] for o in ("force=true", "cache=false", "exclusive=false")
    } == {first}
    torch.set_num_threads(2)
    assert carry_out(archive)["id"] not in {first, *ids}
    torch.set_num_threads(1)
    frames, labels = frames_and_labels()
    frames[3, 0, 0] ^= 1
    np.savez(archive, frames=frames, labels=labels)
    assert carry_out(archive)["id"] not in {first, *ids}


def test_equal_runs_differ_in_times_only(archive):
    def outcome():
        entry = copy.deepcopy(on_disk(carry_out(archive, "force=true")))
        return {k: v for k, v in entry.items() if not k.endswith(("_s", "_per_frame"))}

    assert outcome() == outcome()


def test_a_finished_run_is_not_repeated_unless_forced(archive, monkeypatch, capsys):
    first = carry_out(archive)
    monkeypatch.setattr(run, "train_and_test", lambda *_: pytest.fail("run again"))
    assert carry_out(archive) == on_disk(first)
    assert "finished before; force=true runs it again" in capsys.readouterr().out
    monkeypatch.setattr(run, "train_and_test", lambda *_: (_ for _ in ()).throw(ZeroDivisionError))
    with pytest.raises(ZeroDivisionError):
        carry_out(archive, "force=true")


def test_a_finished_run_of_other_code_says_so(archive, monkeypatch, capsys):
    carry_out(archive)
    assert "other code" not in capsys.readouterr().out
    monkeypatch.setattr(summary.sources, "outdated", lambda files: sorted(files)[:1])
    carry_out(archive)
    shown = " ".join(capsys.readouterr().out.split())
    assert "made by other code than this: experiments/__init__.py" in shown


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (RuntimeError("out of memory"), "failed"),
        (KeyboardInterrupt(), "interrupted"),
        (SystemExit(143), "interrupted"),
    ],
)
def test_a_run_that_breaks_off_is_kept_and_run_again(archive, monkeypatch, error, status):
    with monkeypatch.context() as patch:
        fake(patch, {"samples_seen": 1, "loss": 1.0}, error)
        # Neither the warm-up nor the first report fails.
        with pytest.raises(type(error)):
            carry_out(archive)
    (folder,) = (record.results_dir() / "runs").iterdir()
    entry = record.read_record(folder)
    assert entry["status"] == status
    assert type(error).__name__ in entry["error"]
    assert len((folder / "curve.csv").read_text().splitlines()) == 2
    again = carry_out(archive)
    assert again["id"] == folder.name
    assert on_disk(again)["status"] == "finished"
    assert "error" not in on_disk(again)


def test_the_curve_of_an_earlier_attempt_does_not_outlive_it(archive, monkeypatch):
    folder = record.results_dir() / "runs" / carry_out(archive)["id"]
    monkeypatch.setattr(run, "train_and_test", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    with pytest.raises(OSError, match="disk"):
        carry_out(archive, "force=true")
    assert not (folder / "curve.csv").exists()


def test_a_corrupt_record_is_named_and_not_overwritten(archive):
    path = record.results_dir() / "runs" / carry_out(archive)["id"] / "record.json"
    path.write_text('{"schema": 1, "stat')
    with pytest.raises(ValueError, match="expected a record in JSON") as caught:
        carry_out(archive)
    assert str(path) in str(caught.value)
    assert path.read_text() == '{"schema": 1, "stat'


def test_scikit_learn_gets_the_threads_of_the_run_and_others_need_not(archive):
    import sklearn.linear_model
    from threadpoolctl import threadpool_info, threadpool_limits

    class Watched(sklearn.linear_model.RidgeClassifier):
        def fit(self, X, y):
            inside.extend(library["num_threads"] for library in threadpool_info())
            return super().fit(X, y)

    def watched(archive):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sklearn.linear_model, "RidgeClassifier", Watched)
            return carry_out(archive, "model=sklearn_ridge")

    inside = []
    with threadpool_limits(2, "blas"):
        entry = watched(archive)
        blas = [library for library in threadpool_info() if library["user_api"] == "blas"]
        assert {library["num_threads"] for library in blas} == {2}
    assert set(inside) == {1}
    told = entry["environment"]["libraries"]
    assert {library["threads"] for library in told} == {1}
    assert any("openblas" in library["library"] for library in told)
    assert carry_out(archive)["environment"]["libraries"] == []


# Training --------------------------------------------------------------------------------------


def test_a_model_that_diverges_keeps_its_curve(archive, monkeypatch):
    fake(
        monkeypatch,
        {"samples_seen": 20, "loss": 2.0},
        {"samples_seen": 40, "loss": float("nan")},
        {"samples_seen": 60, "loss": 1.0},
    )
    entry = on_disk(carry_out(archive))
    assert (entry["status"], entry["stop"], entry["reports"]) == ("finished", "diverged", 2)
    text = (record.results_dir() / "runs" / entry["id"] / "curve.csv").read_text()
    header, first, last = text.splitlines()
    assert header == "training_s,samples_seen,loss,train_accuracy,test_accuracy"
    assert re.fullmatch(r"[\d.e-]+,20,2\.0,0\.2,0\.2", first)
    assert re.fullmatch(r"[\d.e-]+,40,nan,,", last)


def test_softmax_with_an_absurd_step_diverges(archive):
    entry = carry_out(archive, "model=softmax", "model.optimizer=SGD", "model.lr=1e38")
    assert entry["stop"] == "diverged"


@pytest.mark.parametrize(
    ("overrides", "stop", "reports"),
    [
        (["stop.patience=2", "stop.patience_below=2"], "plateau", 3),
        (["stop=reached", "stop.target=0.1"], "reached", 1),
        (["stop.budget_s=1e-9"], "budget", 1),
        (["stop.patience=100"], "finished", 9),
    ],
)
def test_the_stop_is_in_the_record(archive, monkeypatch, overrides, stop, reports):
    fake(monkeypatch, *({"samples_seen": k, "loss": 1.0} for k in range(9)))
    entry = carry_out(archive, *overrides)
    assert (entry["stop"], entry["reports"]) == (stop, reports)


def test_a_model_that_reports_nothing_fails(archive, monkeypatch):
    fake(monkeypatch)
    with pytest.raises(ValueError, match="expected at least one report"):
        carry_out(archive)


def test_only_training_counts(archive, monkeypatch):
    now = types.SimpleNamespace(t=0.0)
    monkeypatch.setattr("experiments.clock.time.perf_counter", lambda: now.t)

    class Slow(FakeModel):
        def train(self, frames, labels):
            now.t += 1  # what a model does before its iterator counts as well

            def reports():
                for k in range(3):
                    now.t += 10
                    yield {"samples_seen": k, "loss": 1.0}

            return reports()

        def predict(self, frames):
            now.t += 1000
            return super().predict(frames)

    monkeypatch.setattr(hdc, "HDCClassifier", Slow)
    entry = carry_out(archive)
    assert entry["training_s"] == 31
    assert entry["predict_single_s"] == 1000
    assert entry["predict_batch_s_per_frame"] == 100


def test_the_trained_model_is_not_the_one_that_was_warmed_up(archive, monkeypatch):
    trained = []

    class Watched(FakeModel):
        def train(self, frames, labels):
            trained.append((id(self), tuple(frames.shape)))
            yield {"samples_seen": 1}

    monkeypatch.setattr(hdc, "HDCClassifier", Watched)
    carry_out(archive)
    (warm, warm_shape), (real, shape) = trained
    assert warm != real
    assert warm_shape == shape == (40, 16, 16)


def test_lazily_read_frames_give_the_same_record(archive, monkeypatch):
    whole = carry_out(archive)
    monkeypatch.setattr("experiments.data.IN_MEMORY_BYTES", 0)
    lazy = carry_out(archive, "force=true")
    for key in ("predicted", "test_accuracy_final", "data_sha256", "train_accuracy_max"):
        np.testing.assert_equal(lazy[key], whole[key])


# What the user did wrong -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["scene.path=???"], r"^scene\.path: expected a value, found none"),
        (["scene.path=/nowhere"], r"^scene\.path: expected a folder"),
        (["scene.subsample=0"], r"^scene\.subsample: expected"),
        (["+scene.colour=1"], r"^scene: .*unexpected keyword argument 'colour'"),
        (["+model.colour=1"], r"^model: .*unexpected keyword argument 'colour'"),
        (["stop.patience=0"], r"^stop\.patience: expected at least 1, found 0"),
        (["split.kind=sorted"], r"^split\.kind: expected one of"),
        (["data.pixels=1"], r"^data\.pixels: expected"),
    ],
)
def test_a_wrong_value_is_named_by_its_key(archive, overrides, message):
    with pytest.raises(ValueError, match=message):
        carry_out(archive, *overrides)


@pytest.mark.parametrize("wrong", ["+model.colour=1", "stop.patience=0", "split.kind=sorted"])
def test_what_is_wrong_is_found_before_frames_are_made(archive, monkeypatch, wrong):
    monkeypatch.setattr("experiments.data.cached", lambda *_: pytest.fail("too late"))
    monkeypatch.setattr("experiments.data.take", lambda *_: pytest.fail("too late"))
    with pytest.raises(ValueError, match=wrong.lstrip("+")[:5]):
        carry_out(archive, wrong)


@pytest.mark.parametrize("threads", [0, -1, True, 1.5, "two"])
def test_a_wrong_number_of_threads_is_named(threads):
    with pytest.raises(ValueError, match=r"^threads: expected an integer from 1, or null, found"):
        run._threads(threads, {})


def test_threads_are_the_cores_this_process_may_use():
    assert run._threads(3, {}) == 3
    assert 1 <= run._threads(None, {}) <= os.cpu_count()
    if hasattr(os, "sched_getaffinity"):
        assert run._threads(None, {}) == len(os.sched_getaffinity(0))


def test_class_names_are_shown_as_they_are(tmp_path, capsys):
    frames, labels = frames_and_labels(classes=2)
    names = np.array(["[/red]", "[bold]x"])[labels]
    np.savez(tmp_path / "odd.npz", frames=frames, labels=names)
    carry_out(tmp_path / "odd.npz")
    out = capsys.readouterr().out
    assert "[/red]" in out
    assert "[bold]x" in out


# The command line: each of these starts a process ------------------------------------------------


def command_line(*overrides, cwd, script=None):
    command = ["-c", script] if script else ["-m", "experiments.run"]
    return subprocess.run(
        [sys.executable, *command, *overrides, "threads=1"],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=120,
    )


def records():
    return [record.read_record(f) for f in sorted((record.results_dir() / "runs").iterdir())]


def test_a_folder_of_images_from_another_directory(tmp_path, results):
    cv2 = pytest.importorskip("cv2")
    frames, labels = frames_and_labels(n=30, classes=3, side=24)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        folder = tmp_path / "my frames" / "abc"[label]
        folder.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(folder / f"{k:03}.png"), frame)
    (tmp_path / "cwd").mkdir()
    done = command_line(
        "scene=recorded", "scene.path=../my frames", "model=hdc", cwd=tmp_path / "cwd"
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "\x1b" not in done.stdout  # no colours, bars or cursor movements into a pipe
    assert not done.stdout.startswith("\n")
    lines = done.stdout.splitlines()
    assert lines[0] == "hdc on recorded (recorded), 24 training and 6 test samples"
    assert re.fullmatch(r"  test accuracy \d+\.\d% \(95 % interval .* to .*%\)", lines[1])
    assert lines[-1].startswith("  record ")
    (entry,) = records()
    assert (entry["status"], entry["environment"]["threads"]) == ("finished", 1)
    assert entry["config"]["threads"] == 1
    assert entry["scene"]["classes"] == ["a", "b", "c"]
    assert entry["command"].endswith("scene=recorded 'scene.path=../my frames' model=hdc threads=1")
    assert sorted(f.name for f in (results / "runs").rglob("*.*")) == ["curve.csv", "record.json"]
    assert list((tmp_path / "cwd").iterdir()) == []


def test_a_multirun_goes_on_after_a_run_that_fails(archive, tmp_path):
    done = command_line(
        "-m", "scene=recorded", f"scene.path={archive}", "seed.run=0,-1,1", cwd=tmp_path
    )
    assert done.returncode == 1
    assert done.stderr.strip() == "error: split.seed: expected an integer ≥ 0, found -1"
    assert done.stdout.count("test accuracy") == 2
    by_seed = {entry["config"]["seed"]["run"]: entry for entry in records()}
    assert [by_seed[seed]["status"] for seed in (0, 1, -1)] == ["finished", "finished", "failed"]
    assert by_seed[-1]["error"] == "ValueError: split.seed: expected an integer ≥ 0, found -1"
    assert by_seed[0]["config"]["seed"]["init"] == 0


def test_an_unknown_choice_lists_those_there_are(tmp_path):
    done = command_line("scene=tuoch", cwd=tmp_path)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    for choice in (CHECKOUT / "configs" / "scene").glob("*.yaml"):
        assert choice.stem in done.stderr


def test_a_path_that_is_not_there_is_one_line(tmp_path):
    done = command_line("scene=recorded", "scene.path='nowhere[/b]'", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "error: scene.path: expected a folder, an .npz or a video, found nothing: nowhere[/b]"
    ]


LOADED = f"""
import sys
from experiments.run import entry_point
try:
    entry_point()
except SystemExit as end:
    print("exit", end.code, "loaded", [name for name in {HEAVY!r} if name in sys.modules])
"""


def test_an_hdc_run_on_the_fibre_loads_nothing_heavy(tmp_path, shared_data):
    path = shared_data / "mmf_disorder"
    done = command_line(
        "scene=fibre",
        f"scene.path={path}",
        "scene.samples_per_class=10",
        cwd=tmp_path,
        script=LOADED,
    )
    assert done.stdout.splitlines()[-1] == "exit 0 loaded []", done.stdout + done.stderr
    (entry,) = records()
    assert entry["scene"]["origin"] == "measured"
    assert entry["n_train"] == 40


def test_an_hdc_run_on_the_simulated_sensor_loads_nothing_heavy(tmp_path):
    done = command_line("scene=touch", "scene.samples_per_class=5", cwd=tmp_path, script=LOADED)
    assert done.stdout.splitlines()[-1] == "exit 0 loaded []", done.stdout + done.stderr
    assert "\x1b" not in done.stdout
    assert done.stderr == ""
    (entry,) = records()
    assert entry["scene"]["origin"] == "simulated"
    assert len(list((record.results_dir() / "cache").glob("*.npy"))) == 1


STUCK = """
import sys, time
from pathlib import Path
import hdc
from experiments.run import entry_point

class Stuck(hdc.HDCClassifier):
    def train(self, frames, labels):
        yield from super().train(frames, labels)
        if labels.max() > 1:  # not the warm-up
            Path("stuck").touch()
            time.sleep(100)

hdc.HDCClassifier = Stuck
entry_point()
"""


@pytest.mark.parametrize(
    ("end", "status"), [(signal.SIGTERM, "interrupted"), (signal.SIGKILL, "running")]
)
def test_a_killed_run_is_marked_and_run_again(archive, tmp_path, results, end, status):
    overrides = ["threads=1", "scene=recorded", f"scene.path={archive}"]
    process = subprocess.Popen(
        [sys.executable, "-c", STUCK, *overrides], cwd=tmp_path, stdout=subprocess.DEVNULL
    )
    try:
        limit = time.monotonic() + 60
        while not (tmp_path / "stuck").exists():
            assert process.poll() is None
            assert time.monotonic() < limit
            time.sleep(0.05)
        process.send_signal(end)
        assert process.wait(30) == (-signal.SIGKILL if end == signal.SIGKILL else 143)
    finally:
        process.kill()
        process.wait()
    (entry,) = records()
    assert entry["status"] == status
    left = {f.name for f in (results / "runs").rglob("*") if f.is_file()}
    assert left == {"record.json", "curve.csv" if status == "interrupted" else locks.FILE}
    again = carry_out(archive)
    assert again["id"] == entry["id"]
    assert on_disk(again)["status"] == "finished"


def test_the_config_in_a_record_is_the_whole_config(archive):
    cfg = compose(archive)
    entry = run.run(cfg, CHOICES)
    config = OmegaConf.to_container(cfg, resolve=True)
    for key in record.NOT_IDENTITY:
        del config[key]
    assert on_disk(entry)["config"] == config
