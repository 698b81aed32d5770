"""Conditions change what they name and nothing else; readings and verdicts follow from records."""

from __future__ import annotations

import copy
import inspect

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt
from rich.console import Console

from experiments.protocol.scenes import scene_at
from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.reporting import plot, published
from experiments.reporting.estimates import mean_difference
from experiments.reporting.table import bounded, points
from experiments.studies.conditions import networks, optics, view_optics
from experiments.studies.conditions.networks import NAME as NETWORKS
from experiments.studies.conditions.optics import NAME as OPTICS
from experiments.studies.robustness.disturbances import OF_FRAMES, glare, jitter, offset

SPLIT = {"kind": "random", "group": None, "test_fraction": 0.25, "n_train": None}


def random(seed=0):
    return np.random.default_rng(seed)


# Disturbances -------------------------------------------------------------------------------------


def test_stray_light_adds_one_number_to_a_frame_and_saturates():
    frames = np.full((500, 2, 3), 40, np.uint8)
    added = offset(frames, 0.4, random()).astype(int) - 40
    assert (added == added[:, :1, :1]).all()
    assert added.min() >= 0
    assert added.max() == pytest.approx(102, abs=2)
    assert added.mean() == pytest.approx(51, abs=4 * 102 / np.sqrt(12 * 500))
    assert offset(np.full((50, 1, 1), 250, np.uint8), 0.9, random()).max() == 255


def test_glare_is_one_spot_of_its_height_and_width_elsewhere_in_every_frame():
    spots = glare(np.zeros((40, 60, 60), np.uint8), 0.5, random(), radius=0.1).astype(float)
    heights = spots.max(axis=(1, 2))
    assert ((heights > 120) & (heights <= 128)).all()
    places = {np.unravel_index(spot.argmax(), spot.shape) for spot in spots}
    assert len(places) > 35
    (central,) = [s for s in spots if s[25:35, 25:35].max() == s.max()][:1]
    assert central.sum() == pytest.approx(2 * np.pi * 6**2 * 0.5 * 255, rel=0.03)


def test_jitter_moves_every_frame_by_its_own_whole_pixels():
    one = np.zeros((200, 21, 31), np.uint8)
    one[:, 10, 15] = 9
    moved = jitter(one, 2, random())
    assert (moved.sum(axis=(1, 2)) == 9).all()
    places = np.argwhere(moved)[:, 1:] - [10, 15]
    assert np.abs(places).max() == 2
    assert len({tuple(place) for place in places}) == 25
    with pytest.raises(ValueError, match=r"jitter: expected whole pixels in \[0, 21\), found 0.5"):
        jitter(one, 0.5, random())


def test_a_share_of_the_training_labels_is_another_one():
    labels = np.repeat([3, 5, 8], 100)
    wrong = optics.mislabelled(labels, 0.1, random())
    assert (wrong != labels).sum() == 30
    assert set(wrong) == {3, 5, 8}
    assert (optics.mislabelled(labels, 0, random()) == labels).all()
    with pytest.raises(ValueError, match=r"task\.labels: expected shares in \[0, 1\], found 2"):
        optics.mislabelled(labels, 2, random())


def test_both_parts_are_disturbed_each_frame_anew_and_test_labels_never():
    part = (torch.full((20, 8, 8), 50, dtype=torch.uint8), np.arange(20) % 4)
    train, test = optics.disturbed(part, part, "power", 0.5, 0, 0.1)
    assert not torch.equal(train[0], test[0])
    assert len(train[0][:, 0, 0].unique()) > 10
    train, test = optics.disturbed(part, part, "labels", 0.5, 0, 0.1)
    assert ((train[1] != part[1]).sum(), (test[1] != part[1]).sum()) == (10, 0)
    assert torch.equal(train[0], part[0])
    assert optics.disturbed(part, part, "photons", 3, 0, 0.1) == (part, part)


# Scenes -------------------------------------------------------------------------------------------


@pytest.fixture
def scene(small_scene):
    room = {"_target_": "scenes.sensor.environment.Room"}
    contact = small_scene["contact"] | {"depth_spread": 0.01, "position_spread": 2e-5}
    return small_scene | {"contact": contact, "sessions": [room]}


def frames_of(condition, level, scene):
    before = copy.deepcopy(scene)
    changed, split = optics.OF_SCENES[condition](scene, SPLIT, level)
    assert scene == before
    return scene_at(changed, 0, False, Console(quiet=True)), split


