"""The command line: what it prints, how it ends, and that an error of the user's is one line."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from experiments import run
from experiments.records import locks
from experiments.records.record import read_record

CHECKOUT = Path(__file__).resolve().parents[2]
HEAVY = ("cv2", "sklearn", "threadpoolctl", "pandas", "matplotlib", "scipy.stats", "baselines.cnn")
pytestmark = pytest.mark.usefixtures("results", "one_thread")


@pytest.fixture
def command_line(tmp_path):
    """command_line(*overrides) → how a process of its own ended, started in tmp_path/cwd."""
    (tmp_path / "cwd").mkdir()

    def call(*overrides, script=None, **environment):
        command = ["-c", script] if script else ["-m", "experiments.run"]
        return subprocess.run(
            [sys.executable, *command, *overrides, "threads=1"],
            cwd=tmp_path / "cwd",
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, "PYTHONPATH": str(CHECKOUT), **environment},
        )

    return call


@pytest.fixture
def said(start):
    """said(*overrides) → exit code and lines of a command line in a forked process."""

    def call(*overrides, **keywords):
        process = start(*overrides, "exclusive=false", **keywords)
        process.join(60)
        return process.exitcode, process.out.read_text().splitlines()

    return call


def entries(results):
    return [read_record(folder) for folder in sorted((results / "runs").iterdir())]


# Runs ---------------------------------------------------------------------------------------------


def test_a_folder_of_images_from_another_directory(
    tmp_path, results, frames_and_labels, command_line
):
    cv2 = pytest.importorskip("cv2")
    frames, labels = frames_and_labels(30, 3, 24)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        folder = tmp_path / "my frames" / "abc"[label]
        folder.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(folder / f"{k:03}.png"), frame)
    done = command_line("scene=recorded", "scene.path=../my frames", "model=hdc")
    assert done.returncode == 0, done.stderr
    (warned,) = done.stderr.splitlines()  # files of a folder are in the order of their names
    assert warned.startswith("warning: split.kind=random: 100% of the test frames stand next to")
    assert "\x1b" not in done.stdout  # no colours, bars or cursor movements into a pipe
    assert not done.stdout.startswith("\n")
    lines = done.stdout.splitlines()
    assert lines[0] == "hdc on recorded (recorded), 24 training and 6 test samples"
    assert re.fullmatch(r"  test accuracy \d+\.\d% \(95 % interval .* to .*%\)", lines[1])
    assert lines[-1].startswith("  record ")
    (entry,) = entries(results)
    assert (entry.status, entry.environment.threads) == ("finished", 1)
    assert entry.scene.classes == ["a", "b", "c"]
    words = ["scene=recorded", 'scene.path="../my frames"', "model=hdc", "threads=1"]
    assert entry.command == shlex.join(["python", "-m", "experiments.run", *words])
    assert entry.overrides == words
    files = {f.name for f in (results / "runs").rglob("*") if f.is_file()}
    assert files == {"curve.csv", "record.json", locks.FILE}
    assert list((tmp_path / "cwd").iterdir()) == []


LOADED = f"""
import sys
from experiments.run import entry_point
try:
    entry_point()
except SystemExit as end:
    print("exit", end.code, "loaded", [name for name in {HEAVY!r} if name in sys.modules])
