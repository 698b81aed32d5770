"""What data a run needs and lacks is known before anything of it is built."""

import pytest

from experiments.protocol.needs import needs
from scenes.source import DATA
from tests.experiments import composed


def repository(scene):
    return composed.part("scene", scene)["scene"]["source"]["repository"]


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("touch", ""),
        ("gelsight", f"needs data of {repository('gelsight')} ({DATA})"),
        ("tactip", f"lacks data of {repository('tactip')} ({DATA})"),
    ],
)
def test_data_that_a_run_needs_and_lacks(monkeypatch, tmp_path, scene, said):
    (tmp_path / repository("gelsight").rpartition("/")[2]).mkdir()
    monkeypatch.setenv(DATA, str(tmp_path))
    assert needs(composed.composed(f"scene={scene}")) == said