def test_exposure_and_photons_change_the_camera(scene):
    bright, _ = frames_of("exposure", 400, scene)
    plain, _ = frames_of("exposure", 50, scene)
    assert (bright.frames([0]) == 255).float().mean() > 0.3
    assert (plain.frames([0]) == 255).float().mean() < 0.05
    few, _ = frames_of("photons", 3, scene)
    assert len(few.frames([0]).unique()) > 1
    # Three electrons a pixel at the mean: an eighth and more of the pixels get none.
    assert (few.frames([0]) <= 2).float().mean() > (plain.frames([0]) <= 2).float().mean() + 0.1


def test_repeatability_multiplies_the_scatter_of_the_same_touches(scene):
    one, _ = frames_of("repeatability", 1, scene)
    five, _ = frames_of("repeatability", 5, scene)
    touched = one.labels == 0
    for key, target in (("depth", 1.8e-3), ("x", 28e-3)):
        scatter = five.samples[key][touched] - target
        assert scatter == pytest.approx(5 * (one.samples[key][touched] - target))
        assert scatter.any()


def test_a_session_is_the_same_and_another_that_much_warmer(scene):
    made, split = frames_of("session", 0.2, scene)
    assert split == SPLIT | {"kind": "session"}
    assert [room.offset for room in made.sessions] == [0, 0.2]
    with pytest.raises(ValueError, match=r"session: expected a scene of one session, found 2"):
        optics.OF_SCENES["session"](scene | {"sessions": [{}, {}]}, SPLIT, 0.2)


# Measurements -------------------------------------------------------------------------------------


@pytest.fixture
def optics_task(results, scene):
    task = configs.task(OPTICS)
    assert task.pop("_target_") == "experiments.studies.conditions.optics.run"
    models = {name: task["models"][name] for name in ("hdc", "ridge")}
    return task | {
        "scene": scene,
        "split": SPLIT,
        "models": models,
        "linear": ["ridge"],
        "softmax": [],
        "seeds": [0, 1],
        "frames": {"jitter": [1]},
        "sensor": {"session": [0.5]},
        "labels": [0.5],
    }


def test_every_model_is_tested_under_every_condition_and_a_break_costs_one(
    optics_task, results, monkeypatch
):
    made, real = [], optics.rows_of

    def broken(condition, level, seed, **rest):
        made.append((condition, seed))
        if len(made) == 6:
            raise ArithmeticError("broke")
        return real(condition, level, seed, **rest)

    monkeypatch.setattr(optics, "rows_of", broken)
    with pytest.raises(ArithmeticError):
        optics.run(**optics_task)
    found = measurement.read(optics.run(**optics_task))
    cases = ["none", "jitter", "session", "labels"]
    assert made == [(c, s) for s in (0, 1) for c in cases][:6] + [
        (c, 1) for c in ("jitter", "session", "labels")
    ]
    assert [(r["condition"], r["seed"], r["model"]) for r in found.rows] == [
        (c, s, m) for s in "01" for c in cases for m in ("hdc", "ridge")
    ]
    assert {r["n_test"] for r in found.rows if r["condition"] == "session"} == {"16"}
    by = {(r["condition"], r["model"]): float(r["train_accuracy"]) for r in found.rows}
    assert by["labels", "ridge"] == by["none", "ridge"] == 1  # it learns the wrong labels, too
    sources = found.record.environment.sources
    assert {"experiments/studies/robustness/disturbances.py", "hdc/bits.py"} < set(sources)


@pytest.mark.parametrize(
    ("key", "value", "found"),
    [
        ("frames", {"rain": [1]}, "rain"),
        ("sensor", {"fog": [1]}, "fog"),
        ("linear", ["cnn"], "cnn"),
    ],
)
def test_a_condition_or_model_that_there_is_not_is_named(optics_task, key, value, found):
    with pytest.raises(ValueError, match=rf"task\.{key}: expected names among .* found {found}"):
        optics.run(**optics_task | {key: value})


@pytest.fixture
def networks_task(results, scene):
    task = configs.task(NETWORKS)
    assert task.pop("_target_") == "experiments.studies.conditions.networks.run"
    case = {"model": "cnn1_fast", "init_std": 0.1, "pixels": "unit"}
    task["models"]["cnn1_fast"]["model"] |= {"lr": 3e-3, "filters": [4], "batch_size": 2}
    return task | {
        "scene": scene,
        "split": SPLIT,
        "cases": [case | {"init": "linear"}, case | {"init": "normal"}],
        "seeds": [0],
        "steps": 24,  # four epochs of six
        "reports_per_epoch": 3,
    }


