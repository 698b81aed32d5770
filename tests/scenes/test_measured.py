"""Public recordings as scenes: on made-up copies of their shape, and on themselves if present."""

import re

import cv2
import numpy as np
import pytest
import torch
from hydra.errors import InstantiationException

from scenes import listing, measured
from scenes.composed import scene_of
from scenes.frames import Scene
from scenes.listing import show
from scenes.measured import MeasuredScene
from scenes.source import Source
from tests.hdc.readers.writers import write_image

ABOUT = {
    "repository": "somebody/touches",
    "commit": "0123abc",
    "cite": "Somebody, 2024",
}


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A checkout of somebody/touches in MEASURED_DATA."""
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    return tmp_path / "touches"


@pytest.fixture
def pressed(root):
    """Two materials, three cycles, a colour image and a file beside it each."""
    images = np.random.default_rng(0).integers(0, 256, (6, 6, 8, 3), dtype=np.uint8)
    for k, image in enumerate(images):
        folder = root / f"material_{k // 3 + 9}" / f"cycle_{k % 3 + 1}_A"
        write_image(folder / "frame.png", image)
        (folder / "flow.json").write_text("{}")
    return images


def touches(**settings):
    template = "material_{label}/cycle_{order}_A/frame.png"
    return MeasuredScene(**{"source": ABOUT, "template": template, **settings})


def test_a_recording_is_a_scene(pressed, monkeypatch):
    scene = touches()
    assert isinstance(scene, Scene)
    assert (scene.origin, scene.cacheable, scene.unknown) == ("measured", False, None)
    assert (scene.classes, scene.shape, len(scene)) == (("9", "10"), (6, 8), 6)
    assert scene.samples["order"].tolist() == [1, 2, 3, 1, 2, 3]
    indices = [5, 0, 0, 3]
    grey = [cv2.cvtColor(pressed[i], cv2.COLOR_BGR2GRAY) for i in indices]
    expected = torch.from_numpy(np.stack(grey))
    assert torch.equal(scene.frames(indices), expected)
    monkeypatch.setattr(measured, "MEMORY_BYTES", 0)
    part = touches(subsample=2).frames(indices)
    assert torch.equal(part, expected[:, ::2, ::2])
    assert scene.frames([]).shape == (0, 6, 8)


def test_other_content_is_refused_and_changes_the_fingerprint(pressed, root):
    scene = touches()
    source = {**ABOUT, "sha256": scene.sha256}
    assert touches(source=source).fingerprint() == scene.fingerprint()
    assert touches(subsample=2).fingerprint() != scene.fingerprint()
    write_image(root / "material_9" / "cycle_2_A" / "frame.png", pressed[4])
    assert touches().fingerprint() != scene.fingerprint()
    with pytest.raises(ValueError, match="the 6 files of somebody/touches at 0123abc"):
        touches(source=source)


TABLES = {
    "train": "a.png,2,0\nb.png,3,-1\nc.png,4,-2",
    "val": "a.png,4.5,0\nb.png,6,-1",
}


def test_a_table_gives_values_and_levels_and_each_folder_is_a_session(root):
    for folder, rows in TABLES.items():
        for name in "abc":
            write_image(
                root / folder / "images" / f"{name}.png", np.zeros((4, 4), np.uint8)
            )
        table = root / folder / "targets.csv"
        table.write_text(f"sensor_image,pose_3,pose_4\n{rows}")

    def of_depth(*edges, value="depth"):
        depth = {"name": "depth", "unit": "mm", "column": "pose_3"}
        return touches(
            template=None,
            folders=["train/images", "val/images"],
            table="../targets.csv",
            image_column="sensor_image",
            values=[depth, {"name": "roll", "unit": "degrees", "column": "pose_4"}],
            levels={"value": value, "edges": edges},
        )

    scene = of_depth(3, 4.5, 6)
    assert (scene.value_names, scene.units) == (("depth", "roll"), ("mm", "degrees"))
    assert scene.values.tolist() == [[2, 0], [3, -1], [4, -2], [4.5, 0], [6, -1]]
    assert scene.classes == ("≤ 3 mm", "3–4.5 mm", "4.5–6 mm")
    assert scene.labels.tolist() == [0, 0, 1, 1, 2]
    assert scene.samples["session"].tolist() == [0, 0, 0, 1, 1]
    assert (np.diff(scene.samples["order"]) > 0).all()
    assert scene.frames([4, 0]).shape == (2, 4, 4)
    message = r"scene\.levels\.edges: expected a last edge of 6 or more"
    with pytest.raises(ValueError, match=message):
        of_depth(3, 5)
    message = r"scene\.levels\.value: expected a name in scene\.values \(depth, roll\), found 'yaw'"
    with pytest.raises(ValueError, match=message):
        of_depth(3, 6, value="yaw")


def test_unknown_frames_are_a_scene_of_their_own(root):
    """And a class whose name is spelled in two ways is one."""
    for grey, label in enumerate(["n13311", "extra", "n13529", "m13529"]):
        write_image(root / label / f"s{grey}_1.png", np.full((3, 3), grey, np.uint8))
    scene = touches(
        template="{label}/{group}_{order}.png",
        rename={"m13529": "n13529"},
        unknown=["extra"],
    )
    assert scene.classes == ("n13311", "n13529")
    assert scene.labels.tolist() == [1, 0, 1]
    assert scene.frames(range(3))[:, 0, 0].tolist() == [3, 0, 2]
    unknown = scene.unknown
    assert (unknown.classes, len(unknown)) == (("extra",), 1)
    assert unknown.frames([0])[0, 0, 0] == 1
    assert unknown.fingerprint() != scene.fingerprint()


def test_a_damaged_file_is_left_out_where_it_is_named(root):
    for name in ("a_1", "a_2", "b_1"):
        write_image(root / "data" / f"{name}.png", np.zeros((30, 30), np.uint8))
    (root / "data" / "a_2.png").write_bytes(b"damaged")
    settings = {"template": "{label:w}_{order}.png", "folders": ["data"]}
    scene = touches(**settings, damaged=["data/a_2.png"])
    assert scene.labels.tolist() == [0, 1]
    assert scene.frames(range(2)).shape == (2, 30, 30)
    with pytest.raises(ValueError, match=r"scene\.damaged: expected a file of a frame"):
        touches(**settings, damaged=["a_2.png"])


@pytest.mark.parametrize("folder", ["touches", "somebody+touches"])
def test_a_checkout_has_one_of_two_names(tmp_path, monkeypatch, folder):
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    assert Source(**ABOUT).find() is None
    (tmp_path / folder).mkdir()
    assert Source(**ABOUT).folder() == tmp_path / folder


def test_the_commands_clone_nothing_where_the_variable_is_not_set(monkeypatch):
    """A shell ends at ${X:?} where X is not set."""
    commands = "git clone https://github.com/somebody/touches {0} && git -C {0} checkout 0123abc"
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    unset = '"${MEASURED_DATA:?}/touches"'
    assert Source(**ABOUT).command() == commands.format(unset)
    monkeypatch.setenv("MEASURED_DATA", "/my data")
    assert Source(**ABOUT).command() == commands.format("'/my data/touches'")


def test_missing_recordings_are_listed_with_one_script(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    (tmp_path / "article_MMF_disorder").mkdir()
    show()
    table, script = capsys.readouterr().out.split("This script gets")
    for name, state in (("gelsight", "no"), ("tactip", "no"), ("fibre", "unreadable")):
        assert re.search(rf" {name} .*│ {state}", table)
    # Two scenes read the second fibre's repository: it is cloned once. The first one's is there.
    assert (
        script.count("git clone https://github.com/wavefrontshaping/article_RME") == 1
    )
    assert "article_MMF_disorder" not in script


def test_a_comment_makes_no_public_recording(tmp_path, monkeypatch):
    """Any file with the word in its text was one, and could not be listed."""
    monkeypatch.setattr(listing, "CONFIGS", tmp_path)
    own = "# source: our camera\nscene: {_target_: scenes.recorded.open_recording}"
    (tmp_path / "own.yaml").write_text(own)
    (tmp_path / "public.yaml").write_text("scene: {source: {}}")
    (tmp_path / "fibre.yaml").write_text("scene: {_target_: scenes.fibre.FibreScene}")
    assert listing.public_names() == ["fibre", "public"]


@pytest.mark.parametrize("name", listing.public_names())
def test_the_public_recordings(name):
    """Their files are those of the digest in the YAML, or opening them fails."""
    try:
        scene = scene_of([f"scene={name}"])
    except InstantiationException as error:
        if isinstance(error.__cause__, FileNotFoundError):
            pytest.skip(f"{name}: {error.__cause__}")
        raise
    assert np.bincount(scene.labels).min() >= 60  # of the smallest, the wedge
    assert tuple(scene.frames([0, len(scene) - 1]).shape) == (2, *scene.shape)
