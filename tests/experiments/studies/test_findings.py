"""Sentences of the first screen of README follow the verdicts."""

import math

import pandas as pd
import pytest

from experiments.reporting.estimates import Estimate
from experiments.studies.claims import contest
from experiments.studies.claims import findings as module
from experiments.studies.claims.piece import Piece
from experiments.studies.claims.random_effects import Pooled
from experiments.studies.claims.verdict import Verdict


def verdict(word, value, units=4):
    pooled = Pooled(
        Estimate(value, value - 0.1, value + 0.1), math.nan, math.nan, 0, units
    )
    return Verdict(word, pooled, "captured", [])


@pytest.fixture
def judged(monkeypatch):
    def set_to(*lines, unseen=(), bits=None, objects=None, left=(), **tables):
        found = [(claim, rival, verdict(*of), []) for claim, rival, *of in lines]
        monkeypatch.setattr(module, "judged", lambda _: found)
        monkeypatch.setattr(module, "every_piece", lambda _: unseen)
        monkeypatch.setattr(contest, "measured", lambda _: bits or {})
        monkeypatch.setattr(contest, "confirmed", lambda _: objects or {})
        monkeypatch.setattr(contest, "missing", lambda _: left)
        return module.findings(None, **tables)

    return set_to


RIVALS = ("softmax_dual", "softmax_dual_standardised")


@pytest.mark.parametrize("word", ["yes", "no", "undecided"])
def test_the_words_are_those_of_the_verdict(judged, word):
    first, last = judged(*(("accuracy", rival, word, -0.158) for rival in RIVALS))
    assert "−15.8 points [−25.8, −5.8]" in first
    assert "over 4 laboratories" in first
    assert first.startswith(f"**Published HDC {module.RECOGNISES[word]}**: ")
    assert first.count(f"*{word}*") == 2
    assert last == module.LAST


def test_two_rivals_may_get_two_words(judged):
    first, _ = judged(
        ("accuracy_mended", RIVALS[0], "yes", 0.02),
        ("accuracy_mended", RIVALS[1], "no", -0.08),
    )
    assert first.startswith("**Extended HDC, with 7 levels per pixel and LDA, does not")
    assert "does not keep up with converged softmax**" in first  # one no is a no
    assert "on standardised frames, *no*; " in first
    assert "on raw frames, *yes* " in first


def test_one_yes_is_no_yes(judged):
    first, _ = judged(
        ("accuracy_mended", RIVALS[0], "undecided", 0.05),
        ("accuracy_mended", RIVALS[1], "yes", 0.03),
    )
    assert "keeps up with converged softmax on standardised frames**" in first


def laboratories(*values):
    """A piece of each laboratory; the variance of the last is far the largest."""
    return [
        Piece(
            "accuracy_mended",
            RIVALS[0],
            name,
            name,
            "captured",
            "",
            Estimate(value),
            0.1 if place == len(values) - 1 else 1e-4,
        )
        for place, (name, value) in enumerate(zip("abcdef", values, strict=False))
    ]


@pytest.mark.parametrize(
    ("values", "word", "head"),
    [
        ((0.03, 0.04, 0.05, -0.2), "undecided", "may or may not keep up"),
        ((0.03, 0.04, 0.05, 0.04), "yes", "keeps up with converged softmax on raw and"),
    ],
)
def test_a_yes_also_needs_laboratories_of_equal_weight(
    monkeypatch, judged, values, word, head
):
    pooled = Pooled(Estimate(0.04, 0.01, 0.07), math.nan, math.nan, 0, 4)
    found = [
        (
            "accuracy_mended",
            rival,
            Verdict("yes", pooled, "captured", laboratories(*values)),
            [],
        )
        for rival in RIVALS
    ]
    judged()
    monkeypatch.setattr(module, "judged", lambda _: found)
    first, _ = module.findings(None)
    if word == "undecided":
        assert "(with equal weights −2.0 points [" in first
        assert head in first
    else:
        assert "(with equal weights +4.0 points [" in first
        assert first.startswith(
            "**Extended HDC, with 7 levels per pixel and LDA, keeps up"
        )
    assert first.count("on standardised frames, *yes* (with equal weights") == 1
    assert first.count(f", *{word}*)") == 2