@pytest.mark.parametrize(
    ("target", "steps"),
    [(0.0, [2, 4, 6, 12, 18, 24]), (1.1, list(range(2, 25, 2)))],  # reached at once, and never
)
def test_networks_are_evaluated_often_and_then_seldom_to_their_last_step(
    networks_task, target, steps
):
    rows = measurement.read(networks.run(**networks_task | {"target": target})).rows
    for init in ("linear", "normal"):
        own = [row for row in rows if row["init"] == init]
        assert [int(row["step"]) for row in own] == steps
        seconds = [float(row["training_s"]) for row in own]
        assert seconds == sorted(seconds)
        assert {row["n_test"] for row in own} == {"4"}
    first = [row["loss"] for row in rows if row["step"] == "2"]
    assert first[0] != first[1]  # from other weights


def test_evaluations_that_do_not_fit_each_other_are_named(networks_task):
    with pytest.raises(
        ValueError, match=r"task\.later_per_epoch: expected a divisor of 3, found 2"
    ):
        networks.run(**networks_task | {"later_per_epoch": 2})


def test_a_loss_that_is_not_finite_ends_a_training(networks_task):
    networks_task["models"]["cnn1_fast"]["model"]["lr"] = 1e30
    networks_task["cases"] = networks_task["cases"][:1]
    *_, last = measurement.read(networks.run(**networks_task)).rows
    assert last["loss"] in ("nan", "inf")
    assert "train_accuracy" not in last


@pytest.mark.parametrize(("name", "module"), [(OPTICS, optics), (NETWORKS, networks)])
def test_the_configs_name_what_there_is(name, module):
    task = configs.task(name)
    assert inspect.signature(module.run).parameters.keys() == task.keys() - {"_target_"}
    if module is optics:
        assert task["frames"].keys() <= OF_FRAMES.keys()
        assert task["models"]["softmax"]["model"]["init"] == "zeros"
        assert {*task["frames"], *task["sensor"], "labels"} <= view_optics.CONDITIONS.keys()


# Tables and figures -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("hdc", "softmax", "expected"),
    [
        (1.0, 0.9, "yes"),
        (0.99, 0.83, "yes"),
        (1.0, 0.99, "no"),
        (1.0, 0.5, "no"),
        (0.95, 0.9, "HDC falls too"),
        (0.5, 0.5, "HDC falls too"),
        (0.93, 1.0, "no"),
    ],
)
def test_the_verdict_needs_both_accuracies(hdc, softmax, expected):
    assert view_optics.verdict(hdc, {"softmax": softmax, "softmax_dual": 1.0}).startswith(expected)


def written(config, write_measurement, rows, name):
    task = configs.task(name)
    config = {key: task[key] for key in config}
    write_measurement(name, list(rows), config=config)


def optics_rows():
    lost = {"hdc": (0, 1), "softmax_dual": (10, 9), "softmax": (2, 2), "ridge": (1, 3)}
    for condition, level in (("none", 0.0), ("jitter", 1), ("jitter", 4)):
        for seed in (0, 1):
            for model in ("hdc", "softmax_dual", "softmax", "ridge", "correlation"):
                wrong = lost.get(model, (0, 0))[seed] * (level > 0)
                yield {
                    "origin": "simulated", "condition": condition, "level": level, "seed": seed,
                    "model": model, "n_test": 100, "right": 100 - wrong,
                }  # fmt: skip


def network_rows():
    for model, pixels in (("cnn1_fast", "unit"), ("cnn1_fast", "raw"), ("cnn3_fast", "unit")):
        for init, std in (("linear", 0.01), ("normal", 0.1)):
            for seed in (0, 1, 2):
                trained = [0.5, 0.92, 0.95, 0.97, 1.0] if init == "linear" else [0.2, 0.3, 0.5]
                for k, train in enumerate(trained):
                    yield {
                        "origin": "simulated", "model": model, "init": init, "init_std": std,
                        "pixels": pixels, "seed": seed, "step": 4 * (k + 1), "loss": 1 / (k + 1),
                        "train_accuracy": train, "test_accuracy": train - 0.01 * (1 + seed),
                    }  # fmt: skip


