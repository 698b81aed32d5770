"""The paper's numbers as results/published.csv has them."""

import math

from experiments.reporting import published


def test_every_number_is_judged_or_a_setting_or_says_why_not():
    for known in published.numbers().values():
        assert math.isfinite(known.value)
        setting = known.name in ("table1/learning_rate", "touch/labels")
        assert (known.margin is not None) + bool(known.not_comparable) + setting == 1, (
            known.name
        )
        assert known.unit != "s" or known.not_comparable, (
            known.name
        )  # of another machine


def test_margins_are_at_most_half_of_what_the_paper_concludes_from():
    known = published.numbers()
    lead = (
        known["table1/hdc_test_accuracy"].value
        - known["table1/cnn1_test_accuracy"].value
    )
    gain = (
        known["correlation/contrast_prototype"].value
        - known["correlation/contrast_speckle"].value
    )
    for number in known.values():
        if number.margin is not None:
            half = {"%": lead / 2, "1": gain / 2, "samples": number.value / 2, "×": 2}
            assert 0 < number.margin <= half[number.unit], number.name
