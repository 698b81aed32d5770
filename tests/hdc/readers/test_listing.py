"""Which files of a folder belong to a recording, with their labels, values and order."""

import cv2
import numpy as np
import pytest

from hdc.readers import Ambiguous, BadFrame, SettingError, camera, open_recording
from hdc.readers.template import Template
from tests.hdc.readers.writers import said


def test_folders_as_they_are(folder, images):
    """Nested folders and other files: counted, not refused; hidden ones are not seen."""
    images(folder, "b/deep/10.png", "b/deep/9.png", ".cache/1.png")
    (folder / "empty").mkdir()
    for name in ("a/.DS_Store", "README.txt", "a/meta.json", "loose.png", "x.npy"):
        (folder / name).write_text("about")
    recording = open_recording(folder)
    assert recording.names == ["a"] * 4 + ["b"] * 6 + ["c"] * 4
    assert recording.samples["file"][8:10].tolist() == ["b/deep/9.png", "b/deep/10.png"]
    others = {"a/meta.json", "loose.png", "README.txt", "x.npy"}
    assert set(recording.other_files) == others
    first = "a/meta.json, loose.png, README.txt"
    assert recording.left_out() == f"left out 4 other files: {first}, …"


def test_templates_give_label_order_session_group_and_value(tmp_path, images):
    root = images(tmp_path, "day10/raw/a/x_2.png", "day2/raw/b/x_10.png",
                  "day2/raw/b/x_2.png", "day2/ref/a/x_1.png")  # fmt: skip
    (root / "day2" / "raw" / "b" / "meta.json").write_text("{}")
    recording = open_recording(root, template="{session}/raw/{label}/*_{order}.png")
    assert said(recording, "file label order session session_name") == [
        "day2/raw/b/x_2.png b 2 0 day2",
        "day2/raw/b/x_10.png b 10 0 day2",
        "day10/raw/a/x_2.png a 2 1 day10",
    ]
    assert recording.other_files == ("day2/raw/b/meta.json", "day2/ref/a/x_1.png")
    root = images(tmp_path / "press", "p1_wood12_-0.5mm.png")
    template = "{group}_{label}{order}_{value}mm.png"
    recording = open_recording(root, template=template, fewest_classes=1)
    assert said(recording, "group_name label order value") == ["p1 wood 12 -0.5"]


@pytest.mark.parametrize(
    ("template", "name", "expected"),
    [
        ("{label}{order}.png", "wood12.png", "label=wood order=12"),
        ("{label:w}{order}.png", "wood1.5.png", "label=wood order=1.5"),
        ("{label:w}{value}.png", "wood-0.5.png", "label=wood value=-0.5"),
        ("{order}*.png", "12_x.png", "order=12"),
        ("{session}/*/{label}.png", "a/b_c/d.png", "session=a label=d"),
        ("{{label}_a}{order}.png", "{wood_a}5.png", "label=wood order=5"),
        ("./{label}~{order}.png", "a~1.png", "label=a order=1"),
        ("{label:w}_{group}_{order}.png", "Both_Shear_T_2.png",
         "label=Both group=Shear_T order=2"),
        ("{label}_{session:d}_{order}.png", "foam_brick_1_000.png",
         "label=foam_brick session=1 order=000"),
        # It was foam in the session brick_1, and 95.8 % were shown.
        ("{label}_{session}_{order}.png", "foam_brick_1_000.png", None),
        ("{label}*.png", "foam.png", None),
        ("*_{order}_*.png", "a_1_2_b.png", None),
        ("{label}{session}.png", "abc.png", None),
        ("{label}-{value}.png", "a--5.png", None),
        ("{label}{order}.png", "wood1.5.png", None),
    ],
)  # fmt: skip
def test_readings_of_a_name(template, name, expected):
    pattern = Template(template)
    assert pattern.read("other/" + name) is None
    if expected is not None:
        read = pattern.read(name).items()
        assert " ".join(f"{field}={text}" for field, text in read) == expected
        return
    with pytest.raises(SettingError, match=rf"expected one reading .*two of {name}: "):
        pattern.read(name)


