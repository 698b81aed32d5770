"""Measurements: written whole, not repeated, kept when they break off."""

from __future__ import annotations

import pytest

from experiments import measurement, record

CONFIG = {"_target_": "hdc.HDCClassifier", "n": 3}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


def rows():
    yield {"n": 1, "error": 0.5}
    yield {"n": 2, "note": "a, b"}


def test_rows_come_back_as_text_with_how_they_were_made(results):
    folder = measurement.measure("some", CONFIG, rows)
    assert folder == results / "measured" / "some"
    found = measurement.read(results, "some")
    assert found.rows == [{"n": "1", "error": "0.5"}, {"n": "2", "note": "a, b"}]
    assert found.record["config"] == CONFIG
    assert "hdc/bits.py" in found.record["environment"]["sources"]
    assert found.outdated == []
    assert found.record["peak_bytes"] > 10e6


def test_the_same_is_not_measured_twice(capsys):
    measurement.measure("some", CONFIG, rows)
    measurement.measure("some", CONFIG, lambda: pytest.fail("again"))
    assert "finished before" in capsys.readouterr().out
    made = []
    measurement.measure("some", {**CONFIG, "n": 4}, lambda: made.append(1) or rows())
    measurement.measure("some", {**CONFIG, "n": 4}, lambda: made.append(1) or rows(), force=True)
    assert made == [1, 1]


def test_what_broke_off_keeps_its_rows_and_is_measured_again(results):
    def broken():
        yield {"n": 1}
        raise ArithmeticError("no")

    with pytest.raises(ArithmeticError):
        measurement.measure("some", CONFIG, broken)
    found = measurement.read(results, "some")
    assert found.record["status"] == "failed"
    assert "ArithmeticError: no" in found.record["error"]
    assert found.rows == [{"n": "1"}]
    measurement.measure("some", CONFIG, rows)
    assert measurement.read(results, "some").record["status"] == "finished"


def test_nothing_there_is_none_and_nonsense_is_named(results):
    assert measurement.read(results, "some") is None
    record.write_atomically(results / "measured" / "some" / "record.json", "{")
    with pytest.raises(ValueError, match=r"some/record\.json"):
        measurement.read(results, "some")
