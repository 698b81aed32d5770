"""Figures say what they show, where the frames come from and what is missing."""

import html
import re

import numpy as np
import pytest

from experiments import figures, tables
from experiments.selection import Records


def text_of(svg):
    """The words of an SVG: matplotlib keeps those it draws as paths in comments."""
    words = "\n".join(re.findall(r"<!--(.*?)-->", svg.decode(), re.DOTALL))
    return html.unescape(words).replace("\xa0", " ")


@pytest.fixture
def make(tmp_path):
    """make(name) → figure from the records in tmp_path."""

    def draw(name):
        records = Records(tmp_path)
        if name == "error_vs_time":
            return figures.error_vs_time(records)
        if name == "work_precision":
            table = tables.table1(records) + tables.table1(records, "table1_extended")
            return figures.work_precision(tables.curve(records, [name]), table)
        return getattr(figures, name)(tables.curve(records, [name]))

    yield draw
    figures.plt.close("all")


EXPECTED = {
    "error_vs_time": ["training time (s)", "test error", "paper, Table I", "HDC", "Softmax",
                      "CNN, 1 layer", "CNN, 3 layers", "grey: no error"],
    "accuracy_vs_n": ["training samples N", "test accuracy (%)", "paper, Table I", "HDC",
                      "Ridge read-out", "only for N", "400"],
    "accuracy_vs_d": ["pixels seen, D", "250,000", "test accuracy (%)", "Image correlation"],
    "work_precision": ["time to predict a single frame (ms)", "test error", "HDC", "Softmax"],
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_words_and_width(name, make, a_full_set):
    figure = make(name)
    assert figure.get_figwidth() == pytest.approx(3.4)
    words = text_of(figures.save(figure, "svg"))
    for expected in [*EXPECTED[name], "simulated frames", "95 % intervals", "no records:"]:
        assert expected in words, expected


@pytest.fixture(params=["none", "one", "many"])
def records_there(request, write_run):
    if request.param == "one":
        write_run("hdc")
    elif request.param == "many":
        request.getfixturevalue("a_full_set")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", EXPECTED)
def test_everything_lies_within_the_figure(name, make, records_there):
    figure = make(name)
    figures.save(figure, "png")
    box = figure.get_tightbbox(figure.canvas.get_renderer())  # in inches
    assert box.x0 >= 0
    assert box.x1 <= figure.get_figwidth()
    assert box.y0 >= 0
    assert box.y1 <= figure.get_figheight()
    for axes in figure.axes:  # and the words leave room for the curves
        assert axes.get_position().height * figure.get_figheight() > 1.2
        labels = [label.get_text() for label in axes.get_xticklabels()]
        assert len(set(filter(None, labels))) >= 2 or axes is not figure.axes[-1]


def test_no_words_lie_on_the_axis(make, write_run):
    write_run("hdc")
    figure = make("accuracy_vs_n")
    figure.draw_without_rendering()
    axes = figure.axes[0]
    (words,) = axes.texts
    assert words.get_window_extent().x0 > axes.get_window_extent().x0


@pytest.mark.parametrize("name", EXPECTED)
def test_without_records_a_figure_says_so(name, make):
    words = text_of(figures.save(make(name), "svg"))
    assert "no records:" in words
    assert "simulated" not in words
    assert "95 %" not in words


@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_bytes_do_not_change(kind, make, a_full_set):
    first, second = (figures.save(make("error_vs_time"), kind) for _ in range(2))
    assert first == second
    assert len(first) > 5000
    assert b"CreationDate" not in first
    assert b"dc:date" not in first


def test_no_error_lies_below_one_error_of_all_samples(make, write_run):
    for seed in range(5):
        write_run("hdc", seed=seed, wrong=[0] if seed == 0 else [])  # 1 of 500
    axes = make("error_vs_time").axes[0]
    points = np.concatenate([np.asarray(x.get_ydata(), float) for x in axes.lines])
    assert axes.get_ylim()[0] < 0.5 / 500 < 1 / 500
    assert np.min(points) == pytest.approx(0.5 / 500)
    assert 1 / 500 in np.round(points, 12)  # the pooled error is drawn where it is


def test_published_points_are_drawn_where_they_are(make, a_full_set):
    stars = {
        (float(x.get_xdata()[0]), round(float(x.get_ydata()[0]), 6))
        for x in make("error_vs_time").axes[0].lines
        if x.get_marker() == "*"
    }
    assert {(170.0, 0.1), (101.3, 0.07), (441.3, 0.07)} < stars
    assert min(y for x, y in stars if x == 1.24) < 0.01


def test_no_two_models_look_alike_without_their_lines():
    looks = [(*figures.style_of(model)[:2], figures.fill_of(model)) for model in figures._STYLES]
    assert len(set(looks)) == len(looks)
