"""Claims: frozen verdicts are those that were judged; rules from version 4 on judge as said."""

import csv
import hashlib

import pytest
import yaml

from experiments.studies.claims.view import HISTORY

FOLDER = HISTORY.parent


@pytest.fixture(scope="module")
def history():
    with HISTORY.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Frozen -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("version", "name"), [(2, "rules.yaml"), (3, "rules_3.yaml")])
def test_the_rules_are_those_that_judged(history, version, name):
    rows = [row for row in history if row["rules"] == str(version)]
    file = FOLDER / name
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    assert {row["digest"] for row in rows} == {digest}
    written = yaml.safe_load(file.read_text("utf-8"))
    assert {row["dated"] for row in rows} == {str(written["dated"])}
    assert {row["judged"] for row in rows} == {
        "d2b9112a2a45c681744fe3dc688de0ef001e70e3"
    }
    says = {row["claim"]: row["says"] for row in rows}
    claims = written.get("claims") or {"bits": {"ours": written["claim"]}}
    assert says == {k: v.get("paper") or v["ours"] for k, v in claims.items()}


def test_the_words_of_rules_1_are_those_of_their_file(history):
    (earlier,) = yaml.safe_load((FOLDER / "earlier.yaml").read_text("utf-8"))
    rows = [row for row in history if row["rules"] == "1"]
    assert {row["claim"]: row["word"] for row in rows} == earlier["words"]
    assert {row["judged"] for row in rows} == {earlier["commit"]}
