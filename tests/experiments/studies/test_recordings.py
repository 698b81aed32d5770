"""Measured recordings: what a draw trains on, the rows, and the estimates made of them."""

from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest
import torch
from matplotlib import pyplot as plt
from rich.console import Console

from baselines.chosen import GreysChosen
from experiments.protocol.experiment import Run
from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.records import configs
from experiments.records.results import Results
from experiments.records.rows import unpack_labels
from experiments.reporting.measured import RIVAL, with_right
from experiments.studies.recordings import (
    costs,
    decomposition,
    forest,
    measure,
    tables,
    values,
    view,
)
from experiments.studies.recordings.measure import (
    recording_costs,
    recordings,
)
from scenes.frames import Frames

RANDOM = {"kind": "random", "test_fraction": 0.5}
MODELS = {name: configs.part("model", name) for name in ("hdc", "hdc_integer", "ridge")}


@pytest.fixture
def scene(frames_and_labels):
    frames, labels = frames_and_labels(90, classes=3, side=12)
    return Frames(torch.from_numpy(frames), labels, ("a", "b", "c"))


def test_training_sets_grow_and_hold_no_test_frame(scene):
    pool, test = resample_split(scene, Split(**RANDOM), (0, 0), most_test=20)
    assert len(test) == 20
    order, sizes = nested(pool, scene.labels, [1, 5, 1000], (0, 0))
    assert sizes == [1, 5]  # no class has a thousand
    for label, frames in enumerate(order):
        assert set(scene.labels[frames]) == {label}
        assert not set(frames) & set(test)
    again = resample_split(scene, Split(**RANDOM), (0, 0), most_test=20)
    assert all(map(np.array_equal, (pool, test), again))
    assert not np.array_equal(
        test, resample_split(scene, Split(**RANDOM), (0, 1), most_test=20)[1]
    )


def test_rows_of_a_small_recording(scene, recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True)
    rows = list(recordings.rows(run, of, {"random": RANDOM}, MODELS, [1, 5], draws=2))
    assert len(rows) == 2 * len(MODELS)
    for k, row in enumerate(rows):
        assert row["n"] == [1, 5]
        assert ("labels" in row) == (k % len(MODELS) == 0)  # once a draw
    counted = with_right(pd.DataFrame(rows), ("seed", "split", "draw"))
    for row, right in zip(rows, counted.right, strict=True):
        truth = rows[row["draw"] * len(MODELS)]["labels"]
        for predicted, n_right in zip(row["predicted"], right, strict=True):
            said = unpack_labels(predicted)
            assert len(said) == row["n_test"]
            assert (said == unpack_labels(truth)).sum() == n_right


def test_one_fibre_seen_through_more_fields_is_one_recording(
    tmp_path, write_measurement
):
    row = {
        "draw": 0,
        "seed": 0,
        "model": "hdc",
        "split": "counts",
        "n_test": 10,
        "n": [1],
    }
    for scene in ("fibre_grouped", "fibre_4_fields", "fibre_16_fields"):
        config = {"scene": configs.part("scene", scene)["scene"]}
        write_measurement(
            "recordings", [row | {"right": [5]}], config=config, scene=scene
        )
    results = Results(tmp_path)
    assert list(values.recordings(results.frame("recordings"))) == ["fibre_grouped"]


def test_a_change_of_settings_does_not_displace_the_whole_measurement(
    tmp_path, write_measurement
):
    scene = configs.task("recordings")["scene"]
    for draws, right in ((20, 90), (2, 10)):
        row = {
            "seed": 0,
            "split": "counts",
            "draw": 0,
            "n_test": 100,
            "n": [5],
            "right": [right],
        }
        rows = [
            row | {"model": name, "draw": k}
            for name in ("hdc", RIVAL)
            for k in range(3)
        ]
        config = {"scene": scene, "draws": draws, "seeds": [0]}
        write_measurement("recordings", rows, config=config, scene="gelsight")
    (measured,) = values.recordings(Results(tmp_path).frame("recordings")).values()
    assert measured.config.iloc[0]["draws"] == 20
    assert values.Accuracies(measured).mean("hdc", 5).value == 0.9


# What the tables say -----------------------------------------------------------------------------


