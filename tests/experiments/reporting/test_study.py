"""A study is a folder with a view; the report finds it, and starts fast."""

import math
import subprocess
import sys

from experiments import studies
from experiments.records.files import ROOT
from experiments.records.results import Results
from experiments.reporting.estimates import Estimate
from experiments.reporting.study import Quantity
from experiments.reporting.study import studies as studies_of

FOUND = studies_of(studies)


def test_every_study_is_found_in_the_order_of_the_page():
    assert {"table1", "accuracy", "scenes", "correlation", "drift"} <= {s.name for s in FOUND}
    orders = [study.order for study in FOUND]
    assert orders == sorted(set(orders))
    for study in FOUND:
        assert (ROOT / "experiments" / "studies" / study.name / "view.py").is_file()
        assert study.title
        assert study.question.endswith((".", "?"))


def test_a_study_has_nothing_to_say_of_an_empty_folder(tmp_path):
    results = Results(tmp_path)
    for study in FOUND:
        assert not list(study.plots(results)), study.name
        assert not list(study.quantities(results)), study.name
        # Table I has its published half.
        assert study.name == "table1" or not list(study.tables(results)), study.name
    assert results.problems == []


def test_what_shows_does_not_import_what_measures():
    code = (
        "import sys; from experiments import report; report.all_studies();"
        "print([m for m in sys.modules if m in ('torch', 'hdc', 'cv2', 'sklearn')"
        " or m.startswith('experiments.') and m.endswith('.measure')])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_an_estimate_without_bounds_has_no_interval():
    found = Quantity.of("a/b", Estimate(0.5), "Wilson", 100)
    assert (found.value, found.low, found.high, found.interval) == (50, None, None, "")
    found = Quantity.of("a/b", Estimate(0.5, 0.4, math.nan), "Wilson", 100, seeds=3)
    assert (found.low, found.high, found.interval, found.seeds) == (40, None, "Wilson", 3)
