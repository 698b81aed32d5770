"""What a record was made by: revisions of what took part, files of a user's own modules."""

import sys

import pytest

import experiments
import hdc
from experiments.records import record, revision, store
from experiments.records.revision import outdated, revisions

HDC = {"model": {"_target_": "hdc.HDCClassifier"}}
RIDGE = {"model": {"_target_": "baselines.ridge.RidgeReadout"}}
OWN = {"model": {"_target_": "an_own_model.Mine", "size": 3}}


@pytest.fixture(autouse=True)
def nothing_remembered():
    """Revisions are looked up once a process."""
    yield from forgotten()


def forgotten():
    for function in (revision._of_target, revision._own_files, revision._is_installed):
        function.cache_clear()
    yield
    for function in (revision._of_target, revision._own_files, revision._is_installed):
        function.cache_clear()


def forget():
    next(forgotten())


def test_whatever_a_config_names_and_the_protocol_take_part():
    found = revisions({**HDC, "scene": [{"_target_": "scenes.sensor.contact.Press"}]})
    assert set(found) >= {
        "experiments",
        "hdc.HDCClassifier",
        "scenes.sensor.contact.Press",
    }
    assert not any(name.startswith("baselines") for name in found)
    study = {"_target_": "experiments.studies.drift.measure.drift"}
    assert set(revisions({**study, "models": {"r": RIDGE}})) >= {
        study["_target_"],
        "baselines.ridge.RidgeReadout",
    }


def test_libraries_and_what_is_not_there_have_no_revision():
    config = [{"_target_": "sklearn.linear_model.RidgeClassifier"},
              {"_target_": "nowhere.Nothing"}, {"_target_": "hdc.Nothing"}]  # fmt: skip
    assert revisions(config) == revisions({})


def test_a_raised_revision_outdates_what_it_takes_part_in_and_nothing_else(monkeypatch):
    before_hdc, before_ridge = revisions(HDC), revisions(RIDGE)
    monkeypatch.setattr(hdc.HDCClassifier, "revision", 17, raising=False)
    forget()
    (line,) = outdated(before_hdc, HDC)
    assert line.startswith("hdc.HDCClassifier (revision ")
    assert line.endswith(", now 17)")
    assert outdated(before_ridge, RIDGE) == []
    assert len(outdated(revisions(HDC) | {"hdc.Gone": 1}, HDC)) == 1


def test_a_raised_protocol_outdates_everything(monkeypatch):
    before, number = (revisions(HDC), revisions(RIDGE)), experiments.REVISION
    monkeypatch.setattr(experiments, "REVISION", 17)
    forget()
    expected = [f"experiments (revision {number}, now 17)"]
    for made_by, config in zip(before, (HDC, RIDGE), strict=True):
        assert outdated(made_by, config) == expected


def test_parts_that_a_class_names_take_part(monkeypatch):
    class Part:
        revision = 5

    def components(**parameters):
        return [Part] if parameters.get("ties") == "one" else []

    monkeypatch.setattr(hdc.HDCClassifier, "components", components, raising=False)
    with_it = revisions({"_target_": "hdc.HDCClassifier", "ties": "one"})
    forget()
    without_it = revisions({"_target_": "hdc.HDCClassifier", "ties": "zero"})
    parts = [value for name, value in with_it.items() if name.endswith(".Part")]
    assert parts == [5]
    assert not any(name.endswith(".Part") for name in without_it)


def test_what_a_study_uses_takes_part():
    study = {"_target_": "experiments.studies.correlation.measure.correlation"}
    assert "hdc.HDCClassifier" in revisions(study)


# A user's own module ------------------------------------------------------------------------------


@pytest.fixture
def own_module(tmp_path, monkeypatch):
    """A module outside the checkout, one that it imports, and one that nobody does."""
    (tmp_path / "an_own_model.py").write_text(
        "import numpy\nimport an_own_helper\n\nclass Mine:\n    pass\n"
    )
    (tmp_path / "an_own_helper.py").write_text("factor = 1\n")
    (tmp_path / "another.py").write_text("factor = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("an_own_")]:
        del sys.modules[name]  # another run of these tests has other files


def test_the_file_of_an_own_module_counts_with_those_beside_it(own_module):
    before = revisions(OWN)
    assert {"an_own_model.py", "an_own_helper.py"} <= set(before)
    assert "another.py" not in before
    (own_module / "another.py").write_text("factor = 2\n")
    forget()
    assert outdated(before, OWN) == []
    for name in ("an_own_model.py", "an_own_helper.py"):
        with (own_module / name).open("a") as file:
            file.write("# another line\n")
        forget()
        assert outdated(before, OWN) == [f"{name} (changed)"]
        before = revisions(OWN)


def test_own_parts_of_a_config_are_told_from_others(own_module):
    found = revision.of_own({"encoder": HDC, **OWN})
    assert set(found) > {"an_own_model.Mine", "an_own_model.py", "an_own_helper.py"}
    assert "hdc.HDCClassifier" not in found
    assert revision.of_own(HDC) == {}


def test_modules_of_an_own_package_count(own_module):
    package = own_module / "an_own_package"
    (package / "parts").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "parts" / "__init__.py").write_text("")
    (package / "parts" / "deep.py").write_text("a = 1\n")
    (package / "layers.py").write_text("from .parts import deep\n")
    (package / "models.py").write_text(
        "from an_own_package.layers import deep\n\nclass Mine:\n    revision = 4\n"
    )
    found = revisions({"_target_": "an_own_package.models.Mine"})
    assert found["an_own_package.models.Mine"] == 4
    assert {"models.py", "layers.py", "parts/__init__.py", "parts/deep.py"} <= set(
        found
    )


def test_a_module_counts_that_a_package_inside_its_own_imports_by_its_full_name(
    own_module,
):
    inner = own_module / "an_own_outer_package" / "nets"
    inner.mkdir(parents=True)
    (inner.parent / "layers.py").write_text("a = 1\n")
    for folder in (inner, inner.parent):
        (folder / "__init__.py").write_text("")
    (inner / "models.py").write_text(
        "from an_own_outer_package.layers import a\n\nclass Mine:\n    pass\n"
    )
    found = revisions({"_target_": "an_own_outer_package.nets.models.Mine"})
    assert {"models.py", "../layers.py"} <= set(found)


def test_an_own_module_that_cannot_be_found_counts_as_unchanged(
    own_module, monkeypatch
):
    before = revisions(OWN)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(own_module)])
    sys.modules.pop("an_own_model")
    forget()
    assert outdated(before, OWN) == []


# A checkout with changes --------------------------------------------------------------------------


def test_a_record_of_changes_in_no_commit_counts_for_the_same_changes_only(
    tmp_path, write_run, read_run, monkeypatch
):
    clean = read_run(write_run("hdc", seed=0))
    made = read_run(write_run("hdc", seed=1, environment={"changes": "a" * 12}))
    for changes, expected in ((None, True), ("b" * 12, True), ("a" * 12, False)):
        monkeypatch.setattr(
            "experiments.records.record.changes", lambda changes=changes: changes
        )
        assert bool(made.outdated) == expected
        assert clean.outdated == []
    assert isinstance(made, record.Record)
    assert len(list(store.read(tmp_path))) == 2
