"""What a record was made by: revisions of what took part, files of a user's own modules."""

import sys

import pytest

import experiments
import hdc
from experiments.records import revision, store
from experiments.records.revision import of_today, outdated, revisions
from tests.experiments.helpers import forget

HDC = {"model": {"_target_": "hdc.HDCClassifier"}}
RIDGE = {"model": {"_target_": "baselines.ridge.RidgeReadout"}}
OWN = {"model": {"_target_": "an_own_model.Mine", "size": 3}}


@pytest.fixture(autouse=True)
def nothing_remembered():
    forget(revision)
    yield
    forget(revision)


def test_a_raised_revision_outdates_what_it_takes_part_in_and_nothing_else(monkeypatch):
    by_hdc, by_ridge = revisions(HDC), revisions(RIDGE)
    gone = by_hdc | {"hdc.Gone": 1}
    assert outdated(gone, of_today(gone)) == ["hdc.Gone (revision 1, now none)"]
    monkeypatch.setattr(hdc.HDCClassifier, "revision", 17, raising=False)
    forget(revision)
    (line,) = outdated(by_hdc, revisions(HDC))
    assert line.startswith("hdc.HDCClassifier (revision ")
    assert line.endswith(", now 17)")
    assert outdated(by_ridge, of_today(by_ridge)) == []
    number = experiments.REVISION
    monkeypatch.setattr(experiments, "REVISION", 17)  # that of the protocol
    lines = outdated(by_ridge, of_today(by_ridge))
    assert lines == [f"experiments (revision {number}, now 17)"]


# A user's own module ------------------------------------------------------------------------------

FILES = {
    "an_own_model.py": "import an_own_helper\n\nclass Mine:\n    pass\n",
    "an_own_helper.py": "factor = 1\n",
    "an_own_package/__init__.py": "",
    "an_own_package/models.py": "class Mine:\n    revision = 4\n",
}


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder of modules outside the checkout."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("an_own_")]:
        del sys.modules[name]  # another run of these tests has other files


@pytest.mark.parametrize(
    ("target", "file", "number"),
    [("an_own_model.Mine", "an_own_model.py", 1), ("an_own_package.models.Mine", "models.py", 4)],
)  # fmt: skip
def test_an_own_module_counts_by_its_file_and_its_revision(own, target, file, number):
    found = revisions({"model": {"_target_": target}})
    assert set(found) == {"experiments", target, file}
    assert found[target] == number


def test_a_changed_file_of_an_own_module_outdates_its_records_and_no_other_file(own):
    before = revisions(OWN)
    for name, expected in (
        ("an_own_helper.py", []),
        ("an_own_model.py", ["an_own_model.py (changed)"]),
    ):
        with (own / name).open("a") as file:
            file.write("# another line\n")
        forget(revision)
        assert outdated(before, revisions(OWN)) == expected
    # Whoever reads a record imports nothing of it: what it names counts as unchanged.
    assert outdated(before, of_today(before)) == []


# A checkout with changes --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("made", "now", "expected"),
    [(None, None, False), (None, "b", False), ("a", None, True), ("a", "b", True),
     ("a", "a", False)],
)  # fmt: skip
def test_a_record_of_changes_in_no_commit_counts_for_the_same_changes_only(
    tmp_path, write_run, monkeypatch, made, now, expected
):
    run = store.find(tmp_path, write_run("hdc", environment={"changes": made}))
    monkeypatch.setattr("experiments.records.record.changes", lambda: now)
    assert bool(run.outdated) is expected
