"""The paper's numbers as results/published.csv has them."""

import math

import pytest
from scipy.stats import binomtest

from experiments.reporting import published


@pytest.fixture
def file_of(tmp_path, monkeypatch):
    """file_of(text) puts another file in the place of published.csv."""

    def put(text):
        monkeypatch.setattr(published, "PATH", tmp_path / "published.csv")
        published.PATH.write_text(text, encoding="utf-8")
        published.numbers.cache_clear()

    yield put
    published.numbers.cache_clear()


HEAD = (
    "experiment,quantity,value,unit,calibration,expected_low,expected_high,calibration_note,margin,"
    "not_comparable\n"
)


def test_numbers_have_a_unit_and_a_known_calibration():
    found = published.numbers()
    assert len(found) > 20
    for one in found.values():
        assert one.unit in ("s", "%", "samples", "classes", "1", "×")
        assert one.calibration in ("", "fitted", "watched")
        assert math.isfinite(one.value)
        assert one.expected is None or one.expected[0] <= one.expected[1]
        # A range is what a calibration accepts: a number that no fit has seen has none.
        assert one.calibration or one.expected is None


def test_a_share_of_samples_has_wilsons_interval():
    one = published.numbers()["table1/softmax_test_accuracy"]
    wilson = binomtest(90, 100).proportion_ci(0.95, "wilson")
    assert (one.value, one.low, one.high) == pytest.approx(
        (90, 100 * wilson.low, 100 * wilson.high)
    )
    assert published.numbers()["table1/hdc_training_time"].low is None


def test_percents_are_fractions_where_a_value_is_asked_for():
    assert published.value("table1/softmax_test_accuracy") == 0.9
    assert published.value("table1/hdc_training_time") == 1.24
    assert published.value("table1/nothing") is None


def test_lines_without_a_value_are_left_out(file_of):
    file_of(f"{HEAD}a,b,1.5,s,fitted,1,2,why,0.5,so\na,c,,s,,,,,,\n")
    (one,) = published.numbers().values()
    assert one == published.Published(
        "a/b", 1.5, "s", None, None, "fitted", (1, 2), "why", 0.5, "so"
    )


@pytest.mark.parametrize(
    "text",
    [
        f"{HEAD}a,b,one,s,,,,,,\n",
        f"{HEAD}a,b,c/d,s,,,,,,\n",
        "experiment,quantity\na,b\n",
        f'{HEAD}a,"b\n',
    ],
)
def test_what_is_no_such_table_is_named(file_of, text):
    file_of(text)
    with pytest.raises(ValueError, match=r"published\.csv: expected .* found: "):
        published.numbers()


def test_a_quotient_is_of_two_others_of_its_experiment():
    found = published.numbers()
    ratio = found["table1/cnn3_time_over_hdc"].value
    assert ratio == pytest.approx(441.3 / 1.24)


def test_margins_are_below_half_of_what_the_paper_concludes_from():
    found = published.numbers()

    def value(name):
        return found[name].value

    of_accuracy = value("table1/hdc_test_accuracy") - value("table1/cnn1_test_accuracy")
    of_contrast = value("correlation/contrast_prototype") - value("correlation/contrast_speckle")
    judged = [one for one in found.values() if one.margin is not None]
    assert {one.unit for one in judged} == {"%", "1", "samples", "×"}
    for one in judged:
        half = {"%": of_accuracy / 2, "1": of_contrast / 2, "samples": one.value / 2, "×": 2}
        assert 0 < one.margin <= half[one.unit]
        assert not one.not_comparable


def test_every_number_is_judged_a_setting_or_says_why_not():
    for one in published.numbers().values():
        setting = one.name in ("table1/learning_rate", "touch/labels")
        assert (one.margin is not None) + bool(one.not_comparable) + setting == 1, one.name
        if one.unit == "s":
            assert one.not_comparable.startswith("seconds of another machine")
