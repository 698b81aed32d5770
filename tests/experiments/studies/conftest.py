"""Runs of every scene and drawn figures, for the views of the studies."""

import html
import re

import numpy as np
import pytest
from matplotlib import pyplot as plt

from experiments.records.results import Results

CLASSES = {
    "finger": ["L1", "L2", "L3", "R1", "R2", "R3", "None"],
    "spatial": [str(i) for i in range(51)],
    "tactile": ["paper", "P40", "P120"],
    "touch": ["L1", "L2", "R1", "R2", "None"],
    "fibre_grouped": list("abcde"),
}


@pytest.fixture
def write_scene(tmp_path, write_run):
    """write_scene(scene, wrong, …): a run of HDC, two test samples per class; {class: taken for}
    says which class has one of its two samples wrong. Other arguments are those of write_run."""

    def write(scene, wrong, model="hdc", **more):
        classes = CLASSES[scene]
        origin = "measured" if scene.startswith("fibre") else "simulated"
        truth = np.repeat(np.arange(len(classes)), 2)
        predicted = truth.copy()
        for label, taken_for in wrong.items():
            predicted[2 * label] = taken_for
        more = {"n_train": None} | more
        return write_run(
            model, scene=scene, classes=classes, origin=origin, truth=truth, predicted=predicted,
            **more,
        )  # fmt: skip

    return write


def words_of(svg):
    """The words of an SVG: what stands between its tags."""
    text = re.sub(
        r"\s*</?tspan[^>]*>\s*", "", svg.decode()
    )  # the letters of a text with a formula
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", text)).split())


@pytest.fixture
def drawn(tmp_path):
    """drawn(study) → the words of each of its figures by name; all of it lies within the figure."""
    from experiments.reporting.plot import save

    def draw(study):
        found = {}
        for plot in study.plots_of(Results(tmp_path)):
            figure = plot.draw()
            figure.draw_without_rendering()
            box = figure.get_tightbbox(figure.canvas.get_renderer())  # in inches
            assert box.x0 >= 0, plot.name
            assert box.x1 <= figure.get_figwidth(), plot.name
            assert box.y0 >= 0, plot.name
            assert box.y1 <= figure.get_figheight(), plot.name
            found[plot.name] = words_of(save(figure, "svg"))
        return found

    yield draw
    plt.close("all")


@pytest.fixture
def number(tmp_path):
    """number(study, name, condition) → that Quantity, of the records in tmp_path."""

    def find(study, name, condition=""):
        found = study.quantities_of(Results(tmp_path))
        (one,) = (q for q in found if (q.name, q.condition) == (name, condition))
        return one

    return find
