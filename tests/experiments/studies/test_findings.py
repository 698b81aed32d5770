"""Findings are sentences of two YAMLs, filled from tables; what is not there is named."""

from types import SimpleNamespace

import pandas as pd
import pytest

from experiments.studies.claims import findings as module

VALUES = pd.DataFrame(
    {
        "model": ["hdc", "softmax"],
        "recording": ["a", "a"],
        "n": [5, 5],
        "gain": [-4.25, 0.0],
        "gain_low": [-6.0, None],
        "gain_high": [-2.0, None],
        "word": ["no", None],
    }
)


@pytest.fixture
def filled(tmp_path):
    """filled(yaml) → its sentences."""

    def fill(text):
        path = tmp_path / "findings.yaml"
        path.write_text(text, encoding="utf-8")
        tables = {"values": SimpleNamespace(data=VALUES), "later": None}
        names = [SimpleNamespace(name=name) for name in tables]
        studies = [SimpleNamespace(tables=names)]
        answers = SimpleNamespace(studies=studies, table=tables.get)
        return list(module.sentences(path, answers).values())

    return fill


HDC = "first:\n  rows: {hdc: {table: values, model: hdc}, soft: {table: values, model: softmax}}\n"


def test_a_number_has_its_interval_where_there_is_one(filled):
    """The formats are those of README and of the docs (reporting/test_documents.py)."""
    fields = "{hdc.gain:points interval}, {soft.gain:points interval}"
    assert filled(f"{HDC}  text: '{fields}'") == [
        "−4.2 points [−6.0, −2.0], +0.0 points"
    ]


def test_the_verdict_chooses_the_sentence(filled):
    text = f'{HDC}  word: "{{hdc.word}}"\n  texts: {{"no": behind, "yes": ahead}}'
    assert filled(text) == ["behind"]
    with pytest.raises(ValueError, match=r"findings\.yaml, first: 'no'"):
        filled(text.replace('"no": behind, ', ""))


@pytest.mark.parametrize(
    "text",
    [
        f"{HDC}  text: '{{soft.word}}'",
        "first:\n  rows: {a: {table: later, model: hdc}}\n  text: '{a.gain}'",
    ],
)
def test_what_was_not_measured_has_no_sentence(filled, text):
    assert filled(f"{text}\nsecond:\n  text: The last.") == ["The last."]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (f"{HDC}  text: '{{cnn.gain}}'", "'cnn'"),
        ("first:\n  rows: {a: {table: values}}", "expected one row with .*, found 2"),
        (
            "first:\n  spreads: {a: {table: values, column: gain, of: {n: 5}}}",
            "expected one row per recording",
        ),
        (
            "first:\n  rows: {a: {table: none}}\n  text: '{a.gain}'",
            "table: expected that of a study, found none",
        ),
    ],
)
def test_a_name_that_the_tables_do_not_have_is_one_clear_error(filled, text, error):
    with pytest.raises(ValueError, match=f"findings.yaml, first: {error}"):
        filled(text)


def test_most_accuracy_is_lost_by_the_majority_as_readme_says(committed):
    steps = committed.table("decomposition").data.groupby("step").change.median()
    assert steps.idxmin() == "LDA to majority: as published"
