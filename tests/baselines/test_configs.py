"""The files of configs/model: each makes a model, and says how it is shown."""

import pytest
from hydra.utils import instantiate
from matplotlib.lines import Line2D

from baselines.base import Classifier
from experiments.records.configs import CONFIGS
from tests.experiments.composed import tree

NAMES = sorted(path.stem for path in (CONFIGS / "model").glob("*.yaml"))
# Okabe and Ito's colours, told apart by people with any kind of colour vision; then an indigo of
# Tol's and a light one of ColorBrewer's, which are safe as well: for softmax at its optimum. The
# last three, a lighter and a darker vermilion and a purple, are of forms of HDC.
COLOURS = {
    *("#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00"),
    *("#CC79A7", "#332288", "#8DA0CB", "#E8924F", "#7A3600", "#A5178A"),
}
GROUPS = {"paper", "fast", "beyond", "other"}


@pytest.mark.parametrize("name", NAMES)
def test_makes_a_model_and_says_how_it_is_shown(name):
    cfg = tree(f"model={name}", "seed.init=5")
    display = cfg.display
    assert set(display) == {"name", "colour", "marker", "line", "group"}
    assert display.colour in COLOURS
    assert display.group in GROUPS
    # Raises for unknown ones.
    Line2D([], [], marker=display.marker, linestyle=display.line)
    model = instantiate(cfg.model, _convert_="all")
    assert model.device == "cpu"
    assert getattr(model, "seed", 5) == 5
    assert isinstance(model, Classifier) == cfg.model._target_.startswith("baselines.")
