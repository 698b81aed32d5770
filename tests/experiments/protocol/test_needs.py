"""What a run needs and lacks is known before anything of it is imported."""

import importlib.util
import sys

import pytest

from experiments.protocol.needs import needs
from scenes.source import DATA
from tests.experiments import composed

GELSIGHT = f"data of {composed.part('scene', 'gelsight')['scene']['source']['repository']} ({DATA})"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["scene=touch"], "needs scipy"),
        (["scene=touch", "model=thumbnail"], "needs scipy, sklearn; lacks cv2"),
        (["scene=gelsight"], f"lacks {GELSIGHT}"),
        (["scene=recorded", "scene.path=a.npz"], ""),
        (["experiment=drift"], "needs scipy"),
    ],
    ids=str,
)
def test_packages_and_data_that_a_run_needs_and_lacks(monkeypatch, words, said):
    monkeypatch.delenv(DATA, raising=False)
    for name in ("scipy", "sklearn"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.delitem(sys.modules, "cv2", raising=False)
    real = importlib.util.find_spec

    def without_opencv(name, *package):
        return None if name == "cv2" else real(name, *package)

    monkeypatch.setattr(importlib.util, "find_spec", without_opencv)
    assert needs(composed.composed(*words)) == said