@pytest.mark.parametrize(
    "template",
    ["{depth}/x.png", "{label}/{label}.png", "{label/x}.png", "{order:d}.png", "{}.png"],
)  # fmt: skip
def test_fields_that_a_template_cannot_have_are_named(template):
    with pytest.raises(SettingError, match="template: expected fields among"):
        Template(template)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"template": "a/{order}.png"}, "recording: expected a label of each frame, or num"),
        ({"template": "{label}.jpg"}, r"as the template says.*, found 12 other files, a/1"),
        ({"table": "t.csv"}, r"t.csv: expected a readable file, found none"),
        ({"crop": [0, 0, 31, 20]}, "1.png: crop: expected a window inside frames 30 px wide"),
        ({"crop": [0, 0, 5.0, 5]}, "crop: expected null or"),
        ({"subsample": 0}, "subsample: expected an integer ≥ 1, found 0"),
        ({"axes": ("frame",)}, "axes: expected null unless .* is a folder of arrays"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_named(folder, settings, message):
    with pytest.raises(ValueError, match=message):
        open_recording(folder, **settings)


def test_a_table_gives_values(folder, pixels):
    table = folder / "t.csv"
    rows = "image,x,z,note,order\nb/1.png,1,0.5,u,2\na/1.png,2,-1e-3,v,1\n"
    table.write_text(rows)
    recording = open_recording(folder, table="t.csv", value_columns=["z"])
    assert said(recording, "order z") == ["2 0.5", "1 -0.001"]
    with pytest.raises(ValueError, match="expected a recording with labels"):
        _ = recording.names
    assert np.array_equal(recording[:], pixels[[4, 0]])
    every = open_recording(folder, table=table, template="{label}/*.png")
    assert said(every, "label x z") == ["b 1 0.5", "a 2 -0.001"]
    table.write_text(rows.replace("0.5", "0.6"))
    other = open_recording(folder, table=table, value_columns=["z"])
    assert len({found.fingerprint() for found in (recording, every, other)}) == 3


def test_a_manifest_says_what_belongs_to_the_recording(folder, pixels):
    rows = ["file,label,order,session,depth,note,class_index", "c/1.png,none,2,0,0.5,x,1",
            "a/1.png,touch,0,0,1.5,y,0", "b/1.png,touch,1,1,-1e-3,7,0"]  # fmt: skip
    (folder / "manifest.csv").write_text("\n".join(rows) + "\n")
    recording = open_recording(folder)
    assert recording.classes == ("touch", "none")
    assert np.array_equal(recording[:], pixels[[8, 0, 4]])
    assert said(recording, "label order session depth note file") == [
        "none 2 0 0.5 x c/1.png",
        "touch 0 0 1.5 y a/1.png",
        "touch 1 1 -0.001 7 b/1.png",
    ]
    assert {*recording.samples} == {"order", "session", "depth", "note", "file"}
    assert open_recording(folder, value_columns=["depth"]).values[0] == [0.5]


@pytest.mark.parametrize(
    ("name", "rows", "message"),
    [
        ("manifest", "", ": expected different columns, file, label, found"),
        ("manifest", "file,label,label|a/1.png,x,y", ": expected different columns"),
        ("manifest", "file,label|a/1.png", ", line 2: expected 2 values, found 1"),
        ("manifest", "file,label|a/1.png,|b/1.png,y", ", line 2: expected a label"),
        ("manifest", "file,label|a/1.png,x|b/../a/1.png,y", ", line 3: expected each file"),
        ("manifest", "file,label|a/1.png,x|b/9.png,y",
         ": expected every image .*, found that 1 of 2 are missing, the first b/9.png"),
        ("manifest", "file,label,order|a/1.png,x,?|b/1.png,y,1", "2: expected a number in ord"),
        ("manifest", "file,label,session|a/1.png,x,1|b/1.png,y,", "3: expected the session of"),
        ("manifest", "file,label,class_index|a/1.png,x,1|b/1.png,x,2", "one class_index per"),
        ("t", "image,x", ": expected a row per frame, found none$"),
        ("t", "path,x|a/1.png,1", "; --image-column names it.*, found 'image'"),
        ("t", "image,x|,1", ", line 2: expected a image, found none"),
        ("t", "image,x|e/1.png,1|e/2.png,2", ": .* 2 of 2 are missing, the first e/1.png$"),
    ],
)  # fmt: skip
def test_a_table_that_cannot_be_used_is_named(folder, name, rows, message):
    (folder / f"{name}.csv").write_text("\n".join(rows.split("|")))
    table = None if name == "manifest" else "t.csv"
    with pytest.raises(ValueError, match=rf"recording/{name}\.csv.*{message}"):
        open_recording(folder, table=table)


def test_images_of_a_table_are_looked_for_beside_it_and_in_the_folder(
    tmp_path, images, pixels
):
    """Names that are in both are those of the folder."""
    images(tmp_path, *(f"day{k}/{n}.png" for k in (1, 2) for n in (1, 2)))
    table = tmp_path / "day1" / "t.csv"
    table.write_text("image,x\n1.png,1\n2.png,2\n")
    found = open_recording(tmp_path / "day2", table=table)
    assert np.array_equal(found[:], pixels[2:4])
    assert len(open_recording(tmp_path / "day1", table=table)) == 2
    (tmp_path / "tables").mkdir()
    elsewhere = table.rename(tmp_path / "tables" / "t.csv")
    found = open_recording(tmp_path / "day2", table=elsewhere)
    assert np.array_equal(found[:], pixels[2:4])
    above = tmp_path / "t.csv"
    above.write_text("image,x\nday1/1.png,0\nday1/2.png,1\n")
    found = open_recording(tmp_path / "day1", table=above)
    assert np.array_equal(found[:], pixels[:2])


def test_images_of_another_disk_are_found_by_their_names(tmp_path, images, pixels):
    images(tmp_path / "r", "day1/a.png", "day1/b.png", "day2/c.png")
    table = tmp_path / "t.csv"
    table.write_text("image,x\n/old/c.png,1\nD:\\old\\a.png,2\n")
    found = open_recording(tmp_path / "r", table=table)
    assert np.array_equal(found[:], pixels[[2, 0]])
    assert found.notes == ("images found by their names: /old/c.png is day2/c.png",)
    (tmp_path / "r" / "day1" / "c.png").symlink_to(tmp_path / "r" / "day1" / "a.png")
    with pytest.raises(ValueError, match=r"2 of 2 are missing, the first /old/c\.png"):
        open_recording(tmp_path / "r", table=table)


# Folders -----------------------------------------------------------------------------------------


def test_names_are_the_same_in_either_form_of_unicode(tmp_path, images):
    """An é of one code point and one of two were two classes."""
    root = images(tmp_path, "1.png", "2.png", "3.png")
    composed, apart = "1.png,caf\u00e9,caf\u00e9", "2.png,cafe\u0301,cafe\u0301"
    rows = ["file,label,session", composed, apart, "3.png,b,b"]
    (root / "manifest.csv").write_text("\n".join(rows), encoding="utf-8")
    recording = open_recording(root)
    assert recording.labels.tolist() == recording.session.tolist() == [1, 1, 0]


def test_links_to_files_are_followed_and_broken_ones_named(folder, pixels):
    (folder / "c" / "5.png").symlink_to(folder / "a" / "1.png")
    assert np.array_equal(open_recording(folder)[12], pixels[0])
    (folder / "c" / "6.png").symlink_to("gone.png")
    with pytest.raises(BadFrame, match=r"c/6.png: expected a readable file"):
        open_recording(folder)
    (folder / "a" / "loop").symlink_to(folder)  # 12 images became 492 frames
    with pytest.raises(ValueError, match="a/loop: expected a folder, found a link to"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ((), ": expected images in one sub-folder per class"),
        (("1.png",), ": .* of one class give the one above.*, found 1 other files, 1.png"),
        (("a/1.png",), ": expected two classes or more, found only 'a'"),
        # A picture of the sensor beside them made train and val the classes.
        (("train/a/1.png", "val/b/1.png", "s.png"), ": folders of .*, such as train/a/1.png"),
    ],
)  # fmt: skip
def test_folders_without_a_recording_are_named(tmp_path, images, names, message):
    (tmp_path / "r").mkdir()
    images(tmp_path / "r", *names)
    with pytest.raises((ValueError, Ambiguous), match=f"/r{message}"):
        open_recording(tmp_path / "r")


# Cameras -----------------------------------------------------------------------------------------


def test_a_camera_gives_grey_frames_until_it_is_gone(monkeypatch, tmp_path, write_film):
    """A film takes its place, whose end is that of a camera that is taken away."""
    film = np.arange(2 * 32 * 48).reshape(2, 32, 48).astype(np.uint8)
    write_film(tmp_path / "x.mkv", film)
    opened = cv2.VideoCapture(str(tmp_path / "x.mkv"))
    monkeypatch.setattr(cv2, "VideoCapture", lambda _: opened)
    frames = camera(2, crop=[2, 0, 4, 4], subsample=2)
    for frame in film.astype(int):
        assert np.abs(next(frames) - frame[:4:2, 2:6:2]).max() <= 5
    with pytest.raises(BadFrame, match="camera 2: expected a frame, found none"):
        next(frames)
    with pytest.raises(ValueError, match=r"expected a camera .* index 5, found"):
        next(camera(5))  # it was released
