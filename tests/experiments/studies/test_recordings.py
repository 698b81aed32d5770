"""Measured recordings: what a draw trains on, the rows, and the estimates made of them."""

from functools import partial
from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from experiments.protocol.task import Context
from experiments.records.results import Results
from experiments.reporting import forms
from experiments.reporting.resamples import RIVAL
from experiments.studies.claims.forest import forest
from experiments.studies.recordings import figures as drawing
from experiments.studies.recordings import measure, tables
from experiments.studies.recordings.tables import Accuracies, recordings
from experiments.studies.recordings.view import STUDY
from tests.experiments import composed

RANDOM = {"kind": "random", "test_fraction": 0.5}


@pytest.fixture
def of_small(recording):
    """of_small(task) → its rows on a small recording, without the runner."""
    scene = composed.part("scene", "recorded")["scene"] | {
        "path": str(recording(60, 3))
    }
    context = Context(console=Console(quiet=True), force=True, scene_name="here")

    def rows(kind, **config):
        return list(composed.made(kind, scene=scene, **config).rows(context))

    return lambda kind: partial(rows, kind)


def models(*names):
    return {name: composed.part("model", name) for name in names}


def test_a_model_is_asked_in_its_first_draws_alone(of_small):
    named = models("hdc", "ridge", "greys_chosen")
    splits = {"random": RANDOM, "counts": RANDOM}
    about = {"splits": splits, "models": named, "n_per_class": [1, 5, 999]}
    ask = partial(of_small(measure.Recordings), **about, draws=2, seeds=[0, 1])
    rows = pd.DataFrame(ask(limits={"ridge": {"draws": 3}}))
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
        ({"hdc": {"draw": 1}}, r"task\.limits\.hdc\.draw: expected"),
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


