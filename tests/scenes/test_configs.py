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
