"""Measurements: typed rows, found again by config and code, never lost to a later failure."""

import json

import numpy as np
import pytest

from experiments.protocol.experiment import Run, experiment
from experiments.records import measurement


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


CALLS = []


@experiment
def powers(run: Run, base: int, most: int = 3, fail_at: int | None = None):
    """One row: an exponent."""
    CALLS.append(base)
    for k in range(most):
        if k == fail_at:
            raise ValueError("no more")
        yield {
            "n": k,
            "value": np.float64(base**k),
            "label": "None",
            "odd": bool(k % 2),
        }


@pytest.fixture(autouse=True)
def no_calls():
    CALLS.clear()


def read(path):
    return measurement.read(path)


def test_rows_keep_their_types(results):
    measured = read(powers(base=2, force=False))
    assert measured.rows[1] == {"n": 1, "value": 2.0, "label": "None", "odd": True}
    assert measured.frame["n"].tolist() == [0, 1, 2]
    assert measured.frame["label"].tolist() == ["None"] * 3
    assert measured.record.config == {"base": 2, "most": 3, "fail_at": None}
    assert measured.record.status == "finished"


def test_a_measurement_is_made_once_unless_forced(results):
    for force in (False, False, True):
        powers(base=2, force=force)
    assert CALLS == [2, 2]
    assert powers(base=3) != powers(base=2)


def test_a_failure_leaves_what_was_finished(results, monkeypatch):
    path = powers(base=2)
    rows = (path / "rows.jsonl").read_bytes()

    def broken(run, **_):
        yield {"n": 0}
        raise OSError("the disk is full")

    monkeypatch.setattr(measurement, "write", lambda *_: pytest.fail("written"))
    with pytest.raises(OSError, match="the disk is full"):
        measurement.measure(
            "powers",
            {"_target_": "a_test", "base": 2, "most": 3, "fail_at": None},
            lambda: broken(None),
            force=True,
        )
    assert (path / "rows.jsonl").read_bytes() == rows
    assert read(path).record.status == "finished"


@pytest.mark.parametrize("arguments", [{}, {"base": 2, "mots": 3}])
def test_a_wrong_key_is_named(results, arguments):
    with pytest.raises(ValueError, match="expected the keys base, most, fail_at"):
        powers(**arguments)


def test_finished_parts_are_not_computed_again(results):
    computed = []

    def rows(run, stop):
        for seed in range(4):
            if seed == stop:
                raise KeyboardInterrupt
            yield from run.part({"seed": seed}, lambda seed=seed: computed.append(seed) or [
                {"seed": seed}
            ])  # fmt: skip

    run = Run("sums", {"_target_": "experiments.protocol.trial", "a": 1})
    with pytest.raises(KeyboardInterrupt):
        list(rows(run, 2))
    assert list(rows(run, None)) == [{"seed": seed} for seed in range(4)]
    assert computed == [0, 1, 2, 3]


def test_numbers_that_json_lacks_become_null():
    text = measurement.to_lines(
        [{"a": float("nan"), "b": float("inf"), "c": np.int64(3)}]
    )
    assert measurement.from_lines(text) == [{"a": None, "b": None, "c": 3}]


def test_whatever_step_of_a_write_fails_no_record_vouches_for_rows_of_another_call(
    results, full_disk
):
    folder = powers(base=2, force=False)
    entry = json.loads((folder / "record.json").read_text())
    measurement.write(folder, {**entry, "seconds": -1}, [{"n": -1}])
    for k in range(100):
        again = {**entry, "seconds": k}
        failed = full_disk(
            k, lambda again=again, k=k: measurement.write(folder, again, [{"n": k}])
        )
        if (found := read(folder)) is not None:
            assert found.rows == (
                [{"n": k}] if found.record.seconds == k else [{"n": k - 1}]
            )
        if failed is None:
            break
        assert "No space left" in str(failed)
        measurement.write(folder, again, [{"n": k}])
    assert (
        k == 11
    )  # the old record; folder, file, flush, name and temporary file of both
