"""Figures and numbers of a study, for the views of the studies."""

import pytest


@pytest.fixture
def figures(answers):
    """figures(study) → its figures by name, drawn, of the records in tmp_path."""

    def draw(study):
        made = answers(study).figures(study)
        return {figure.name: figure.draw(figure.table.data) for figure in made}

    return draw


@pytest.fixture
def number(answers):
    """number(study, name, condition) → that Quantity, of the records in tmp_path."""

    def find(study, name, condition=""):
        results = answers(study).results
        every = (
            quantity
            for numbers in study.numbers
            for quantity in numbers.made(results.frame(*numbers.of))
        )
        (one,) = (q for q in every if (q.name, q.condition) == (name, condition))
        return one

    return find
