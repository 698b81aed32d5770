"""The paper's numbers as results/published.csv has them."""

import math

import pytest

from experiments.reporting import published

HEAD = (
    "experiment,quantity,value,unit,calibration,expected_low,expected_high,calibration_note,margin,"
    "not_comparable\n"
)


@pytest.fixture
def file_of(tmp_path, monkeypatch):
    """file_of(text) puts another file in the place of published.csv."""

    def put(text):
        monkeypatch.setattr(published, "PATH", tmp_path / "published.csv")
        published.PATH.write_text(text, encoding="utf-8")
        published.numbers.cache_clear()

    yield put
    published.numbers.cache_clear()


def test_every_number_is_judged_or_a_setting_or_says_why_not():
    for known in published.numbers().values():
        assert math.isfinite(known.value)
        setting = known.name in ("table1/learning_rate", "touch/labels")
        assert (known.margin is not None) + bool(known.not_comparable) + setting == 1, known.name
        assert known.unit != "s" or known.not_comparable, known.name  # of another machine
        # A range is what a calibration accepts: a number that no fit has seen has none.
        assert known.calibration or known.expected is None


def test_margins_are_at_most_half_of_what_the_paper_concludes_from():
    known = published.numbers()
    lead = known["table1/hdc_test_accuracy"].value - known["table1/cnn1_test_accuracy"].value
    gain = (
        known["correlation/contrast_prototype"].value - known["correlation/contrast_speckle"].value
    )
    for number in known.values():
        if number.margin is not None:
            half = {"%": lead / 2, "1": gain / 2, "samples": number.value / 2, "×": 2}
            assert 0 < number.margin <= half[number.unit], number.name


@pytest.mark.parametrize("row", ["a,b,one,s,,,,,,\n", "a,b,c/d,s,,,,,,\n", 'a,"b\n'])
def test_what_is_no_such_table_is_named(file_of, row):
    file_of(HEAD + row)
    with pytest.raises(ValueError, match=r"published\.csv: expected .* found: "):
        published.numbers()
