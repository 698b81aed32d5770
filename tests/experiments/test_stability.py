"""Numbers at their limits: the registry, the verdict, the cases in their small sizes, the table."""

from __future__ import annotations

import csv
import math

import pytest
import torch

from experiments import measurement, stability, stability_table
from experiments.stability_cases import case as cases
from experiments.stability_cases.case import CASES, Case, Trial, case, outcome, refusal, verdict

# Differences of accuracies mean something on enough frames only.
STATISTICAL = [c for c in CASES if c.name.startswith("majority ties")]


@pytest.fixture(autouse=True)
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def registry(monkeypatch):
    """An empty registry."""
    monkeypatch.setattr(cases, "CASES", [])
    return cases.CASES


def made(**change):
    words = dict.fromkeys(("extreme", "expected", "reference", "unit", "naive", "ours"), "words")
    return Case(**{"part": "sensor", "name": "some case", **words, "tolerance": 0.5, "note": "",
                   **change})  # fmt: skip


def test_every_part_has_cases_and_all_words_are_there():
    assert len(CASES) >= 30
    assert {c.part for c in CASES} == set(stability.PARTS)
    for c in CASES:
        assert all((c.extreme, c.expected, c.reference, c.unit, c.naive, c.ours)), c.name
        assert c.tolerance >= 0


def test_a_case_is_registered_once_under_the_name_of_its_function(registry):
    words = dict.fromkeys(("extreme", "expected", "reference", "unit", "naive", "ours"), "words")

    @case("sensor", **words)
    def some_case():
        return Trial(naive=lambda: 1, ours=lambda: 2, error=abs)

    assert [(c.part, c.name) for c in registry] == [("sensor", "some case")]
    with pytest.raises(ValueError, match="one case named 'some case', found two"):
        case("sensor", **words)(some_case)


def test_a_case_holds_up_to_its_tolerance_and_never_by_nan():
    assert verdict(0.5, 0.5) == verdict(0.0, 0.0) == "holds"
    assert verdict(0.51, 0.5) == verdict(math.nan, 0.5) == verdict(math.inf, 0.5) == "fails"


def test_a_row_has_errors_times_and_what_was_raised():
    one = made(note="a note", prepare=lambda: Trial(naive=lambda: 1 / 0, ours=lambda: 3, error=abs))
    row = stability.case_row(one)
    assert (row["error_naive"], row["error_ours"], row["verdict"]) == (math.inf, 3.0, "fails")
    assert row["note"] == "naive raised ZeroDivisionError: division by zero; a note"
    assert 0 < row["time_ours_s"] < 1


def test_both_forms_run_in_turns_until_repeats_or_budget_are_spent():
    calls = []
    one = made(prepare=lambda: Trial(
        naive=lambda: calls.append("naive"), ours=lambda: calls.append("ours"),
        error=lambda _: 0.0, tolerance=0.0, remark=lambda: "said",
    ))  # fmt: skip
    row = stability.case_row(one, repeats=3, budget_s=10.0)
    assert calls == ["naive", "ours"] * 3
    assert (row["tolerance"], row["note"]) == (0.0, "said")
    calls.clear()
    stability.case_row(one, repeats=3, budget_s=0.0)
    assert calls == ["naive", "ours"]


def test_an_error_that_cannot_use_a_result_is_not_hidden():
    with pytest.raises(TypeError):
        stability.case_row(made(prepare=lambda: Trial(lambda: "a", lambda: "b", error=abs)))


def test_a_refusal_is_a_value_error_with_the_words():
    error = refusal("depth", "5 m")

    def raising(exception):
        def form():
            raise exception

        return outcome(form)

    assert error(raising(ValueError("depth: found 6 m, expected 5 m"))) == 0
    assert error(raising(ValueError("depth"))) == 1
    assert error(raising(TypeError("depth 5 m"))) == 1
    assert error(outcome(lambda: 3)) == 1


@pytest.mark.parametrize(
    "one", [c for c in CASES if c not in STATISTICAL], ids=lambda c: f"{c.part}: {c.name}"
)
def test_the_small_sizes(one):
    row = stability.case_row(one, small=True)
    assert row["verdict"] == "holds", row


def test_the_tie_rules_are_compared_on_the_same_frames():
    errors = []
    for one in STATISTICAL:
        row = stability.case_row(one, small=True)
        assert 0 < row["error_ours"] < 0.8, "no better than chance"
        assert row["tolerance"] > row["error_naive"]
        assert "simulated test frames" in row["note"]
        errors.append(row["error_ours"])
    assert errors == sorted(errors, reverse=True)  # 2, 4, 10 samples a class


def test_rows_become_a_table(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    assert stability_table.tables(tmp_path) == []
    stability.run(parts=["correlations"], repeats=1, budget_s=0.0, small=True)
    found = measurement.read(tmp_path, "stability")
    assert found.outdated == []
    assert "experiments/stability_cases/correlations.py" in found.record["environment"]["sources"]
    table, text = stability_table.tables(tmp_path)
    rows = list(csv.DictReader(table.open(encoding="utf-8")))
    count = sum(c.part == "correlations" for c in CASES)
    assert len(rows) == count
    assert tuple(rows[0]) == stability_table.COLUMNS
    shown = text.read_text(encoding="utf-8")
    assert f"{count} cases, {count} hold.**" in shown
    assert "Small sizes" in shown
    lines = [line for line in shown.splitlines() if line.startswith("| ")]
    assert len(lines) == count + 2
    assert len({line.replace("\\|", "").count("|") for line in lines}) == 1


def test_a_failing_case_is_named_above_the_table():
    numbers = dict.fromkeys(stability_table._NUMBERS, "0.25")
    words = dict.fromkeys(stability_table.COLUMNS, "some|words")
    rows = [
        {**words, **numbers, "case": "good", "verdict": "holds", "error_naive": "nan"},
        {**words, **numbers, "case": "bad", "verdict": "fails", "error_naive": "inf"},
    ]
    environment = {"cpu": "A CPU", "threads": 2, "sources": {"gone.py": "0"}}
    record = {
        "status": "interrupted",
        "config": {"small": False},
        "environment": environment,
    }
    text = stability_table.to_markdown(measurement.Measured(rows, record))
    assert "2 cases, 1 hold, 1 fail (bad)." in text
    assert "The measurement is interrupted" in text
    assert "Code has changed since: gone.py" in text
    assert "| **fails** |" in text
    assert "| NaN |" in text
    assert "| no result |" in text
    assert "some\\|words" in text


def test_an_unknown_part_is_refused():
    with pytest.raises(ValueError, match=r"task\.parts: expected some of .*, found 'optics'"):
        stability.run(parts=["optics"])
