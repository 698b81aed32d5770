"""A step lists the records that it touched; a call that breaks off leaves its list as it was."""

import pytest

from experiments.records import steps
from experiments.records.steps import Listed


@pytest.fixture
def call(tmp_path, monkeypatch):
    """call(mode, step, *names) → the list of a step, of which a call has touched these records."""

    def begin(mode, step, *names):
        path = steps.place(tmp_path, mode, step)
        monkeypatch.setenv(steps.VARIABLE, str(steps.begin(path)))
        for name in names:
            steps.add(name)
        monkeypatch.delenv(steps.VARIABLE)
        return path

    return begin


def test_the_list_of_a_step_is_that_of_its_last_finished_call(tmp_path, call):
    steps.finish(call("full", "table1", "touch-hdc-1", "touch-ridge-2", "touch-hdc-1"))
    assert (tmp_path / "steps" / "full" / "table1.txt").read_text() == (
        "touch-hdc-1\ntouch-ridge-2\ntouch-hdc-1\n"
    )
    first = Listed("full", "table1", {"touch-hdc-1", "touch-ridge-2"}, whole=True)
    assert list(steps.read(tmp_path)) == [first]
    call("full", "table1", "touch-hdc-3")
    steps.add("of no step")
    path = call("full", "table1", "touch-knn-4")
    call("quick", "drift")
    (tmp_path / "steps" / "quick" / "notes.md").write_text("no list")
    assert list(steps.read(tmp_path)) == [
        Listed("full", "table1", {"touch-knn-4"}, whole=False),
        first,
        Listed("quick", "drift", set(), whole=False),
    ]
    steps.finish(path)
    assert next(steps.read(tmp_path)) == Listed(
        "full", "table1", {"touch-knn-4"}, whole=True
    )