@pytest.fixture
def shown(tmp_path, write_measurement):
    written(("scene", "split", "models", "linear", "softmax"), write_measurement, optics_rows(),
            OPTICS)  # fmt: skip
    written(("scene", "split", "steps"), write_measurement, network_rows(), NETWORKS)
    return Results(tmp_path)


def test_the_table_of_optics_compares_sensor_by_sensor(shown):
    table, _ = view_optics.tables(shown)
    none, _, four = (dict(zip(table.heads, cells, strict=True)) for cells in table.cells())
    alike = mean_difference([0, 0], 100).columns("x")
    assert none["HDC − best linear, points"] == bounded("x", alike, show=points) != "0 [0, 0]"
    assert (four["Condition"], four["Level"]) == ("frames moved by ±", "4 px")
    # ridge and softmax have two wrong on average, of which the first is taken: 2−0 and 2−1
    assert four["Best linear"] == "Softmax, Adam from zeros"
    assert four["HDC − best linear, points"].startswith("+1.5 [")
    assert four["HDC ahead, behind; sensors"] == "2, 0; 2"
    assert four["HDC"].startswith("99.5 [")
    assert four["Softmax as published, HDC not less"] == "yes: Softmax, dual Newton"
    assert none["Softmax as published, HDC not less"] == "no"


def test_readings_of_one_curve():
    curve = [row for row in network_rows() if (row["init"], row["seed"]) == ("linear", 1)][:5]
    found = view_optics.read_of(curve, "cnn1_fast")
    for rule, expected in (
        ("r1", (8, 0.92, 0.90)),
        ("r2", (16, 0.97, 0.95)),
        ("r3", (16, 0.97, 0.95)),
        ("r4", (20, 1.0, 0.98)),
    ):
        read = [found[f"{rule}_{part}"] for part in ("steps", "train", "test")]
        assert read == pytest.approx(expected)
    slow = [{**row, "train_accuracy": 0.5} for row in curve]
    found = view_optics.read_of(slow, "cnn1_fast")
    assert [found[f"{rule}_steps"] for rule in ("r1", "r2", "r3", "r4")] == [None, None, None, 20]
    assert view_optics.read_of([{"step": 4, "loss": "nan"}], "cnn1_fast") == {}


def test_the_table_of_networks_judges_each_reading(shown):
    _, table = view_optics.tables(shown)
    rows = [dict(zip(table.heads, cells, strict=True)) for cells in table.cells()]
    assert len(rows) == 6 * 4
    by = {
        (row["Network"], row["Initial weights"], row["Pixels"], row["Reading"]): row for row in rows
    }
    own = ("CNN, 1 layer, bfloat16", "PyTorch's own", "unit")
    twice = by[*own, "maxima over 2 times the steps to 90 %"]
    assert twice["Explains"] == "accuracies"
    assert twice["As published, sensors"] == "3 of 3"
    assert twice["Test accuracy, %"] == "95 (94…96)"
    assert twice["Steps"] == "16.0"
    assert by[*own, "maxima of the whole training"]["Explains"] == "no"  # 100 % in training
    never = by[own[0], "normal, 0.1", "raw", "first above 90 % in training"]
    assert (never["Reached, sensors"], never["Test accuracy, %"]) == ("0 of 3", "–")
    known = published.numbers()["table1/cnn3_test_accuracy"]
    assert f"{known.value:g} [{known.low:.1f}, {known.high:.1f}]" in {
        row["Test accuracy, %, paper [95 %]"] for row in rows if "3 layers" in row["Network"]
    }


def test_figures_name_conditions_and_starts_and_fit_in_a_column(shown):
    found = {one.name: one.draw() for one in view_optics.plots(shown)}
    assert list(found) == [OPTICS, NETWORKS]
    for name, figure in found.items():
        figure.draw_without_rendering()
        box = figure.get_tightbbox(figure.canvas.get_renderer())
        assert figure.get_figwidth() == pytest.approx(plot.WIDTH), name
        assert box.x0 >= 0, name
        assert box.x1 <= figure.get_figwidth(), name
    labels = [text.get_text() for text in found[OPTICS].legends[0].get_texts()]
    assert labels[0] == "HDC"
    assert labels[-1] == "softmax, published [95 %]"
    assert found[OPTICS].axes[0].get_xlabel() == "frames moved by ±\n(px)"
    assert [len(axes.lines) for axes in found[NETWORKS].axes] == [12, 12, 12]
    plt.close("all")
