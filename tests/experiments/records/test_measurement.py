"""Measurements: written whole, not repeated, kept when they break off; other configs beside."""

from __future__ import annotations

import pytest

from experiments.records import files, locks, measurement
from experiments.records.files import write_atomically
from experiments.records.measurement import folder_of, in_parts, measure, read
from experiments.records.results import Results

CONFIG = {"_target_": "hdc.HDCClassifier", "n": 3}
pytestmark = pytest.mark.usefixtures("results")


def rows():
    yield {"n": 1, "error": 0.5}
    yield {"n": 2, "note": "a, b"}


def test_rows_come_back_as_text_with_how_they_were_made(results):
    folder = measure("some", CONFIG, rows)
    assert folder == folder_of("some", CONFIG)
    assert folder.parent == results / "measured"
    found = read(folder)
    assert found.rows == [{"n": "1", "error": "0.5"}, {"n": "2", "note": "a, b"}]
    assert found.record.config == {"n": 3}
    assert "hdc/bits.py" in found.record.environment.sources
    assert found.outdated == []
    assert found.record.peak_bytes > 10e6


def test_the_same_is_not_measured_twice_and_another_config_lies_beside_it(capsys):
    one = measure("some", CONFIG, rows)
    measure("some", CONFIG, lambda: pytest.fail("again"))
    assert "finished before" in capsys.readouterr().out
    made = []
    for force in (False, True):
        other = measure("some", {**CONFIG, "n": 4}, lambda: made.append(1) or rows(), force=force)
    assert made == [1, 1]
    assert one != other
    assert read(one).record.config["n"] == 3


def test_the_address_of_a_task_is_no_part_of_what_it_is():
    assert folder_of("some", CONFIG) == folder_of("some", {"n": 3, "_target_": "moved.run"})


def test_what_broke_off_keeps_its_rows_and_is_measured_again():
    def broken():
        yield {"n": 1}
        raise ArithmeticError("no " + 20_000 * "!")  # more than a record can hold

    with pytest.raises(ArithmeticError):
        measure("some", CONFIG, broken)
    folder = folder_of("some", CONFIG)
    found = read(folder)
    assert found.record.status == "failed"
    assert found.record.error.startswith("ArithmeticError: no !!")
    assert found.rows == [{"n": "1"}]
    measure("some", CONFIG, rows)
    assert read(folder).record.status == "finished"


def test_a_killed_measurement_leaves_rows_that_nothing_vouches_for(monkeypatch):
    measure("some", CONFIG, lambda: [{"n": 1}])
    folder = folder_of("some", CONFIG)
    (folder / ".rows.csv.123.0a1b").write_text("half")
    real = files.write_atomically

    def die(path, text):
        real(path, text)
        if path.name == "rows.csv":
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(measurement, "write_atomically", die)
        with pytest.raises(KeyboardInterrupt):
            measure("some", CONFIG, lambda: [{"n": 2}], force=True)
    found = read(folder)
    assert (found.record.status, found.rows) == ("running", [{"n": "2"}])
    assert sorted(path.name for path in folder.iterdir()) == [locks.FILE, "record.json", "rows.csv"]


def test_one_that_another_process_is_at_is_left_to_it():
    folder = folder_of("some", CONFIG)
    with (
        locks.held(folder / locks.FILE),
        pytest.raises(locks.Held, match=f"{folder.name}: being run by another process"),
    ):
        measure("some", CONFIG, lambda: pytest.fail("measured"))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("record.json", "{"),
        ("record.json", '{"schema": 2}'),
        ("record.json", "[" * 100_000),
        ("rows.csv", "a,b\n1,2,3\n"),
        ("rows.csv", 'a\n"'),
    ],
)
def test_nonsense_is_named_and_force_measures_it_again(name, content):
    folder = measure("some", CONFIG, rows)
    write_atomically(folder / name, content)
    with pytest.raises(ValueError, match=name.replace(".", r"\.") + ": expected"):
        read(folder)
    measure("some", CONFIG, rows, force=True)
    assert len(read(folder).rows) == 2
    assert read(folder / "nowhere") is None


def test_what_was_measured_on_other_frames_is_never_the_experiments_own(results):
    """Own frames under experiment=drift entered the comparison as the paper's drift."""
    own = {"_target_": "experiments.studies.drift.measure.run", "scene": {"path": "mine.npz"}}
    measure("drift", own, rows)
    found = Results(results)
    assert found.measured("drift") is None
    (elsewhere,) = found.measured_elsewhere("drift")
    assert elsewhere.of_other_frames
    measure("numerics", {"seed": 7}, rows)  # other settings of the same frames: its own
    found = Results(results)
    assert found.measured("numerics").overrides["seed"] == "7"
    assert list(found.measured_elsewhere("numerics")) == []


def test_parts_that_are_done_are_not_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    made = []

    def part(k, fails=False):
        def compute():
            made.append(k)
            yield {"k": k, "x": 0.1}
            if fails:
                raise KeyError("no more")

        return {**CONFIG, "k": k}, compute

    with pytest.raises(KeyError):
        list(in_parts("some", [part(0), part(1, fails=True)]))
    assert list(in_parts("some", [part(0), part(1)])) == [{"k": 0, "x": 0.1}, {"k": 1, "x": 0.1}]
    assert made == [0, 1, 1]
    list(in_parts("some", [part(0)], force=True))
    assert made == [0, 1, 1, 0]
    (broken,) = (p for p in tmp_path.rglob("some-*.json") if '"k":1' in p.read_text())
    broken.write_text("{")
    assert len(list(in_parts("some", [part(0), part(1)]))) == 2
    assert made == [0, 1, 1, 0, 1]
