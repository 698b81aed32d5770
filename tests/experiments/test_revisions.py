"""A number moves only with a revision, and a revision is all that outdates a record."""

from dataclasses import replace

import pytest

import hdc
from experiments.records import revision
from tests.experiments import golden_items
from tests.experiments import golden_numbers as golden
from tests.experiments.helpers import forget


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
    forget(revision)


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
    forget(revision)
    assert words().startswith("words: a revision is another: ")
    assert golden.write() == []
    assert words() == ""