"""


def test_an_hdc_run_on_the_fibre_loads_nothing_heavy(results, shared_data, command_line):
    path = shared_data / "mmf_disorder"
    done = command_line(
        "scene=fibre", f"scene.path={path}", "scene.samples_per_class=10", script=LOADED
    )
    assert done.stdout.splitlines()[-1] == "exit 0 loaded []", done.stdout + done.stderr
    (entry,) = entries(results)
    assert (entry.scene.origin, entry.n_train) == ("measured", 40)


def test_an_hdc_run_on_the_simulated_sensor_loads_nothing_heavy(results, command_line):
    done = command_line("scene=touch", "scene.samples_per_class=5", script=LOADED)
    assert done.stdout.splitlines()[-1] == "exit 0 loaded []", done.stdout + done.stderr
    assert "\x1b" not in done.stdout
    assert done.stderr == ""
    (entry,) = entries(results)
    assert entry.scene.origin == "simulated"
    assert len(list((results / "cache").glob("*.npy"))) == 1


def test_a_run_that_is_finished_is_shown_again_and_not_made_again(recording, said):
    words = ("scene=recorded", f"scene.path={recording()}")
    (_, first), (code, again) = said(*words), said(*words)
    assert code == 0
    assert again[:-1] == first[:-1]
    assert again[-1] == first[-1] + " (finished before; force=true runs it again)"


def test_a_finished_run_of_other_code_says_so(results, recording, said):
    words = ("scene=recorded", f"scene.path={recording()}")
    said(*words)
    (path,) = (results / "runs").glob("*/record.json")
    path.write_text(re.sub('("hdc/bits.py":")[0-9a-f]+', r"\g<1>000000000000", path.read_text()))
    assert "made by other code than this: hdc/bits.py" in said(*words)[1][-1]


@pytest.mark.parametrize("model", ["sklearn_ridge", "sklearn_forest"])
def test_a_model_of_scikit_learn_is_finished_whatever_its_parameters_are(
    tmp_path, results, recording, said, model
):
    """A forest has no arrays to measure: its result was lost after the training."""
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "sklearn_forest.yaml").write_text(
        "# @package _global_\nmodel:\n  _target_: baselines.sklearn_classifier.SklearnClassifier\n"
        "  estimator: {_target_: sklearn.ensemble.RandomForestClassifier, n_estimators: 5}\n"
    )
    words = ("--config-dir", str(tmp_path), "scene=recorded", f"scene.path={recording()}")
    code, lines = said(*words, f"model={model}")
    assert code == 0, lines
    (entry,) = entries(results)
    assert entry.status == "finished"
    size = entry.model_bytes
    assert size > 5 * 256 if model == "sklearn_ridge" else size is None or size > 1000


# Where text goes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "environment", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}]
)
def test_a_terminal_of_ascii_is_no_error(recording, command_line, environment):
    """The run was finished, and then an error: 'ascii' codec can't encode '·'."""
    done = command_line("scene=recorded", f"scene.path={recording()}", **environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert "test accuracy" in done.stdout
    assert "confusion" in done.stdout


def test_long_class_names_that_differ_at_their_end_stay_apart(tmp_path, recording, said):
    import numpy as np

    path = recording()
    names = [f"{'a touch of the sensor at position ' * 3}{k}" for k in range(5)]
    with np.load(path) as held:
        np.savez(path, frames=held["frames"], labels=np.array(names)[held["labels"]])
    _, lines = said("scene=recorded", f"scene.path={path}")
    for name in names:
        assert sum(name in line for line in lines) == 2  # a column and a row


def test_errors_on_the_terminal(said):
    code, lines = said("scene=recorded", "scene.path='no[/b]:smile:\x1b[31m\u202e'")
    assert code == 1
    assert lines == [
        "error: scene.path: expected a folder, an .npz or a video, "
        "found nothing: no[/b]:smile:\\x1b[31m\\u202e"
    ]


# What the user did wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (
            ["model=hcd"],
            r"error: model: expected one of .*hdc, .*, found hcd \(did you mean hdc\?\)",
        ),
        (
            ["scene=tuoch"],
            r"error: scene: expected one of .*fibre.*, found tuoch \(did .* touch\?\)",
        ),
        (["model.lr=abc", "model=softmax"], r"error: model\.lr: expected a number, found 'abc'"),
        (
            ["model.seed=abc", "model.ties=random"],
            r"error: model\.seed: expected a number, found 'abc'",
        ),
        (["device=cuda:7"], r"error: device: expected one of cpu.*, found 'cuda:7'"),
        (["seed.run=99999999999999999999999"], r"error: seed\.run: expected .* found 9+"),
        (["nothing"], r"error: Error parsing override 'nothing', missing EQUAL at '<EOF>'"),
        (["model.nothing=1"], r"error: .*model\.nothing.*"),
    ],
    ids=lambda given: given[0] if isinstance(given, list) else None,
)
def test_an_error_of_the_users_is_one_line_that_names_the_key(recording, said, overrides, expected):
    words = ["scene=recorded", f"scene.path={recording()}"]
    if overrides[0].startswith("scene="):
        words = []
    code, lines = said(*words, *overrides)
    assert code == 1
    assert re.fullmatch(expected, "\n".join(lines)), lines
    assert len(lines) == 1
    assert max(map(len, lines)) < 700


ODD_NAMES = [
    "a b", "a[b]", "[b]", "{a}", "a=b,c", "a,b", "a'b", 'a"b', "a\\b", "a\\'b", "a\\", "$a",
    "'a'", "a\nb", "a:b#c", "(a)", "null", "µ",
]  # fmt: skip


