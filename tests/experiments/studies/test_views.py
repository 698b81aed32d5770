"""Figures draw their tables and say what they are of; no study lists models beyond its question."""

import ast
import io

import numpy as np
import pandas as pd
from matplotlib.text import Text

from experiments.records import configs
from experiments.records.files import ROOT
from experiments.reporting.columns import scene_name
from experiments.reporting.table import MOST_COLUMNS

STUDIES = ROOT / "experiments" / "studies"
# Figures without a split in their head, and why.
NO_SPLIT = {
    "stability": "its inputs are made up",
}
SPLITS = ("split", "frames are of another")  # what a head says of it


def words(figure):
    """All texts of a figure, those of its ticks too."""
    figure.draw_without_rendering()
    return " ".join(" ".join(t.get_text().split()) for t in figure.findobj(Text))


def drawn(figure):
    """What a figure draws: coordinates of lines, areas and matrices."""
    for axes in figure.axes:
        yield from (line.get_xydata() for line in axes.lines)
        yield from (image.get_array() for image in axes.images)
        yield from (patch.get_path().vertices for patch in axes.patches)
        for collection in axes.collections:
            yield collection.get_offsets()
            yield from (path.vertices for path in collection.get_paths())


def read_back(table):
    """The values of a table from its CSV; texts are texts, and a class may be named None."""
    kinds = {}
    for name, values in table.data.items():
        if values.dropna().map(type).eq(str).all():
            kinds[name] = str
    options = {"keep_default_na": False, "na_values": [""], "dtype": kinds}
    return pd.read_csv(io.StringIO(table.csv()), **options)


def missing(name, figure, data):
    """What a figure does not say of scenes and split."""
    places = data.get("scene", data.get("recording", pd.Series(dtype=str))).unique()
    names = [scene_name(scene).partition(",")[0] for scene in places]
    said = words(figure)
    yield from (f"{name}: no {scene}" for scene in names if scene not in said)
    if name not in NO_SPLIT and not any(map(figure.get_suptitle().count, SPLITS)):
        yield f"{name}: no split"
    for axes in figure.axes:  # it is read by the numbers of the panel below
        says_none = not axes.xaxis.get_tick_params()["labelbottom"]
        if says_none and len(axes.get_shared_x_axes().get_siblings(axes)) == 1:
            yield f"{name}: a panel whose axis has no numbers"


def test_a_figure_draws_its_csv_alone_and_has_scene_and_split_in_its_title(committed):
    seen, problems = set(), []
    for study in committed.studies:
        for figure in committed.figures(study):
            seen.add(figure.name)
            data = read_back(figure.table)
            first, second = figure.draw(figure.table.data), figure.draw(data)
            for one, other in zip(drawn(first), drawn(second), strict=True):
                found = [np.asarray(part, float) for part in (one, other)]
                np.testing.assert_allclose(*found, 2e-5, 1e-6, err_msg=figure.name)
            problems += missing(figure.name, first, data)
        for table in committed.tables(study):
            assert len(table.heads) <= MOST_COLUMNS
    assert not problems, "\n".join(problems)
    assert set(NO_SPLIT) < seen


def test_no_two_models_have_one_name():
    models = [path.stem for path in (configs.CONFIGS / "model").glob("*.yaml")]
    assert len({configs.display(model)["name"] for model in models}) == len(models)


# Lists of models and recordings -------------------------------------------------------------------

OWN_QUESTION = {
    "promises/values/view.py: SHOWN": "read-outs whose probabilities a figure compares",
    "recordings/tables.py: STEPS": "from grey values to HDC by one change after the other",
}


def listed(tree, names):
    """Constants of a module that list a name; two of them make a list of a call's arguments."""
    for statement in tree.body:
        for node in ast.walk(statement):
            parts = getattr(node, "elts", None) or getattr(node, "keys", None) or ()
            least = 1
            if isinstance(node, ast.Call):
                parts, least = node.args, 2
            found = [
                p for p in parts if isinstance(p, ast.Constant) and p.value in names
            ]
            if len(found) >= least:
                target = getattr(statement, "targets", [statement])[0]
                yield getattr(target, "target", target)


def test_models_and_recordings_are_listed_by_what_defines_a_question_alone():
    groups = ("model", "scene", "experiment")
    files = {
        group: {path.stem for path in (configs.CONFIGS / group).glob("*.yaml")}
        for group in groups
    }
    names = (files["model"] | files["scene"]) - files["experiment"]
    found = set()
    for path in STUDIES.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for target in listed(tree, names):
            name = getattr(target, "id", getattr(target, "name", "?"))
            found.add(f"{path.relative_to(STUDIES)}: {name}")
    assert found == set(OWN_QUESTION)
