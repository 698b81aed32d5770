"""How far a sweep has come."""

import pytest

from experiments.protocol.sweep import Progress, size, span


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
    progress = Progress(4)
    assert progress.next(["model=hdc"]) == "1 of 4: model=hdc"
    assert progress.next(["model=a"]) == "2 of 4: model=a"  # the first was there
    progress.took(100)
    progress.took(200)
    assert progress.next(["model=b"]) == "3 of 4: model=b; about 5 min left"
    assert progress.next([]) == "4 of 4: ; about 2 min left"


def test_spans_are_said_as_one_would():
    assert [span(s) for s in (3.2, 89, 90, 5000, 5399, 5400, 6000)] == [
        "3 s",
        "89 s",
        "2 min",
        "83 min",
        "90 min",
        "1.5 h",
        "1.7 h",
    ]