@pytest.mark.parametrize("name", ODD_NAMES)
def test_a_path_that_is_there_is_taken_as_it_is(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / name).touch()
    parser = OverridesParser.create()
    for path in (name, f"{tmp_path}/{name}", f"~/{name}"):
        override = parser.parse_override(run._argument(f"scene.path={path}"))
        found = OmegaConf.create({"path": override.value()}).path
        assert found == os.path.expanduser(path)


@pytest.mark.parametrize(
    "text", ["scene.path='a b'", "scene.path=a,b", "scene.path=???", "scene.path=", "model=hdc",
             "seed.run=1,2", "scene.path=${oc.env:HOME}", "-m", "scene.path=[1]"]
)  # fmt: skip
def test_what_is_no_path_that_is_there_is_left_to_hydra(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    assert run._argument(text) == text


def test_an_odd_path_reaches_the_record(tmp_path, results, recording, said):
    path = tmp_path / "a, b=[c] {d}\\' µ.npz"
    recording().rename(path)
    code, lines = said("scene=recorded", f"scene.path={path}")
    assert code == 0, lines
    (entry,) = entries(results)
    assert entry.config["scene"]["path"] == str(path)


@pytest.mark.parametrize("multirun", [(), ("-m", "seed.run=0,1")], ids=["one", "several"])
def test_results_that_cannot_be_written_are_one_line(tmp_path, recording, said, multirun):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", Path("/proc/nowhere")):
        code, lines = said(
            *multirun,
            "scene=recorded",
            f"scene.path={recording()}",
            environment={"RESULTS_DIR": str(place)},
        )
        assert code == 1
        assert {line.partition(" ")[0] for line in lines} == {"error:"}
        assert all(str(place) in line for line in lines)


def test_a_finished_run_in_a_folder_that_is_read_only_is_shown(results, recording, said):
    words = ("scene=recorded", f"scene.path={recording()}")
    said(*words)
    (folder,) = (results / "runs").iterdir()
    (folder / locks.FILE).unlink()  # none can be made there
    for path in (folder, results / "runs", results):
        path.chmod(0o555)
    try:
        code, lines = said(*words)
    finally:
        for path in (results, results / "runs", folder):
            path.chmod(0o755)
    assert code == 0
    assert "finished before" in lines[-1]
    assert not (folder / locks.FILE).exists()


# Ended from outside -------------------------------------------------------------------------------

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


def started(command, cwd):
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )


@pytest.mark.parametrize(
    ("end", "code", "status"),
    [
        (signal.SIGTERM, 143, "interrupted"),
        (signal.SIGHUP, 129, "interrupted"),  # of a terminal that was closed
        (signal.SIGINT, 130, "interrupted"),
        (signal.SIGKILL, -9, "running"),
    ],
    ids=lambda given: getattr(given, "name", None),
)
def test_a_killed_run_is_marked_and_run_again(
    recording, tmp_path, results, said, end, code, status
):
    overrides = ["scene=recorded", f"scene.path={recording()}"]
    process = started(["-c", STUCK, *overrides, "threads=1", "exclusive=false"], tmp_path)
    try:
        limit = time.monotonic() + 60
        while not (tmp_path / "stuck").exists():
            assert process.poll() is None
            assert time.monotonic() < limit
            time.sleep(0.05)
        process.send_signal(end)
        assert process.wait(30) == code
    finally:
        process.kill()
        process.communicate()
    (entry,) = entries(results)
    assert entry.status == status
    said(*overrides)
    (again,) = entries(results)
    assert (again.id, again.status) == (entry.id, "finished")


@pytest.mark.parametrize("seconds", [0.5, 1.0, 1.6])
def test_an_interrupt_while_importing_is_an_interrupt(recording, tmp_path, results, seconds):
    """C extensions swallow it: the run went on, and failed of a numpy without `matrix`."""
    words = ["-m", "experiments.run", "scene=touch", "scene.samples_per_class=200", "model=softmax"]
    process = started([*words, "exclusive=false", "threads=1"], tmp_path)
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode in (-signal.SIGINT, 130), out + err
    assert "Error" not in err
    # Before there is a record there is at most the folder that was locked for it.
    found = entries(results) if results.exists() else []
    assert {entry.status for entry in found if entry} <= {"interrupted"}
