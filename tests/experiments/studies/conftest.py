"""Runs of every scene, tables, figures and numbers of a study, for the views of the studies."""

import html
import re

import numpy as np
import pytest

CLASSES = {
    "finger": ["L1", "L2", "L3", "R1", "R2", "R3", "None"],
    "spatial": [str(i) for i in range(51)],
    "tactile": ["paper", "P40", "P120"],
    "touch": ["L1", "L2", "R1", "R2", "None"],
    "fibre_grouped": list("abcde"),
}


@pytest.fixture
def write_scene(write_run):
    """write_scene(scene, wrong, …): a run of HDC, two test samples per class; {class: taken for}
    says which class has one of its two samples wrong. Other arguments are those of write_run."""

    def write(scene, wrong, model="hdc", **more):
        classes = CLASSES[scene]
        truth = np.repeat(np.arange(len(classes)), 2)
        predicted = truth.copy()
        for label, taken_for in wrong.items():
            predicted[2 * label] = taken_for
        more["origin"] = "measured" if scene.startswith("fibre") else "simulated"
        more |= {"classes": classes, "truth": truth, "predicted": predicted}
        return write_run(model, scene=scene, **more)

    return write


def words_of(svg):
    """The words of an SVG: what stands between its tags."""
    # the letters of a text with a formula
    text = re.sub(r"\s*</?tspan[^>]*>\s*", "", svg.decode())
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", text)).split())


@pytest.fixture
def figures(answers):
    """figures(study) → its figures by name, drawn, of the records in tmp_path."""

    def draw(study):
        made = answers(study).figures(study)
        return {figure.name: figure.draw(figure.table.data) for figure in made}

    return draw


@pytest.fixture
def drawn(figures):
    """drawn(study) → the words of each of its figures by name; all of it lies within the figure."""
    from experiments.reporting.plot import save

    def draw(study):
        found = {}
        for name, figure in figures(study).items():
            figure.draw_without_rendering()
            box = figure.get_tightbbox()  # in inches
            assert min(box.x0, box.y0) >= 0, name
            assert box.x1 <= figure.get_figwidth(), name
            assert box.y1 <= figure.get_figheight(), name
            found[name] = words_of(save(figure, "svg"))
        return found

    return draw


@pytest.fixture
def number(answers):
    """number(study, name, condition) → that Quantity, of the records in tmp_path."""

    def find(study, name, condition=""):
        results = answers(study).results
        every = (
            quantity
            for numbers in study.numbers
            for quantity in numbers.made(results.frame(*numbers.of))
        )
        (one,) = (q for q in every if (q.name, q.condition) == (name, condition))
        return one

    return find
