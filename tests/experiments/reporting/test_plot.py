"""How figures look: every model is told apart, heads fit, bytes stay, no error has its strip."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.text import Text

from experiments.records import configs
from experiments.reporting import curves, plot
from experiments.reporting.labels import name_points
from experiments.reporting.study import WIDTH

MODELS = sorted(path.stem for path in (configs.CONFIGS / "model").glob("*.yaml"))


@pytest.fixture
def figure():
    with plt.rc_context(fname=plot.STYLE):
        made, axes = plt.subplots(figsize=(WIDTH, 3))
        axes.plot([1, 2], [1, 2])
        yield made
    plt.close(made)


def test_no_two_models_look_alike_without_their_lines():
    looks = [
        (*plot.style_of(model)[:2], plot.look_of(model)["mfc"]) for model in MODELS
    ]
    assert len(set(looks)) == len(looks)
    assert len({configs.display(model)["name"] for model in MODELS}) == len(MODELS)


@pytest.mark.parametrize("kind", ["svg", "webp"])
def test_bytes_do_not_change(kind):
    def drawn():
        with plt.rc_context(fname=plot.STYLE):
            figure, axes = plt.subplots(figsize=(WIDTH, 2))
            axes.errorbar([1, 2], [1, 2], yerr=0.1, label="some")
            axes.legend()
            axes.fill_between([1, 2], [0, 1], [1, 2], clip_path=None)
        return plot.save(figure, kind)

    open_before = plt.get_fignums()
    first, second = drawn(), drawn()
    assert first == second
    assert len(first) > 1000
    assert b"dc:date" not in first
    assert plt.get_fignums() == open_before


def test_no_error_lies_below_one_error_of_all_samples(figure):
    lines = [
        {"seeds": 5, "n_test": 500, "test_accuracy_final": value,
         "test_accuracy_final_low": value - 0.01, "test_accuracy_final_high": min(value + 0.01, 1)}
        for value in (1.0, 499 / 500)
    ]  # fmt: skip
    axes = figure.axes[0]
    floor = curves.error_axis(axes, lines)
    assert axes.get_ylim()[0] < floor == 0.5 / 500 < 1 / 500
    assert axes.yaxis.get_major_formatter()(floor) == "0"
    assert axes.yaxis.get_major_formatter()(1 / 500) == "0.2 %"
    curves.error_bars(axes, "hdc", [1.0, 2.0], lines, floor)
    drawn = np.concatenate([np.asarray(x.get_ydata(), float) for x in axes.lines[1:]])
    assert np.min(drawn) == pytest.approx(floor)
    assert 1 / 500 in np.round(drawn, 12)  # a single error is drawn where it is


def test_text_of_a_figure_keeps_its_digits():
    figure, axes = plt.subplots()
    axes.text(0.123456, 0.5, "C = 0.0551")
    drawn = plot.save(figure, "svg").decode()
    assert "C = 0.0551" in drawn
    assert "0.123456" not in drawn


def test_names_of_near_points_cover_neither_each_other_nor_a_point():
    figure = plt.figure(figsize=(3, 2), dpi=100)
    axes = figure.subplots()
    points = np.array([[1.0, 5.0], [1.1, 4.9], [1.2, 4.8], [1.3, 4.7], [9, 0], [9, 9]])
    axes.plot(*points.T, "o", ms=4)
    figure.draw_without_rendering()
    names = {k: f"a model of a long name {k}" for k in range(5)}
    name_points(axes, points, names)
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    boxes = [Text.get_window_extent(text, renderer) for text in axes.texts]
    assert [text.get_text() for text in axes.texts] == list(names.values())
    for k, box in enumerate(boxes):
        assert not box.count_overlaps(boxes[:k])
        assert not any(box.contains(*at) for at in axes.transData.transform(points))
        assert axes.bbox.containsx(box.x0)
        assert axes.bbox.containsx(box.x1)
    plt.close(figure)
