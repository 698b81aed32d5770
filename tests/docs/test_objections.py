"""The page of objections: a row has one value a cell, and names tables that are there."""

import re
from pathlib import Path

from experiments import studies
from experiments.reporting.study import studies as studies_of

CHECKOUT = Path(__file__).resolve().parents[2]
TABLES = CHECKOUT / "results" / "reference" / "tables"
PAGE = (CHECKOUT / "docs" / "objections.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.splitlines()
    if line.startswith("| ") and not line.startswith("| Objection")
]


def test_every_objection_has_an_answer_and_a_place():
    assert len(ROWS) > 35
    for objection, answer, where in ROWS:
        assert objection
        assert answer.endswith(".")
        assert re.fullmatch(r"`\w+\.csv`|\[\w+\]\(\w+\.md\)", where), where


def test_no_measured_number_is_typed():
    assert "<br>" not in PAGE
    for _, answer, _ in ROWS:
        assert not re.search(r"\d+\.\d|[−+×]\d", answer), answer


def test_pages_and_tables_that_it_names_are_there():
    """A table is of the reference, or of a study whose measurement the reference still lacks."""
    made = {
        maker.called.removeprefix("table ")
        for study in studies_of(studies)
        for maker in study._makers
    }
    for _, _, where in ROWS:
        if where.startswith("["):
            page = re.search(r"\((\w+\.md)\)", where)[1]
            assert (CHECKOUT / "docs" / page).exists(), page
        else:
            name = where.strip("`")
            assert (TABLES / name).exists() or name.removesuffix(".csv") in made, where