def test_bytes_of_a_model_are_those_of_its_bits(of_small):
    names = ("hdc", "hdc_levels_lda", "softmax_dual")
    ask = of_small(measure.RecordingCosts)
    about = {"split": RANDOM, "models": models(*names), "n_per_class": [1, 5]}
    rows = ask(**about, repeats=1)
    asked = [(row["model"], row["n"]) for row in rows]
    assert asked == [(name, n) for n in (1, 5) for name in names]
    found = {row["model"]: row for row in rows}
    classes, pixels = found["hdc"]["n_classes"], found["hdc"]["n_pixels"]
    padded, planes = (8 * -(-bits // 64) for bits in (pixels, 7 * pixels))
    assert {name: row["bytes"] for name, row in found.items()} == {
        "hdc": classes * padded,
        "hdc_levels_lda": 4 * classes * planes + 16 * classes,
        "softmax_dual": 4 * classes * (pixels + 1),
    }
    assert all(row["fit_s"] > 0 for row in rows)
    compiled = {name for name, row in found.items() if "fit_compiled_s" in row}
    assert compiled == (set(names[:2]) if find_spec("numba") else set())


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


# What the tables say -----------------------------------------------------------------------------


def of_draws(right, draws=20, sizes=(5, 50)):
    """Rows by the split that counts: `right` of each model, a number or one for each draw."""
    return [
        {
            "origin": "measured", "seed": 0, "split": "counts", "draw": draw, "model": model,
            "n_test": 100, "n": list(sizes), "right": [int(count) // 2, int(count)],
        }
        for model, counts in right.items()
        for draw, count in enumerate(np.broadcast_to(counts, draws))
    ]  # fmt: skip


@pytest.fixture
def measured(tmp_path, write_measurement):
    """measured(scene={model: right …}) → the frame of such measurements; of rows as they are."""

    def write(name="recordings", **scenes):
        for scene, right in scenes.items():
            rows = of_draws(right) if isinstance(right, dict) else right
            config = {"scene": composed.part("scene", scene)["scene"]}
            write_measurement(name, rows, config=config, scene=scene)
        return Results(tmp_path).frame("recordings")

    return write


@pytest.mark.parametrize(("draws", "known"), [(9, False), (10, True)])
def test_accuracies_of_one_n_are_those_of_the_rows(measured, draws, known):
    right = np.arange(60, 60 + draws)
    frame = measured(gelsight=of_draws({"hdc": right}, draws))
    (rows,) = recordings(frame).values()
    every = Accuracies(rows)
    assert every.sizes == [5, 50]
    assert every.by_unit("hdc", 5).tolist() == (right // 2 / 100).tolist()
    found = every.mean("hdc", 50)
    bounds = np.quantile(right / 100, (0.025, 0.975)) if known else [np.nan] * 2
    assert found == pytest.approx((right.mean() / 100, *bounds), nan_ok=True)
    assert np.isnan(every.mean("ridge", 50).value)


def test_models_are_compared_in_the_draws_in_which_both_were_asked(measured):
    rows = of_draws({"hdc": [40] * 10 + [100] * 10})
    rows += of_draws({"hdc_lda": 50}, draws=10)
    frame = measured(gelsight=rows)
    (step,) = tables.decomposition(frame).to_dict("records")
    assert step["step"] == "LDA to majority: as published"
    found = (step["before_accuracy"], step["after_accuracy"], step["change"])
    assert found == pytest.approx((0.5, 0.4, -0.1))


def test_the_forest_has_every_form_against_softmax_of_standardised_frames(measured):
    right = {"hdc": 60, "thumbnail": 70, RIVAL: 99, forms.RIVAL_FORM: 65}
    few = of_draws({"hdc": 60, forms.RIVAL_FORM: 50}, sizes=(1, 5))  # in both panels
    frame = measured(gelsight=right, tactip=few, fibre_2={"hdc": 60})
    data = forest(frame)
    pooled = data[data.kind == "all"]  # of the findings, whatever was measured
    assert dict(zip(pooled.form, pooled.difference.round(3), strict=True)) == {
        "hdc": -0.196,
        "hdc_levels_lda": 0.033,
    }
    data = data[data.kind != "all"].set_index(["recording", "form", "size"])
    assert data.difference.round(9).to_dict() == {
        ("gelsight", "hdc", "few"): -0.02,
        ("gelsight", "thumbnail", "few"): 0.03,
        ("gelsight", "hdc", "most"): -0.05,
        ("gelsight", "thumbnail", "most"): 0.05,
        ("tactip", "hdc", "few"): 0.1,
        ("tactip", "hdc", "most"): 0.1,
    }


def test_every_experiment_of_recordings_asks_the_named_forms():
    for name in ("recordings", "recording_costs"):
        assert set(forms.FORMS) <= set(composed.task(name)["models"])


# Costs --------------------------------------------------------------------------------------------


def test_a_model_has_its_error_and_its_times_relative_to_softmax(
    measured, write_measurement, answers
):
    measured(gelsight={"hdc": 60, RIVAL: 100, "bits_chosen": 96})
    at = {"n_classes": 10, "n_pixels": 800, "bytes": 1000}
    compiled = {"fit_compiled_s": 0.5, "predict_frame_compiled_s": 1e-4}
    rows = [
        {"model": model, "n": n, "fit_s": s, "predict_frame_s": s / 1e3, **at, **more}
        for model, n, s, more in (
            ("hdc", 5, 1.0, {}),
            ("hdc", 50, 2.0, compiled),
            ("bits_chosen", 50, 4.0, {}),
            (RIVAL, 50, 1.0, {}),
            ("knn_greys", 50, 1.0, {}),
        )
    ]
    write_measurement("recording_costs", rows, scene="gelsight")
    table = answers(STUDY).table("recording_costs")
    shown = table.data.set_index(["model", "n"])
    assert shown.error.to_dict() == pytest.approx(
        {
            ("hdc", 5): 0.7,
            ("hdc", 50): 0.4,
            ("bits_chosen", 50): 0.04,
            (RIVAL, 50): 0.0,
            ("knn_greys", 50): np.nan,  # not asked
        },
        nan_ok=True,
    )
    assert table.cells()[1] == [
        "GelSight", "50", "HDC as published", "40", "2.00; compiled 0.500",
        "2.00; compiled 0.100", "1.00 kB", "1.0",
    ]  # fmt: skip
    # The faster of both, over the rival's on as many frames.
    line = shown.loc["hdc", 50]
    relative = (line.fit_relative, line.predict_frame_relative)
    assert relative == pytest.approx((0.5, 0.1))
    assert np.isnan(shown.loc["hdc", 5].fit_relative)
    assert shown.loc["bits_chosen", 50].fit_best_s == 4


def test_the_front_has_no_point_with_less_of_both():
    times, errors = pd.Series([1, 2, 3, 3, 4]), pd.Series([9, 5, 5, 4, 4])
    assert drawing.is_on_front(times, errors) == [True, True, False, True, False]
    equal = pd.Series([1, 1])
    assert drawing.is_on_front(equal, equal) == [True, True]  # both stand
