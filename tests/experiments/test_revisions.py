"""A number moves only with a revision, and a revision is all that outdates a record."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

import hdc
from experiments.records import revision, store
from experiments.records.files import ROOT
from tests.experiments import golden_items
from tests.experiments import golden_numbers as golden


@pytest.mark.filterwarnings("ignore")
def test_no_number_moved_without_a_revision(one_thread):
    known = golden.read()
    wrong = []
    for name, item in golden.items().items():
        wrong.append(golden.complaint(name, item, known.get(name)))
    assert not any(wrong), "\n".join(filter(None, wrong))


# A changed constant, and the revision raised ------------------------------------------------------


@pytest.fixture
def words(one_thread, monkeypatch, tmp_path):
    """The items of HDC alone, with a golden file of their own."""
    monkeypatch.setattr(golden, "FILE", tmp_path / "numbers.json")
    part = golden_items.part("model", "hdc")["model"]
    item = golden_items.Item(part, lambda: golden_items.hdc_numbers(part, 65, "uint8"))
    monkeypatch.setattr(golden, "items", lambda: {"words": item})
    assert golden.write() == []
    yield lambda: golden.complaint("words", item, golden.read().get("words"))
    revision._of_target.cache_clear()


def test_a_changed_constant_fails_until_the_revision_is_raised(words, monkeypatch):
    assert words() == ""
    before = golden.FILE.read_text()
    real = hdc.HDCClassifier.encode

    def other(model, frames):
        words = real(model, frames)
        return replace(words, packed=words.packed ^ 1)

    monkeypatch.setattr(hdc.HDCClassifier, "encode", other)
    told = words()
    assert told.startswith("words: a number moved and no revision did (words ")
    assert "Raise the revision of what you changed, one of " in told
    assert "hdc.HDCClassifier" in told
    assert golden.write() == [told]  # refused
    assert golden.FILE.read_text() == before
    monkeypatch.setattr(hdc.HDCClassifier, "revision", 99, raising=False)
    revision._of_target.cache_clear()
    assert words().startswith("words: a revision is another: ")
    assert golden.write() == []
    assert words() == ""


@pytest.mark.parametrize(
    ("before", "now", "expected"),
    [
        ({"a": [1, None, 3]}, {"a": [1, 2, None]}, ""),
        ({"a": [1, 2]}, {"a": [1, 3]}, "a[1] 3, was 2"),
        ({"a": 1.0}, {"a": 1.0009}, ""),
        ({"a": 100.0}, {"a": 100.2}, "a 100.2, was 100.0"),
        ({"a": 1}, {"b": 1}, "has ['b'], had ['a']"),
        ([1], [1, 2], "has ['[1]'], had []"),
    ],
)
def test_what_moved_is_named(before, now, expected):
    assert golden.moved(before, now, 1e-3) == expected


def test_labels_beside_a_change_say_nothing():
    labels = [0] * 10 + [1] * 11 + [1] * 21 + [1] * 20 + [2]
    found = golden_items.clear_labels(labels)
    assert found[8:12] == [0, None, None, 1]
    assert found[60:] == [1, None, None]


# A changed word -----------------------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path):
    """A copy of the code of this checkout, without its history."""
    folder = tmp_path / "checkout"
    for name in (*revision.PACKAGES, "configs"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    return folder


def test_a_word_in_a_progress_bar_or_a_docstring_outdates_no_record(
    copy, recording, tmp_path
):
    def run():
        words = [
            "scene=recorded",
            f"scene.path={recording()}",
            "threads=1",
            "exclusive=false",
        ]
        done = subprocess.run(
            [sys.executable, "-m", "experiments.run", *words],
            cwd=copy, capture_output=True, text=True, check=True,
            env={**os.environ, "PYTHONPATH": str(copy), "RESULTS_DIR": str(tmp_path / "own")},
        )  # fmt: skip
        return done.stdout

    assert "training" in run()
    for path, before, after in (
        ("experiments/protocol/data.py", 'description=f"make', 'description=f"prepare'),
        ("experiments/protocol/trial.py", '"""The training', '"""A training'),
    ):
        text = (copy / path).read_text()
        assert text.count(before) == 1
        (copy / path).write_text(text.replace(before, after))
    assert "finished before" in run()
    (entry,) = store.read(tmp_path / "own")
    assert entry.is_finished