def measured_of(right, draws=20, n=50, n_test=100, seed=0):
    """Rows by the split that counts: `right` of each model, a number or one for each draw."""
    rows = []
    for model, of_model in right.items():
        of_draws = np.broadcast_to(of_model, draws)
        rows += [
            {
                "seed": seed,
                "split": "counts",
                "draw": draw,
                "model": model,
                "n_test": n_test,
                "n": [5, n],
                "right": [int(count) // 2, int(count)],
            }
            for draw, count in enumerate(of_draws)
        ]
    return rows


@pytest.fixture
def results(tmp_path, write_measurement):
    """results(scene={model: right …}): the records of such measurements."""

    def write(**scenes):
        for scene, right in scenes.items():
            config = {"scene": configs.part("scene", scene)["scene"]}
            rows = measured_of(right)
            write_measurement("recordings", rows, config=config, scene=scene)
        return Results(tmp_path)

    return write


def test_forms_are_set_beside_both_rivals_and_losses_are_shown(results):
    of = {
        "hdc": 60,
        "hdc_levels_lda": np.arange(70, 90),
        "hdc_levels": 50,
        "softmax_dual": 62,
        "softmax_dual_standardised": 80,
    }
    data = tables.forms(results(gelsight=of).frame("recordings"))
    rows = data.set_index(["n", "rival"])
    at = rows.loc[(50, "softmax_dual")]
    assert at.hdc == pytest.approx(-0.02)
    assert at.hdc_levels == pytest.approx(-0.12)
    expected = np.arange(70, 90) / 100 - 0.62
    assert at.hdc_levels_lda == pytest.approx(expected.mean())
    low, high = np.quantile(expected, (0.025, 0.975))
    assert (at.hdc_levels_lda_low, at.hdc_levels_lda_high) == pytest.approx((low, high))
    assert rows.loc[(50, "softmax_dual_standardised")].hdc == pytest.approx(-0.2)
    heads = {
        name: column.head for name, column in tables._columns_of_forms(data).items()
    }
    confirmed = {name for name, head in heads.items() if "(fixed in advance)" in head}
    assert confirmed == {"hdc", "hdc_levels_lda"}
    assert "(exploratory)" in heads["hdc_levels"]


def test_few_draws_have_no_interval(tmp_path, write_measurement):
    rows = [row for row in measured_of({"hdc": np.arange(60, 80)}) if row["draw"] < 9]
    write_measurement("recordings", rows, scene="gelsight")
    (measured,) = values.recordings(Results(tmp_path).frame("recordings")).values()
    estimate = values.Accuracies(measured).mean("hdc", 50)
    assert estimate.value == pytest.approx(0.64)
    assert np.isnan([estimate.low, estimate.high]).all()


def test_a_recording_that_needs_no_speckle_says_so(results):
    of = {"hdc": 60, "thumbnail": 75, "brightness": 55, "ridge": 80}
    best = {**of, "brightness": 70, "ridge": 65}
    table = tables.front(results(gelsight=of, tactip=best).frame("recordings"))
    told = table[table.n == 50].set_index("recording").told
    assert told["gelsight"] == "coarse layout alone: more than HDC"
    assert told["tactip"] == (
        "brightness and coarse layout alone: more than HDC, and than any model here"
    )
    no_more = tables.front(
        results(gelsight={**of, "thumbnail": 60}).frame("recordings")
    )
    assert no_more.told.tolist()[:2] == ["", ""]


def test_steps_add_up_to_the_whole_loss(results):
    accuracy = {
        "ridge_standardised": 80,
        "linear_bits": 78,
        "hdc_lda": 79,
        "hdc_integer": 50,
        "hdc": 45,
    }
    table = decomposition.decomposition(results(gelsight=accuracy).frame("recordings"))
    assert table.change.sum() == pytest.approx(-0.35)
    assert table.change.min() == pytest.approx(-0.29)
    assert "equal weights" in table.step[table.change.idxmin()]


def test_the_forest_takes_the_stronger_rival(results):
    found = results(
        gelsight={
            "hdc": 60,
            "hdc_levels_lda": 70,
            "softmax_dual": 50,
            "softmax_dual_standardised": 65,
        },
        spr={"hdc": 100, "softmax_dual": 100},
    )
    dots = {
        (dot.scene, dot.form, dot.few): dot.difference.value
        for dot in forest.dots(found.frame("recordings"))
    }
    assert dots["gelsight", "hdc", False] == pytest.approx(-0.05)
    assert dots["gelsight", "hdc_levels_lda", False] == pytest.approx(0.05)
    assert {scene for scene, *_ in dots} == {"gelsight"}  # the other is saturated
    (plot,) = [p for p in view.STUDY.plots_of(found) if p.name == "forest"]
    figure = plot.draw()
    names = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    plt.close(figure)
    assert names == ["captured", "GelSight"]


def test_a_model_is_asked_within_its_limits(recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True, scene_name="here")
    splits = {"random": RANDOM, "counts": RANDOM}
    models = {**MODELS, "greys_chosen": configs.part("model", "greys_chosen")}
    models["softmax"] = configs.part("model", "softmax")
    stop = {"least_steps": 1, "most_steps": 3, "loss": 0.0}
    limits = {
        "ridge": {"draws": 3, "splits": ["counts"]},
        "greys_chosen": {"n_per_class": [5], "scenes": ["here"]},
        "softmax": {"draws": 1, "stop": stop},
        "hdc_integer": {"scenes": ["elsewhere"]},
    }

    def ask(limits):
        rows = recordings.rows(
            run, of, splits, models, [1, 5], draws=2, seeds=[0, 1], limits=limits
        )
        return pd.DataFrame(rows)

    rows = ask(limits)
    asked = rows.groupby(["split", "model"]).apply(
        lambda part: list(zip(part.seed, part.draw, strict=True)),
        include_groups=False,
    )
    every = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for split in splits:
        assert asked[split, "hdc"] == asked[split, "greys_chosen"] == every
        assert asked[split, "softmax"] == [(0, 0)]
    assert asked["counts", "ridge"] == [(0, 0), (0, 1), (1, 0)]
    assert not {("random", "ridge"), ("counts", "hdc_integer")} & set(asked.index)
    chosen = rows[rows.model == "greys_chosen"]
    assert chosen.n.tolist() == [[5]] * 8
    forms = GreysChosen().forms()
    assert all(form in forms for (form,) in chosen.chose)
    assert rows[rows.model == "softmax"].stopped.tolist() == [["steps"] * 2] * 2
    assert rows[rows.model == "hdc"].stopped.isna().all()
    with pytest.raises(ValueError, match=r"limits: expected models among .* 'hcd'"):
        ask({"hcd": {"draws": 1}})
    with pytest.raises(ValueError, match=r"limits\.hdc\.draw: expected one of scenes"):
        ask({"hdc": {"draw": 1}})


def test_bytes_of_a_model_are_those_of_its_bits(recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True)
    names = ("hdc", "hdc_levels_lda", "softmax_dual")
    models = {name: configs.part("model", name) for name in names}
    limits = {"hdc_levels_lda": {"n_per_class": [5]}}
    rows = list(
        recording_costs.rows(
            run, of, RANDOM, models, n_per_class=[1, 5], repeats=1, limits=limits
        )
    )
    asked = [(row["model"], row["n"]) for row in rows]
    assert asked == [("hdc", 1), ("softmax_dual", 1), *((name, 5) for name in names)]
    found = {row["model"]: row for row in rows}
    classes, pixels = found["hdc"]["n_classes"], found["hdc"]["n_pixels"]

    def padded(bits):
        return 8 * -(-bits // 64)

    assert found["hdc"]["bytes"] == classes * padded(pixels)
    planes = 4 * classes * padded(7 * pixels)
    assert found["hdc_levels_lda"]["bytes"] == planes + 16 * classes
    assert found["softmax_dual"]["bytes"] == 4 * classes * (pixels + 1)
    assert all(row["fit_s"] > 0 for row in rows)
    compiled = {name for name, row in found.items() if "fit_compiled_s" in row}
    assert compiled == (set(names[:2]) if find_spec("numba") else set())


def test_repetitions_take_turns_until_a_model_has_taken_its_time(
    recording, monkeypatch
):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    turns = []

    def repeat(timed, *_):
        turns.append(type(timed.model).__name__)
        timed.fit_s.append(10.0 / len(turns))
        timed.predict_frame_s.append(1.0 / len(turns))
        timed.trained = timed.model.fit(*_[:2])

    monkeypatch.setattr(measure.Timed, "repeat", repeat)
    models = {name: configs.part("model", name) for name in ("ridge", "mean_image")}
    run = Run(console=Console(quiet=True), force=True)
    rows = recording_costs.rows(
        run, of, RANDOM, models, n_per_class=[5], repeats=3, most_s=12
    )
    ridge, mean = rows
    kinds = [turns[0], turns[1]]
    assert turns == [*kinds, *kinds, kinds[1]]  # 10 + 10/3 s are more than 12
    assert (ridge["fit_s"], mean["fit_s"]) == (10 / 3, 10 / 5)
    assert ridge["predict_frame_s"] == 1 / 3


def costs_of(model, n, seconds, **more):
    place = {"model": model, "n": n, "n_classes": 10, "n_pixels": 800}
    return {
        **place,
        "bytes": 1000,
        "fit_s": seconds,
        "predict_frame_s": seconds / 1e3,
        **more,
    }


def test_each_compared_form_has_its_error_and_its_times_or_says_that_it_has_none(
    results, write_measurement, tmp_path
):
    of = {"hdc": 60, "softmax_dual": 62, "ridge": 80, "knn_greys": 70}
    results(gelsight=of)
    bits = [{**row, "n": [5, 50]} for row in measured_of({"bits_chosen": 90})]
    write_measurement("recordings_chosen", bits, scene="gelsight")
    rows = [
        costs_of("hdc", 5, 1.0),
        costs_of("hdc", 50, 2.0, fit_compiled_s=0.5, predict_frame_compiled_s=1e-4),
        costs_of("ridge", 50, 4.0),
        costs_of("softmax_dual", 50, 1.0),
    ]
    write_measurement("recording_costs", rows, scene="gelsight")
    tables_of = {table.name: table for table in view.STUDY.tables_of(Results(tmp_path))}
    many = tables_of["costs_many"]
    shown = {row["model"]: row for row in many.data.to_dict("records")}
    assert list(shown) == [*costs.COMPARED, "ridge"]
    assert shown["ridge"]["role"] == "best usual baseline"
    assert shown["hdc"]["error"] == pytest.approx(0.4)
    assert shown["bits_chosen"]["error"] == pytest.approx(0.1)
    cells = dict(zip(shown, many.cells(), strict=True))
    gelsight = ["GelSight", "HDC", "40", "2.00; compiled 0.500"]
    times = [*gelsight, "2.00; compiled 0.100", "1.00 kB"]
    assert cells["hdc"] == [*times, "0.500", "0.100"]  # the faster over that of softmax
    assert cells["ridge"][-2:] == ["4.00", "4.00"]
    assert cells["greys_chosen"][2:] == [costs.NOT_MEASURED] * 6
    few = tables_of["costs_few"].data.set_index("model")
    assert (few.fit_s["hdc"], few.n["hdc"]) == (1.0, 5)
    assert len(tables_of["recording_costs"].data) == 4


def test_errors_are_those_of_the_draws_that_both_experiments_have(
    results, write_measurement, tmp_path
):
    results(gelsight={"softmax_dual": [100, 100, *18 * [90]]})  # the first two are easy
    chosen = measured_of({"bits_chosen": [95, 97]}, draws=2)
    write_measurement("recordings_chosen", chosen, scene="gelsight")
    frame = Results(tmp_path).frame("recordings", "recordings_chosen")
    errors = costs.Errors(frame, "gelsight")
    assert errors.of("softmax_dual", 50) == 0.0
    assert errors.of("bits_chosen", 50) == pytest.approx(0.04)
    alone = costs.Errors(frame[frame.experiment == "recordings"], "gelsight")
    assert alone.of("softmax_dual", 50) == pytest.approx(0.09)


def test_the_front_has_no_point_with_less_of_both():
    times, errors = [1, 2, 3, 3, 4], [9, 5, 5, 4, 4]
    assert costs.is_on_front(times, errors) == [True, True, False, True, False]
    assert costs.is_on_front([1, 1], [2, 2]) == [True, True]  # equal ones both stand


def test_values_of_one_n_are_those_of_the_rows(tmp_path, write_measurement):
    write_measurement("recordings", measured_of({"hdc": 60}), scene="gelsight")
    (measured,) = values.recordings(Results(tmp_path).frame("recordings")).values()
    every = values.Accuracies(measured)
    assert every.sizes == [5, 50]
    assert every.by_unit("hdc", 5).tolist() == [0.3] * 20
    assert np.isnan(every.by_unit("ridge", 50)).all()
    assert np.isnan(every.mean("ridge", 50).value)


def test_models_are_compared_in_the_draws_in_which_both_were_asked(
    tmp_path, write_measurement
):
    """Models that no claim needs are asked in the first ten of twenty draws."""
    rows = measured_of({"hdc": [40] * 10 + [100] * 10})
    rows += measured_of({"hdc_integer": 50, "thumbnail": 60, "ridge": 55}, draws=10)
    write_measurement("recordings", rows, scene="gelsight")
    frame = Results(tmp_path).frame("recordings")
    (step,) = decomposition.decomposition(frame).to_dict("records")
    found = (step["before_accuracy"], step["after_accuracy"], step["change"])
    assert found == pytest.approx((0.5, 0.4, -0.1))
    told = tables.front(frame).set_index("n").told
    assert told[50] == "coarse layout alone: more than HDC, and than any model here"


def test_a_recording_with_no_more_than_five_frames_is_in_both_panels(
    tmp_path, write_measurement
):
    rows = [
        {**row, "n": [1, 5]}
        for row in measured_of({"hdc": 60, "softmax_dual": 50, "hdc_levels_lda": 70})
    ]
    write_measurement("recordings", rows, scene="gelsight")
    found = forest.dots(Results(tmp_path).frame("recordings"))
    dots = {(dot.form, dot.few): round(dot.difference.value, 9) for dot in found}
    assert dots == {
        ("hdc", True): 0.1,
        ("hdc", False): 0.1,
        ("hdc_levels_lda", True): 0.2,
        ("hdc_levels_lda", False): 0.2,
    }
