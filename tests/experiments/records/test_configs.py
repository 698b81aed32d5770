"""What configs/ says is what Hydra composes of it."""

import pytest

from experiments.records import configs


@pytest.mark.parametrize(
    ("group", "name"),
    [
        *(("model", name) for name in ("cnn3", "softmax_zero")),
        *(("scene", name) for name in ("wedge_days", "fibres_exchanged", "diffuser")),
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
    assert configs.numbers(["5", "null"]) == [5, 0]
