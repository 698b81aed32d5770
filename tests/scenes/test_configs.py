"""The files of configs/scene: each composes by itself and says how it is split and shown."""

import pytest

from experiments.records.configs import CONFIGS
from scenes.split import KINDS
from tests.experiments.composed import tree

NAMES = sorted(path.stem for path in (CONFIGS / "scene").glob("*.yaml"))


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_says_how_it_is_split_and_shown(name):
    config = tree(f"scene={name}")
    shown = config.scene_display
    assert {"name", "frames", "kind", "order"} <= {*shown}
    assert (shown.kind == "computed") == name.startswith("fibre")
    assert shown.get("fitted", False) == (name in ("drift", "finger", "spatial"))
    by_group = ("grouped", "leave_group_out")
    assert config.split.kind in (*KINDS, *by_group, "session")
    assert (config.split.kind in by_group) == (config.split.group is not None)


def test_a_scene_of_ones_own_changes_another(tmp_path):
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "small.yaml").write_text(
        "# @package _global_\n"
        "defaults: [tactile@_here_, _self_]\n"
        "scene: {samples_per_class: 12}\n"
        "scene_display: {name: Small}\n"
    )
    config = tree(f"hydra.searchpath=[file://{tmp_path}]", "scene=small")
    assert config.scene.samples_per_class == 12
    assert config.split.test_fraction == pytest.approx(1 / 3)
    display = config.scene_display
    assert (display.name, display.kind) == ("Small", "simulated")
