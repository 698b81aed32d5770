"""How far a sweep has come."""

import pytest

from experiments.protocol.sweep import progress, size, span


@pytest.mark.parametrize(
    ("params", "words", "expected"),
    [
        (None, ["-m", "seed.run=0,1,2"], 3),
        ({"seed.run": "0,1,2", "model": "hdc,ridge"}, [], 6),
        ({"seed.run": "0,1,2", "model": "hdc,ridge"}, ["seed.run=4"], 2),
        ({"task": "a"}, ["-m", "task.seeds=[0,1]", "hydra/launcher=joblib"], 1),
        (None, ["+scene.camera={a: 1, b: 2}", "model=choice(hdc,ridge)"], 2),
    ],
)
def test_the_number_of_runs_is_the_product_of_the_values(params, words, expected):
    assert size(params, words) == expected


def test_what_is_left_is_the_mean_of_what_was_carried_out_times_the_others():
    assert progress(1, 4, ["model=hdc", "a=1"], []) == "1 of 4: model=hdc a=1"
    expected = "3 of 4: model=b; about 5 min left"  # of two runs, 150 s each
    assert progress(3, 4, ["model=b"], [100, 200]) == expected
    assert progress(4, 4, [], [100, 200]) == "4 of 4: ; about 2 min left"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.2, "3 s"), (89, "89 s"), (90, "2 min"), (5399, "90 min"), (5400, "1.5 h")],
)
def test_spans_are_said_as_one_would(seconds, text):
    assert span(seconds) == text
