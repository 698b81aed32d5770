"""What configs/ says, and in what another config differs."""

import pytest

from experiments.records import configs


def test_parts_of_configs_are_resolved_or_none():
    touch = configs.part("scene", "touch")
    assert set(touch) == {"scene", "split"}
    assert touch["scene"]["seed"] == 0
    assert configs.part("scene", "recorded")["scene"]["path"] == "???"
    assert configs.part("scene", "tactip_edge")["split"]["kind"] == "session"
    assert set(configs.part("model", "hdc")) == {"model"}
    paper = configs.part("stop", "paper")["stop"]
    assert configs.part("stop", "long")["stop"] == {**paper, "least_steps": 1000}
    assert configs.part("model", "nowhere") is None


def test_an_experiment_has_a_task_or_a_sweep():
    task = configs.task("drift")["_target_"]
    assert task == "experiments.studies.drift.measure.drift"
    assert configs.task("table1") == configs.task("nowhere") == {}
    assert "hdc" in configs.sweep("table1")["model"]
    assert configs.numbers(["5", "null"]) == [5, 0]


@pytest.mark.parametrize(
    ("config", "reference", "expected"),
    [
        ({"a": {"b": 1}}, {"a": {"b": 1}}, {}),
        ({"a": {"b": 2}}, {"a": {"b": 1}}, {"a.b": "2"}),
        ({"a": {}}, {"a": {"b": 1}}, {"a.b": "null"}),
        ({"a": {"c": "x"}}, {"a": {}}, {"a.c": '"x"'}),
        ({"a": 1}, {"a": {"b": 1}}, {"a": "1"}),
        ({"a": [1, 2]}, {"a": [1]}, {"a": "[1, 2]"}),
        ({"path": "x"}, {"path": "???"}, {}),
        ({"a": 1}, {"a": 1.0}, {}),
    ],
)
def test_differences_are_named_by_key(config, reference, expected):
    assert configs.differences(config, reference) == expected


@pytest.mark.parametrize(
    ("group", "name"),
    [
        *(("model", name) for name in ("cnn1_centred", "softmax_zero")),
        *(("scene", name) for name in ("fibre_16_fields", "fibres_exchanged", "spr")),
    ],
)
def test_an_inherited_display_is_that_of_hydra(compose, group, name):
    whole = compose(f"{group}={name}")
    if group == "model":
        assert configs.display(name).items() >= dict(whole.display).items()
    else:
        shown = configs.scene_display(name)
        assert shown.items() >= dict(whole.scene_display).items()
    unknown = configs.scene_display("nowhere")
    assert unknown["name"] == unknown["family"] == "nowhere"
