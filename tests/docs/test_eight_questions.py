"""The first 70 lines of README answer the eight questions of a stranger, each in one paragraph."""

import csv
import re
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
LINES = 70
with Path(__file__).with_name("eight_questions.csv").open(encoding="utf-8") as file:
    QUESTIONS = [(row["question"], row["answer"]) for row in csv.DictReader(file)]


def texts():
    """Paragraphs and items of the first lines of README, a line each."""
    lines = (CHECKOUT / "README.md").read_text("utf-8").splitlines()[:LINES]
    for part in re.split(r"\n\s*\n|\n(?=[-*] |\d+\. |<!--)", "\n".join(lines)):
        yield " ".join(part.split())


@pytest.mark.parametrize(("question", "answer"), QUESTIONS)
def test_readme_answers(question, answer):
    assert any(re.search(answer, text) for text in texts()), question
