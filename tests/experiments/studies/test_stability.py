"""Numbers at their limits: the registry, the verdict, the cases in their small sizes, the table."""

from __future__ import annotations

import math

import pytest
from rich.console import Console

from experiments.protocol.scenes import scene_at
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.stability import case as cases
from experiments.studies.stability import measure as stability
from experiments.studies.stability.case import CASES, Case, Trial, case
from experiments.studies.stability.cases.prototypes import touch
from experiments.studies.stability.view import STUDY

pytestmark = pytest.mark.usefixtures("one_thread")

# Differences of accuracies mean something on enough frames only.
STATISTICAL = [c for c in CASES.values() if c.name.startswith("majority ties")]
EXACT = [c for c in CASES.values() if c not in STATISTICAL]
WORDS = dict.fromkeys(("extreme", "expected", "reference", "unit", "naive", "ours"), "words")


def made(naive, ours, error, **of_trial):
    trial = Trial(naive, ours, error, **of_trial)
    return Case(part="sensor", name="some case", prepare=lambda: trial, tolerance=0.5, **WORDS)


def test_every_part_has_cases_and_all_words_are_there():
    assert len(CASES) >= 50
    assert {c.part for c in CASES.values()} == set(stability.PARTS)
    for c in CASES.values():
        assert all(getattr(c, word) for word in WORDS), c.name
        assert c.tolerance >= 0


def test_a_case_is_registered_once_under_the_name_of_its_function(monkeypatch):
    monkeypatch.setattr(cases, "CASES", {})

    @case("sensor", **WORDS)
    def some_case():
        return Trial(naive=lambda: 1, ours=lambda: 2, error=abs)

    assert [(c.part, name) for name, c in cases.CASES.items()] == [("sensor", "some case")]
    with pytest.raises(ValueError, match="one case named 'some case', found two"):
        case("sensor", **WORDS)(some_case)


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(0.0, "holds"), (0.5, "holds"), (0.51, "fails"), (math.nan, "fails"), (math.inf, "fails")],
)
def test_a_case_holds_up_to_its_tolerance_and_never_by_nan(error, verdict):
    one = made(lambda: 0, lambda: 0, lambda _: error)
    assert stability.case_row(one)["verdict"] == verdict


def test_a_row_has_errors_times_and_what_was_raised():
    row = stability.case_row(made(lambda: 1 / 0, lambda: 3, abs, remark=lambda: "said"))
    assert (row["error_naive"], row["error_ours"], row["verdict"]) == (math.inf, 3.0, "fails")
    assert row["note"] == "said; naive raised ZeroDivisionError: division by zero"
    assert 0 < row["time_ours_s"] < 1


def test_both_forms_run_in_turns_until_repeats_or_budget_are_spent():
    calls = []
    one = made(
        lambda: calls.append("naive"), lambda: calls.append("ours"), lambda _: 0.0, tolerance=0.0
    )
    row = stability.case_row(one, repeats=3, budget_s=10.0)
    assert calls == ["naive", "ours"] * 3
    assert (row["tolerance"], row["note"]) == (0.0, "")
    calls.clear()
    stability.case_row(one, repeats=3, budget_s=0.0)
    assert calls == ["naive", "ours"]


def test_an_error_that_cannot_use_a_result_is_not_hidden():
    with pytest.raises(TypeError):
        stability.case_row(made(lambda: "a", lambda: "b", abs))


@pytest.mark.parametrize("one", EXACT, ids=lambda c: f"{c.part}: {c.name}")
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


def test_the_touches_are_those_of_the_config():
    camera = {"grid": 64, "crop": 60, "pupil": 24}
    config = configs.of_scene("touch")["scene"]
    config = config | {"sensor": config["sensor"] | {"camera": camera}}
    made, ours = scene_at(config, 3, cache=False, console=Console()), touch(3, **camera)
    assert made.fingerprint() == ours.fingerprint()
    assert made.classes == ours.classes


def test_rows_become_a_table(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    stability.run(parts=["correlations"], repeats=1, budget_s=0.0, small=True)
    found = Results(tmp_path).measured("stability")
    assert found.outdated == []
    sources = found.record.environment.sources
    assert "experiments/studies/stability/cases/correlations.py" in sources
    (table,) = STUDY.tables(Results(tmp_path))
    count = sum(c.part == "correlations" for c in CASES.values())
    assert table.title.endswith(f"{count} of {count} cases hold")
    assert "Measured with" in table.note
    assert "small=true" in table.note
    assert len(table.cells()) == count
    assert {row[-1] for row in table.cells()} == {"holds"}


def test_what_fails_and_what_is_no_number_is_told(tmp_path, write_measurement):
    numbers = dict.fromkeys(("error_ours", "tolerance", "time_naive_s", "time_ours_s"), 0.25)
    words = {"part": "sensor", **WORDS, **numbers}
    write_measurement(
        "stability",
        [
            {**words, "case": "good", "verdict": "holds", "error_naive": "nan", "note": "it said."},
            {**words, "case": "bad", "verdict": "fails", "error_naive": "inf"},
            {**words, "case": "far", "verdict": "holds", "error_naive": "125000.0"},
        ],
    )
    (table,) = STUDY.tables(Results(tmp_path))
    assert table.title.endswith("2 of 3 cases hold")
    shown = [dict(zip(table.heads, row, strict=True)) for row in table.cells()]
    assert [row["Error, obvious"] for row in shown] == ["NaN", "no result", "125,000"]
    assert [row["Verdict"] for row in shown] == ["holds", "fails", "holds"]
    assert shown[0]["Time, ours, ms"] == "250"
    assert "Good: it said." in table.note


def test_an_unknown_part_is_refused():
    with pytest.raises(ValueError, match=r"task\.parts: expected some of .*, found 'optics'"):
        stability.run(parts=["optics"])
