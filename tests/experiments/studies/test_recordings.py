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


def test_a_model_is_asked_in_its_first_draws_alone(of_small):
    about = {"splits": {"counts": RANDOM}, "models": composed.models("hdc", "ridge")}
    ask = partial(of_small(measure.Recordings), **about, n_per_class=[1, 5])
    rows = pd.DataFrame(ask(draws=2, seeds=[0, 1], limits={"ridge": {"draws": 3}}))
    draws = rows.groupby("model")[["seed", "draw"]].agg(list)
    assert draws.loc["hdc"].tolist() == [[0, 0, 1, 1], [0, 1, 0, 1]]
    assert draws.loc["ridge"].tolist() == [[0, 0, 1], [0, 1, 0]]
    assert rows.groupby(["seed", "draw"]).labels.count().eq(1).all()
    with pytest.raises(
        ValueError, match=r"task\.limits\.\*\.draw: expected no such key"
    ):
        ask(limits={"hdc": {"draw": 1}})


def test_costs_have_the_bytes_of_a_model_and_compiled_times_where_there_are_some(
    of_small,
):
    ask = of_small(measure.RecordingCosts)
    about = {"split": RANDOM, "models": composed.models("hdc", "softmax_dual")}
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
    named = composed.models("ridge", "mean_image")
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
    times, errors = pd.Series([1, 2, 2, 3, 3, 4]), pd.Series([9, 5, 5, 5, 4, 4])
    on_front = [True, True, True, False, True, False]  # equal points both stand
    assert is_on_front(times, errors).tolist() == on_front