@pytest.mark.parametrize(
    ("value", "head"),
    [
        (0.0, "lose nothing"),
        (-0.2, "lose accuracy"),
        (-0.03, "may or may not lose accuracy"),
    ],
)
def test_the_contest_of_bits_and_greys(judged, value, head):
    bits = {
        name: contest.Measured(name, value + 0.001 * place, 1e-5, 50)
        for place, name in enumerate("abcd")
    }
    objects = {"visuotactile": Estimate(-0.1, -0.15, -0.05)}
    text, _ = judged(
        ("accuracy", RIVALS[0], "no", -0.1),
        ("accuracy", RIVALS[1], "no", -0.1),
        bits=bits,
        objects=objects,
    )[1:]
    assert text.startswith(
        f"**Chosen alike on training frames, one to seven bits per pixel {head}"
    )
    assert "(4 laboratories)" in text
    assert text.endswith(
        "Dome, objects, unseen before: −10.0 points [−15.0, −5.0], *no*."
    )


def test_a_contest_of_a_part_of_the_recordings_has_no_verdict(judged):
    bits = {name: contest.Measured(name, 0.0, 1e-5, 50) for name in "abcd"}
    lines = [("accuracy", rival, "no", -0.1) for rival in RIVALS]
    text = judged(*lines, bits=bits, left=["gelsight", "tactip"])[1]
    assert text == (
        "**Bits against grey values, chosen alike on training frames**: no verdict yet, "
        "8 of 10 recordings are measured."
    )


def test_what_was_not_measured_has_no_sentence(judged):
    assert judged() == []
    assert len(judged(("accuracy", RIVALS[0], "no", -0.1))) == 0
    times, _ = judged(("softmax", "softmax_dual", "no", 3.64))
    assert "softmax ×3.6 [3.5, 3.7], *no* (*yes*: at least ten" in times
    assert "CNN" not in times


def test_one_model_alone_has_no_order(judged):
    alone = table1(("hdc", 1.0, 1.0), ("other", 0.1, 0.2))  # which the paper lacks
    unmeasured = table1(("softmax", 0.89, 1.0), ("cnn1", 0.8, 1.0), ("other", 0.1, 0.2))
    for rows in (alone, unmeasured):
        assert judged(table1=rows) == []


def test_training_times_name_each_model(judged):
    text, _ = judged(
        ("softmax", "softmax_dual", "no", 3.64),
        ("networks_one_layer", "cnn1", "yes", 129.0),
        ("networks_three_layers", "cnn3", "partly", 9.1),
    )
    for name in (
        "converged softmax",
        "the CNN of one layer",
        "the CNN of three layers",
    ):
        assert f"{name} ×" in text
    assert text.count("×") == 3


def unseen(claim, value, recording="gelsight_billets", **more):
    about = {"rival": module.STRONGER, "status": "confirmatory", **more}
    estimate = Estimate(value, value - 0.1, value + 0.1)
    words = {"laboratory": "x", "frames": "captured", "quantity": "less"}
    return Piece(claim, evidence=recording, estimate=estimate, **words, **about)


def test_unseen_recordings_have_both_forms_against_the_stronger_rival(judged):
    pieces = [
        unseen("accuracy", -0.217),
        unseen("accuracy_mended", 0.0139),
        unseen("accuracy", 0.05, rival="softmax_dual"),
        unseen("accuracy", 0.06, "gelsight", status="exploratory"),
        unseen("accuracy_mended", 0.07, "gelsight", status="exploratory"),
        unseen("accuracy", 0.08, "tactip", enters=False),
        unseen("accuracy_mended", 0.09, "tactip", enters=False),
    ]
    text, _ = judged(unseen=pieces)
    assert text.endswith("frames. GelSight, billets: −21.7 published, +1.4 extended.")


