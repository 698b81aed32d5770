"""What configs/ says, and in what another config differs."""

import pytest
from hydra import compose, initialize_config_dir

from experiments.records import configs


def test_parts_of_configs_are_resolved_or_none():
    touch = configs.part("scene", "touch")
    assert set(touch) == {"scene", "split"}
    assert touch["scene"]["seed"] == 0
    assert configs.part("scene", "recorded")["scene"]["path"] == "???"
    assert configs.part("model", "hdc") == {
        "model": configs.part("model", "hdc")["model"]
    }
    paper = configs.part("stop", "paper")["stop"]
    assert configs.part("stop", "long")["stop"] == {**paper, "least_steps": 1000}
    assert configs.part("model", "nowhere") is None


def test_a_scene_says_how_it_is_split_and_shown():
    assert configs.part("scene", "fibre_4_fields")["split"]["group"] == "depth"
    assert configs.part("scene", "tactip_edge")["split"]["kind"] == "session"
    fibre = configs.scene_display("fibre_16_fields")
    assert (fibre["kind"], fibre["family"]) == ("computed", "wavefrontshaping")
    assert configs.scene_display("finger")["fitted"]
    unknown = configs.scene_display("nowhere")
    assert unknown["name"] == unknown["family"] == "nowhere"


def test_an_experiment_has_a_task_or_a_sweep():
    assert (
        configs.task("drift")["_target_"] == "experiments.studies.drift.measure.drift"
    )
    assert configs.task("table1") == configs.task("nowhere") == {}
    assert "hdc" in configs.sweep("table1")["model"]
    assert configs.numbers(["5", "null"]) == [5, None]


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


def test_an_inherited_display_is_that_of_hydra():
    with initialize_config_dir(str(configs.CONFIGS), version_base="1.3"):
        for name in ("cnn1_centred", "softmax_zero", "ridge_standardised"):
            whole = compose("config", overrides=[f"model={name}"])
            assert configs.display(name).items() >= dict(whole.display).items()
        for name in ("fibre_16_fields", "fibres_exchanged", "spr"):
            whole = compose("config", overrides=[f"scene={name}"])
            shown = configs.scene_display(name)
            assert shown.items() >= dict(whole.scene_display).items()
