"""A question of one's own: how strong is the speckle contrast of each class of a scene?"""

from experiments.protocol.task import Task
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.facets import intervals
from experiments.reporting.plot import look_of
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table


class Contrast(Task, frozen=True):
    """One row: the contrast, σ/mean, of one frame of a class."""

    scene: dict
    seeds: list[int]

    def rows(self, context):
        for seed, sensor in context.scenes(self.scene, self.seeds):
            for sample, label in enumerate(sensor.labels[:40]):
                frame = sensor.frames([sample]).float()
                value = float(frame.std() / frame.mean())
                about = {"origin": sensor.origin, "seed": seed}
                yield {**about, "class": sensor.classes[label], "contrast": value}


def by_class(frame):
    """The mean contrast of each class with two standard errors."""
    groups = frame.groupby(["scene", "origin", "class"]).contrast
    table = groups.agg(contrast="mean", error="sem").reset_index()
    table["contrast_low"] = table.contrast - 2 * table.error
    table["contrast_high"] = table.contrast + 2 * table.error
    return table


def draw(figure, data):
    """A point per class with its interval."""
    axes = figure.subplots()
    names, scenes = list(data["class"].unique()), list(data.scene.unique())
    place = {"names": names, "hues": scenes, "look": lambda _: look_of("hdc")}
    intervals(axes, data, "contrast", "class", "scene", **place)
    axes.set_yticks(range(len(names)), names)
    axes.set_xlabel("speckle contrast")


CONTRAST = Table(
    "contrast",
    by_class,
    of="contrast",
    key=("scene", "class"),
    title="Speckle contrast of each class, {frames}",
    columns={"scene": Column("Scene", scene_name), "contrast": Column("Contrast")},
)
FIGURE = Figure(
    "contrast", CONTRAST, draw, title="Speckle contrast", caption="Contrast by class."
)
ANSWERS = {"tables": [CONTRAST], "figures": [FIGURE]}
STUDY = Study("contrast", "Speckle contrast", "How strong is it?", 20, **ANSWERS)
