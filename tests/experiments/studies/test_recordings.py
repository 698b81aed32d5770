"""Measured recordings: which models a draw asks, and how long they are timed."""

from functools import partial
from importlib.util import find_spec

import pandas as pd
import pytest
from rich.console import Console

from experiments.protocol.task import Context
from experiments.reporting import forms
from experiments.reporting.pareto import is_on_front
from experiments.studies.recordings import measure
from tests.experiments import composed

RANDOM = {"kind": "random", "test_fraction": 0.5}


@pytest.fixture
def of_small(recording):
    """of_small(task) → its rows on a small recording, without the runner."""
    scene = composed.part("scene", "recorded")["scene"] | {
        "path": str(recording(60, 3))
    }
    context = Context(console=Console(quiet=True), force=True)

    def rows(kind, **config):
        return list(composed.made(kind, scene=scene, **config).rows(context))

    return lambda kind: partial(rows, kind)


def models(*names):
    return {name: composed.part("model", name) for name in names}


def test_a_model_is_asked_in_its_first_draws_alone(of_small, monkeypatch):
    told = []
    monkeypatch.setattr(Context, "note", lambda _, text: told.append(text))
    named = models("hdc", "ridge", "greys_chosen")
    splits = {"random": RANDOM, "counts": RANDOM}
    about = {"splits": splits, "models": named, "n_per_class": [1, 5, 999]}
    ask = partial(of_small(measure.Recordings), **about, draws=2, seeds=[0, 1])
    rows = pd.DataFrame(ask(limits={"ridge": {"draws": 3}}))
    assert told[-1] == "seed 1, split counts, draw 2 of 2"
    draws = list(zip(rows.seed, rows.draw, strict=True))
    asked = rows.assign(at=draws).groupby(["split", "model"])["at"].agg(list)
    every = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for split in splits:
        assert asked[split, "hdc"] == asked[split, "greys_chosen"] == every
        assert asked[split, "ridge"] == every[:3]
    assert rows.groupby(["split", "seed", "draw"]).labels.count().eq(1).all()
    assert rows.n.tolist() == [[1, 5]] * len(rows)
    chosen = rows[rows.model == "greys_chosen"].chose
    assert all({*forms} <= {"raw", "standardised", "smoothed"} for forms in chosen)
    assert rows[rows.model == "hdc"].chose.isna().all()
    for wrong, message in (
        ({"hcd": {"draws": 1}}, r"limits: expected models among .* 'hcd'"),
        ({"hdc": {"draw": 1}}, r"task\.limits\.hdc\.draw: expected one of draws"),
    ):
        with pytest.raises(ValueError, match=message):
            ask(limits=wrong)


def test_compiled_kernels_answer_as_numpy_does(of_small, monkeypatch):
    named = models("hdc", "hdc_lda", "hdc_levels_lda", "hdc_deviation_lda")
    about = {"splits": {"counts": RANDOM}, "models": named, "n_per_class": [1, 5]}
    ask = partial(of_small(measure.Recordings), **about, draws=2)
    rows = ask()
    monkeypatch.setattr(measure, "_use_kernels", lambda models: None)
    assert ask() == rows


def test_costs_have_the_bytes_of_a_model_and_compiled_times_where_there_are_some(
    of_small,
):
    ask = of_small(measure.RecordingCosts)
    about = {"split": RANDOM, "models": models("hdc", "softmax_dual")}
    few, _, many, softmax = ask(**about, n_per_class=[1, 5], repeats=1)
    assert (few["n"], many["n"], softmax["n"]) == (1, 5, 5)
    classes, pixels = many["n_classes"], many["n_pixels"]
    assert many["bytes"] == classes * 8 * -(-pixels // 64)
    assert softmax["bytes"] == 4 * classes * (pixels + 1)
    assert ("fit_compiled_s" in many) == bool(find_spec("numba"))
    assert "fit_compiled_s" not in softmax


def test_repetitions_take_turns_until_a_model_has_taken_its_time(of_small, monkeypatch):
    turns = []

    def repeat(timed, frames, labels, _):
        turns.append(type(timed.model).__name__)
        timed.fit_s.append(10.0 / len(turns))
        timed.predict_frame_s.append(1.0 / len(turns))
        timed.trained = timed.model.fit(frames, labels)

    monkeypatch.setattr(measure.Timed, "repeat", repeat)
    ask = of_small(measure.RecordingCosts)
    named = models("ridge", "mean_image")
    about = {"split": RANDOM, "models": named, "n_per_class": [5]}
    ridge, mean = ask(**about, repeats=3, most_s=12)
    first, second = turns[:2]
    assert turns == [first, second, first, second, second]  # 10 + 10/3 s are enough
    assert (ridge["fit_s"], mean["fit_s"]) == (10 / 3, 10 / 5)
    assert ridge["predict_frame_s"] == 1 / 3


def test_every_experiment_of_recordings_asks_the_named_forms():
    for name in ("recordings", "recording_costs"):
        assert set(forms.FORMS) <= set(composed.task(name)["models"])


def test_the_front_has_no_point_with_less_of_both():
    times, errors = pd.Series([1, 2, 3, 3, 4]), pd.Series([9, 5, 5, 4, 4])
    on_front = is_on_front(times, errors)
    assert on_front.tolist() == [True, True, False, True, False]
    equal = pd.Series([1, 1])
    assert is_on_front(equal, equal).tolist() == [True, True]  # both stand