def test_unseen_recordings_are_in_the_order_of_the_evidence(judged):
    """One without both forms has no part."""
    pieces = [
        unseen(claim, value, recording)
        for claim, by_recording in (
            ("accuracy", {"rgb_fibres": -1.5, "tactip": 1.0, "gelsight_billets": 0.03}),
            ("accuracy_mended", {"gelsight_billets": 0.04, "rgb_fibres": 0.02}),
        )
        for recording, value in by_recording.items()
    ]
    text, _ = judged(unseen=pieces)
    # No difference of accuracies is larger than 100 points.
    assert text.endswith(
        "Plastic fibres: −100.0 published, +2.0 extended; "
        "GelSight, billets: +3.0 published, +4.0 extended."
    )
    assert judged(unseen=pieces[1:2]) == []


def test_the_extended_form_has_its_cost_in_time(judged):
    lines = [("accuracy_mended", rival, "yes", 0.02) for rival in RIVALS]
    costs = pd.DataFrame(
        [
            ("a", 5, "hdc", 0.1),  # of fewer frames, which do not count
            ("a", 50, "hdc", 0.5),
            ("a", 50, "hdc_levels_lda", 3.0),
            ("b", 50, "hdc", 2.0),
            ("b", 50, "hdc_levels_lda", 5.0),
            ("b", 50, "ridge", 9.0),
        ],
        columns=["recording", "n", "model", "fit_s"],
    )
    text, _ = judged(*lines, costs=costs)
    assert text.endswith(
        "Training takes 2.5 to 6.0 times as long as for the published form."
    )
    text, _ = judged(*lines, costs=costs[costs.model == "hdc"])
    assert "Training takes" not in text


def test_softmax_by_descent_stands_beside_the_paper_s_row(judged):
    """It is no model of its own in the order."""
    rows = table1(("hdc", 1.0, 1.0), ("softmax", 0.89, 1.0), ("other", 0.1, 0.2))
    descent = {
        **dict.fromkeys(("test_accuracy_at_target", "test_accuracy_final"), 0.7),
        **{"model": "softmax_descent", "published_test_accuracy": 0.9},
        **{"published_training_time_over_hdc": 137.097},
        **{"test_accuracy_at_papers": 0.8633, "test_accuracy_at_papers_low": 0.7},
        **{"test_accuracy_at_papers_high": 1.0, "training_time_over_numpy_hdc": 93.3},
        **{"training_time_over_numpy_hdc_low": 79.4},
        **{"training_time_over_numpy_hdc_high": 96.4},
    }
    every = pd.concat([rows, pd.DataFrame([descent])], ignore_index=True)
    text, _ = judged(table1=every)
    assert "Converged: 100 %. Softmax by full-batch descent" in text
    assert "has, at the paper's training accuracy, 86.3 [" in text
    assert "(paper: 90 %), and 93 [79, 96] times the training time" in text
    assert text.endswith("(paper: 137).")


def table1(*rows):
    columns = ["model", "test_accuracy_at_target", "test_accuracy_final"]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.assign(published_test_accuracy=[0.9] * (len(rows) - 1) + [math.nan])


@pytest.mark.parametrize(
    ("early", "late", "head"),
    [
        (0.89, 1.0, "HDC leads Table I only where training stops early"),
        (1.0, 1.0, "Table I"),
        (0.89, 0.95, "Table I"),
    ],
)
def test_the_order_of_table1_is_said_only_where_it_is_so(judged, early, late, head):
    rows = table1(("hdc", 1.0, 1.0), ("softmax", early, late), ("other", 0.1, 0.2))
    text, _ = judged(table1=rows)
    assert text.startswith(
        f"**{head}**. Test accuracy at 90 % training accuracy: HDC 100"
    )
    assert "other" not in text  # the paper does not have it
    assert text.endswith(
        "Converged: 100 %." if late == 1 else "Converged: 100, 95.0 %."
    )
