"""Which files of a folder belong to a recording, with their labels, values and order."""

import sys

import cv2
import numpy as np
import pytest

from hdc.readers import Ambiguous, BadFrame, SettingError, camera, open_recording
from hdc.readers.about import Columns, typed
from hdc.readers.table import columns_in, read_csv
from hdc.readers.listing import image_files
from hdc.readers.template import Template


def write(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def test_folders_as_they_are(folder, pixels):
    """Nested folders and other files: counted, not refused; hidden ones are not seen."""
    write(folder / "b" / "deep" / "10.png", pixels[0])
    write(folder / "b" / "deep" / "9.png", pixels[1])
    for name in ("a/.DS_Store", ".cache/1.png"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(b"x")
    for name in ("README.txt", "a/meta.json", "loose.png"):
        (folder / name).write_text("about")
    (folder / "empty").mkdir()
    (folder / "unseen").mkdir()
    (folder / "unseen" / ".gitkeep").touch()
    recording = open_recording(folder)
    assert recording.classes == ("a", "b", "c")
    assert recording.names == ["a"] * 4 + ["b"] * 6 + ["c"] * 4
    assert recording.samples["file"][8:10].tolist() == ["b/deep/9.png", "b/deep/10.png"]
    assert set(recording.other_files) == {
        ".cache/",
        "a/meta.json",
        "empty/",
        "loose.png",
        "README.txt",
        "unseen/",
    }
    assert recording.left_out(2) == (
        "left out 6 other files and folders: .cache/, a/meta.json, …"
    )


def test_templates_give_label_order_session_group_and_value(tmp_path, pixels):
    names = [
        f"day{d}/raw/{c}/x_frame_{k}.png"
        for d in (2, 10)
        for c in "ab"
        for k in (2, 10)
    ]
    for name, image in zip(names, pixels, strict=False):
        write(tmp_path / name, image)
    write(tmp_path / "day2" / "ref" / "a" / "x_frame_1.png", pixels[0])
    (tmp_path / "day2" / "raw" / "a" / "meta.json").write_text("{}")
    recording = open_recording(
        tmp_path, template="{session}/raw/{label}/*_frame_{order}.png"
    )
    assert recording.samples["file"].tolist() == names
    assert recording.names == ["a", "a", "b", "b"] * 2
    assert recording.order.tolist() == [2, 10] * 4
    assert recording.session.tolist() == [0] * 4 + [1] * 4  # day2 before day10
    assert recording.samples["session_name"][-1] == "day10"
    assert recording.other_files == ("day2/raw/a/meta.json", "day2/ref/a/x_frame_1.png")
    assert np.array_equal(recording.frames([1]), pixels[[1]])
    write(tmp_path / "press" / "p1_wood12_-0.5mm.png", pixels[3])
    recording = open_recording(
        tmp_path / "press",
        template="{group}_{label}{order}_{value}mm.png",
        fewest_classes=1,
    )
    assert (recording.classes, recording.order.tolist()) == (("wood",), [12])
    assert recording.samples["group_name"].tolist() == ["p1"]
    assert (recording.values.tolist(), recording.value_names) == ([[-0.5]], ("value",))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"template": "{depth}/x.png"},
            r"template: expected fields among {label}, .*, each once",
        ),
        ({"template": "{label}/{label}.png"}, "template: expected fields among"),
        ({"template": "{label/x}.png"}, "template: expected fields among"),
        ({"template": "a/{order}.png"}, "expected a label of each frame, or numbers"),
        (
            {"template": "{label}.jpg"},
            r"as the template says, found 12 other files, a/1",
        ),
        (
            {"value_columns": ["z"]},
            "table: expected a table with the columns z, found None",
        ),
        ({"table": "t.csv"}, r"t.csv: expected a readable file, found none"),
        (
            {"crop": [0, 0, 31, 20]},
            "crop: expected a window inside frames 30 px wide and 20",
        ),
        ({"crop": [0, 0, 5]}, r"crop: expected null or \[x, y, width, height\]"),
        ({"crop": [-1, 0, 5, 5]}, "crop: expected null or"),
        ({"crop": [0, 0, 5.0, 5]}, "crop: expected null or"),
        ({"axes": ("frame",)}, "axes: expected null unless path is a file of arrays"),
    ],
)
def test_settings_that_cannot_be_are_named(folder, settings, message):
    with pytest.raises(ValueError, match=message):
        open_recording(folder, **settings)


def test_a_table_gives_values(folder, pixels):
    (folder / "t.csv").write_text(
        "image,x,z,note,order\nb/1.png,1,0.5,u,2\na/1.png,2,-1e-3,v,1\n"
    )
    recording = open_recording(folder, table="t.csv", value_columns=["z"])
    assert recording.labels is None
    assert (recording.values.tolist(), recording.value_names) == (
        [[0.5], [-1e-3]],
        ("z",),
    )
    assert recording.order.tolist() == [2, 1]
    assert np.array_equal(recording.frames([0, 1]), pixels[[4, 0]])
    every = open_recording(folder, table=folder / "t.csv", template="{label}/*.png")
    assert (every.names, every.value_names) == (["b", "a"], ("x", "z"))
    assert every.fingerprint() != recording.fingerprint()
    text = (folder / "t.csv").read_text()
    (folder / "t.csv").write_text(text.replace("0.5", "0.6"))
    other = open_recording(folder, table="t.csv", value_columns=["z"])
    assert other.fingerprint() != recording.fingerprint()
    (folder / "t.csv").write_text(text)
    with pytest.raises(ValueError, match="expected a recording with labels"):
        _ = recording.names
    with pytest.raises(
        ValueError, match=r"t.csv, line 2: expected a number in note, found 'u'"
    ):
        open_recording(folder, table="t.csv", value_columns=["note"])
    with pytest.raises(
        ValueError, match=r"t.csv: expected different columns, with picture, found"
    ):
        open_recording(folder, table="t.csv", image_column="picture")


def test_a_manifest_says_what_belongs_to_the_recording(folder, pixels):
    rows = ["file,label,order,session,depth,note,class_index", "c/1.png,none,2,0,0.5,x,1",
            "a/1.png,touch,0,0,1.5,y,0", "b/1.png,touch,1,1,-1e-3,7,0"]  # fmt: skip
    (folder / "manifest.csv").write_text("\n".join(rows) + "\n")
    recording = open_recording(folder)
    assert recording.classes == ("touch", "none")
    assert recording.labels.tolist() == [1, 0, 0]
    assert np.array_equal(recording.frames([0, 1, 2]), pixels[[8, 0, 4]])
    assert {k: v.tolist() for k, v in recording.samples.items()} == {
        "order": [2, 0, 1],
        "session": [0, 0, 1],
        "depth": [0.5, 1.5, -1e-3],
        "note": ["x", "y", "7"],
        "file": ["c/1.png", "a/1.png", "b/1.png"],
    }
    assert open_recording(folder, value_columns=["depth"]).values[0] == [0.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "manifest.csv: expected different columns, with file, label, found"),
        ("a,b\n1,2\n", "expected different columns, with file, label, found"),
        ("file,label\n", "expected images in one sub-folder per class"),
        ("file,label\na/1.png\n", "line 2: expected 2 values, found 1"),
        ("file,label\na/1.png,\nb/1.png,y\n", "line 2: expected a label"),
        ("file,label\na/1.png,x\na/./1.png,y\n", "line 3: expected each file once"),
        (
            "file,label\na/1.png,x\nb/9.png,y\n",
            "expected every image, found that 1 of 2 images are missing, the first b/9.png",
        ),
        (
            "file,label\na/1.png,x\nb/1.png,x\n",
            "expected two classes or more, found only 'x'",
        ),
        (
            "file,label,order\na/1.png,x,?\nb/1.png,y,1\n",
            "line 2: expected a number in order, found",
        ),
        (
            "file,label,class_index\na/1.png,x,1\nb/1.png,x,2\n",
            "one class_index per label, found",
        ),
        ("file,label,label\na/1.png,x,y\n", "expected different columns"),
        (b"file,label\n\xff\xfe,x\n", "expected a CSV table in UTF-8"),
        ('file,label\n"a/1.png,x\n', "expected a CSV table in UTF-8"),
    ],
)
def test_a_broken_manifest_is_named(folder, text, message):
    (folder / "manifest.csv").write_bytes(
        text if isinstance(text, bytes) else text.encode()
    )
    with pytest.raises(ValueError, match=message) as caught:
        open_recording(folder)
    assert str(folder) in str(caught.value)


def test_folders_without_a_recording_are_named(tmp_path, pixels, folder):
    write(tmp_path / "x" / "1.png", pixels[0])
    with pytest.raises(
        ValueError, match=r"x: expected .*, found 1 image and no sub-folder"
    ):
        open_recording(tmp_path / "x")
    (tmp_path / "y").mkdir()
    with pytest.raises(
        ValueError, match=r"y: expected images in one sub-folder per class"
    ):
        open_recording(tmp_path / "y")
    write(tmp_path / "y" / "a" / "x.png", pixels[0])
    with pytest.raises(
        ValueError, match="expected two classes or more, found only 'a'"
    ):
        open_recording(tmp_path / "y")
    for path, message in (
        (tmp_path / "absent", r"path: .* found nothing: .*/absent"),
        (sys.executable, r"path: expected a folder or a file"),
    ):
        with pytest.raises(SettingError, match=message):
            open_recording(path)


class Connected:
    """Two frames, in colour and in grey of 16 bits, and then none."""

    def __init__(self, index):
        colour = np.full((4, 6, 3), 90, np.uint8)
        self.images = [colour, np.arange(24, dtype=np.uint16).reshape(4, 6)] * (
            index == 2
        )
        self.there, self.released = index == 2, False

    def isOpened(self):
        return self.there

    def read(self):
        return (True, self.images.pop(0)) if self.images else (False, None)

    def release(self):
        self.released = True


def test_a_camera_gives_grey_frames_until_it_is_gone(monkeypatch):
    opened = []
    monkeypatch.setattr(
        cv2, "VideoCapture", lambda n: opened.append(Connected(n)) or opened[-1]
    )
    frames = camera(2, crop=[2, 0, 4, 4], subsample=2)
    assert next(frames).tolist() == [[90, 90], [90, 90]]
    assert next(frames).tolist() == [[2, 4], [14, 16]]
    with pytest.raises(BadFrame, match="camera 2: expected a frame, found none"):
        next(frames)
    assert opened[0].released
    with pytest.raises(
        ValueError, match=r"camera: expected a camera .* index 5, found none"
    ):
        next(camera(5))


# Templates ---------------------------------------------------------------------------------------


def images(root, pixels, *names):
    for name, image in zip(names, pixels, strict=False):
        write(root / name, image)
    return root


def test_a_template_that_reads_a_name_in_two_ways_is_refused(tmp_path, pixels):
    """users: foam_brick_1_000.png was foam in the session brick_1, and 95.8 % were shown."""
    root = images(tmp_path, pixels, "foam_brick_1_000.png", "mug_1_000.png")
    with pytest.raises(SettingError) as caught:
        open_recording(root, template="{label}_{session}_{order}.png")
    assert "found two of foam_brick_1_000.png: label 'foam', session 'brick_1'" in str(
        caught.value
    )
    assert "or label 'foam_brick', session '1', order '000'" in str(caught.value)
    recording = open_recording(root, template="{label}_{session:d}_{order}.png")
    assert recording.names == ["foam_brick", "mug"]
    assert recording.session.tolist() == [1, 1]


@pytest.mark.parametrize(
    ("template", "name", "expected"),
    [
        ("{label}{order}.png", "wood12.png", {"label": "wood", "order": "12"}),
        ("{label}{order}.png", "wood1.5.png", {"label": "wood", "order": "1.5"}),
        ("{label}{value}.png", "wood-0.5.png", {"label": "wood", "value": "-0.5"}),
        ("{order}*.png", "12_x.png", {"order": "12"}),
        ("*{order}.png", "a_3_12.png", {"order": "12"}),
        ("{session}/*/{label}.png", "a/b_c/d.png", {"session": "a", "label": "d"}),
        (
            "{{label}_a}{order}.png",
            "{wood_a}5.png",
            {"label": "wood", "order": "5"},
        ),  # a bracket alone is text
        ("{label}_*.png", "foam_brick_1.png", None),
        ("{label}*.png", "foam.png", None),
        ("*_{order}_*.png", "a_1_2_b.png", None),
        ("{label}{session}.png", "abc.png", None),
        ("*_{label}_*.png", "a_x_y_x_b.png", None),
        ("{label}-{value}.png", "a--5.png", None),
        ("./{label}.png", "a.png", {"label": "a"}),
        (
            "{label:w}_{group}_{order}.png",
            "Both_Shear_T_2.png",
            {"label": "Both", "group": "Shear_T", "order": "2"},
        ),
    ],
)
def test_readings_of_a_name(template, name, expected):
    pattern = Template(template)
    if expected is None:
        with pytest.raises(SettingError, match="template: expected one reading"):
            pattern.read(name)
    else:
        assert pattern.read(name) == expected
    assert pattern.read("other/" + name) is None


def test_a_table_of_an_array_without_anything_to_learn_is_named(tmp_path, pixels):
    np.save(tmp_path / "x.npy", pixels)
    (tmp_path / "x.csv").write_text("\n".join(["note", *["good"] * len(pixels)]))
    for fewest in (1, 2):
        with pytest.raises(ValueError, match=r"x\.csv: expected a label .*found note"):
            open_recording(
                tmp_path / "x.npy", table=tmp_path / "x.csv", fewest_classes=fewest
            )


def test_fields_that_a_template_cannot_have_are_named():
    for template in ("{order:d}.png", "{label:s}.png", "{label:}.png", "{}.png"):
        with pytest.raises(SettingError, match="template: expected fields among"):
            Template(template)


# Tables ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["", "nan", "NA", "inf", "1_0", "1,5", "?", "٣"])
def test_a_gap_in_a_column_of_numbers_is_named(folder, cell):
    """cracks: the column was left out, without a word."""
    rows = ["image,x,z", "a/1.png,1,0.5", f'a/2.png,2,"{cell}"', "a/3.png,3,0.25"]
    (folder / "t.csv").write_text("\n".join(rows), encoding="utf-8")
    for columns in ([], ["z"], ["x", "z"]):
        with pytest.raises(
            ValueError, match=r"t.csv, line 3: expected a (number in )?z"
        ):
            open_recording(folder, table="t.csv", value_columns=columns)
    assert open_recording(folder, table="t.csv", value_columns=["x"]).values.sum() == 6


@pytest.mark.parametrize("column", ["order", "session", "group"])
def test_a_gap_in_what_splits_go_by_is_named(folder, column):
    rows = [f"file,label,{column}", "a/1.png,x,1", "a/2.png,x,", "b/1.png,y,3"]
    (folder / "manifest.csv").write_text("\n".join(rows))
    message = rf"manifest.csv, line 3: expected (the|a number in) {column}( of each row)?, found ''"
    with pytest.raises(ValueError, match=message):
        open_recording(folder)


def test_sessions_are_the_numbers_that_are_written(folder):
    """cracks: 1_0 was session 10."""
    rows = ["file,label,session", "a/1.png,x,1_0", "a/2.png,x,2", "b/1.png,y,1"]
    (folder / "manifest.csv").write_text("\n".join(rows))
    recording = open_recording(folder)
    assert recording.samples["session_name"].tolist() == ["1_0", "2", "1"]
    assert recording.session.tolist() == [0, 2, 1]


def test_a_file_is_taken_once_by_whatever_spelling(folder):
    (folder / "z").symlink_to(folder / "a")
    for other in ("a/../a/1.png", "b/../a/1.png", "z/1.png", "./a//1.png"):
        text = f"file,label\na/1.png,x\n{other},y\n"
        (folder / "manifest.csv").write_text(text)
        with pytest.raises(ValueError, match=r"line 3: expected each file once, found"):
            open_recording(folder)


def test_names_are_the_same_in_either_form_of_unicode(tmp_path, pixels):
    """cracks: é of one code point and é of two were two classes."""
    composed, apart = "caf\u00e9", "cafe\u0301"
    root = images(
        tmp_path, pixels, f"{composed}/1.png", f"{apart}/2.png", "b/1.png", "b/2.png"
    )
    recording = open_recording(root)
    assert recording.classes == ("b", composed)
    assert recording.names == ["b", "b", composed, composed]
    rows = ["file,label,session", f"{composed}/1.png,{composed},{composed}",
            f"{apart}/2.png,{apart},{apart}", "b/1.png,b,b"]  # fmt: skip
    (root / "manifest.csv").write_text("\n".join(rows), encoding="utf-8")
    recording = open_recording(root)
    assert recording.labels.tolist() == [1, 1, 0]
    assert recording.session.tolist() == [1, 1, 0]
    labels = np.array([composed, apart, "b"])
    np.savez(tmp_path / "x.npz", frames=pixels[:3], labels=labels)
    assert open_recording(tmp_path / "x.npz").labels.tolist() == [1, 1, 0]


# Folders -----------------------------------------------------------------------------------------


def test_a_folder_of_one_class_asks_for_the_folder_above(folder):
    message = r"/a holds 4 images and no class folders; did you mean .*recording\?$"
    with pytest.raises(ValueError, match=message):
        open_recording(folder / "a")


def test_links_to_files_are_followed_and_broken_ones_named(folder, pixels):
    (folder / "c" / "5.png").symlink_to(folder / "a" / "1.png")
    assert np.array_equal(open_recording(folder).frames([12]), pixels[[0]])
    (folder / "c" / "6.png").symlink_to("gone.png")
    with pytest.raises(BadFrame, match=r"c/6.png: expected a readable file"):
        open_recording(folder)


def test_the_order_of_frames_is_part_of_the_fingerprint(folder):
    prints = set()
    for first, second in ((0, 1), (1, 0), (0, 2)):
        rows = f"file,label,order\na/1.png,x,{first}\nb/1.png,y,{second}\n"
        (folder / "manifest.csv").write_text(rows)
        prints.add(open_recording(folder).fingerprint())
    assert len(prints) == 3


# Errors ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("image,x\n", "expected images in .*, found none$"),
        ("image,note\na/1.png,u\n", "expected a label of each frame, or numbers"),
        ("image,x,order\na/1.png,1,?\n", "line 2: expected a number in order, found"),
        ("image,x\n,1\n", "line 2: expected a image, found none"),
    ],
)
def test_a_table_that_cannot_be_used_is_named(folder, rows, message):
    (folder / "t.csv").write_text(rows)
    with pytest.raises(ValueError, match=rf"recording/t\.csv(, |: ){message}"):
        open_recording(folder, table="t.csv")


def test_a_few_of_the_files_that_are_no_frames_are_shown(folder):
    """Of a folder, and of a table whose rows are none of the template."""
    (folder / "t.csv").write_text("image,x\nb/1.png,1\na/1.png,2\n")
    for table, found in (
        (None, "found 13 other files, a/1.png, a/2.png, a/3.png"),
        ("t.csv", "found 2 other files, b/1.png, a/1.png"),
    ):
        with pytest.raises(ValueError, match=f"{found}$"):
            open_recording(folder, template="{label}.jpg", table=table)


def test_the_folder_above_is_named_as_a_user_would_write_it(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    with pytest.raises(ValueError, match=r"^recording/a holds .* mean recording\?$"):
        open_recording("recording/a")
    monkeypatch.chdir(folder / "a")
    with pytest.raises(ValueError, match=rf"^\. holds .* mean {folder}\?$"):
        open_recording(".")


def test_a_folder_that_cannot_be_read_is_an_error(tmp_path):
    """Its files would be left out without a word."""
    with pytest.raises(OSError, match="absent"):
        image_files(tmp_path / "absent")


def test_a_loose_image_leaves_folders_of_folders_with_two_readings(tmp_path, pixels):
    """A picture of the sensor beside them made train and val the classes."""
    names = [f"{part}/{name}/1.png" for part in ("train", "val") for name in "ab"]
    root = images(tmp_path, pixels, *names, "setup.png")
    with pytest.raises(Ambiguous, match=r"such as train/a/1\.png"):
        open_recording(root)
    recording = open_recording(root, template="{session}/{label}/*")
    assert recording.names == ["a", "b"] * 2
    assert recording.other_files == ("setup.png",)


def test_images_of_a_table_are_looked_for_beside_it_and_in_the_folder(tmp_path, pixels):
    """Whichever of them are missing; names that are in both have two readings."""
    for k, name in enumerate(("day1", "day2")):
        for frame in (1, 2):
            write(tmp_path / name / f"{frame}.png", pixels[2 * k + frame])
    table = tmp_path / "day1" / "t.csv"
    table.write_text("image,x\n1.png,1\n2.png,2\n")
    with pytest.raises(ValueError, match=r"t\.csv: .*day2, found 1\.png in both"):
        open_recording(tmp_path / "day2", table=table)
    assert len(open_recording(tmp_path / "day1", table=table)) == 2
    (tmp_path / "tables").mkdir()
    elsewhere = table.rename(tmp_path / "tables" / "t.csv")
    found = open_recording(tmp_path / "day2", table=elsewhere)
    assert np.array_equal(found[:], pixels[3:5])
    above = tmp_path / "t.csv"
    above.write_text("image,x\nday1/0.png,0\nday1/1.png,1\n")
    found = open_recording(tmp_path / "day1", table=above, skip_missing=True)
    assert np.array_equal(found[:], pixels[1:2])


# Files of text -----------------------------------------------------------------------------------


def test_tables_are_read_as_spreadsheets_write_them(tmp_path):
    """With a mark of UTF-8, spaces, empty lines, and commas and line feeds in quotes."""
    path = tmp_path / "t.csv"
    text = '\ufeffimage , x\r\na.png, 1 \r\n\r\n"b,\r\nc.png",2\r\nd.png,""\r\n'
    path.write_bytes(text.encode())
    assert list(read_csv(path, ["image"])) == [
        (f"{path}, line 2", {"image": "a.png", "x": "1"}),
        (f"{path}, line 5", {"image": "b,\r\nc.png", "x": "2"}),
        (f"{path}, line 6", {"image": "d.png", "x": ""}),
    ]


@pytest.mark.parametrize("separator", ";\t")
def test_a_comma_in_a_number_is_decimal_where_another_sign_separates(
    tmp_path, separator
):
    path = tmp_path / "t.csv"
    cells = ["a,b.png", "-1,5", " 2,5e3 ", "1,2,3"]
    rows = [["image", "x", "y", "note"], cells]
    path.write_text("\n".join(separator.join(row) for row in rows), encoding="utf-16")
    ((_, found),) = read_csv(path, ["image"])
    assert list(found.values()) == ["a,b.png", "-1.5", "2.5e3", "1,2,3"]


@pytest.mark.parametrize(
    ("text", "encoding"),
    [("sep=;\nx;y\n1,5;b\n", "utf-8"), ("x;y\n1,5;b\n", "utf-16-le")],
)
def test_tables_of_spreadsheets_are_read_by_what_they_say(tmp_path, text, encoding):
    """A line sep=; blamed the frames, and UTF-16 without a mark could not be read."""
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode(encoding))
    assert [row for _, row in read_csv(path, ["x"])] == [{"x": "1.5", "y": "b"}]
    assert columns_in(path) == ["x", "y"]


@pytest.mark.parametrize(
    ("rows", "found"),
    [
        ("1.000,5\n2,5", "line 2: expected 1000 or 1,0, found '1.000,5'"),
        ("2,5\n1.000", "line 3: expected 1000 or 1,0, found '1.000'"),
        ("1.000\n2.500", None),  # decimal points
    ],
)
def test_points_between_thousands_are_asked_about(tmp_path, rows, found):
    """A column of 1.000,5 was not learnt, and 1.000 was read as 1."""
    path = tmp_path / "t.csv"
    path.write_text(f"x;y\n{rows}".replace("\n", ";a\n").replace("y;a", "y") + ";a\n")
    if found is None:
        assert [row["x"] for _, row in read_csv(path, [])] == ["1.000", "2.500"]
        return
    with pytest.raises(ValueError, match=found):
        list(read_csv(path, []))


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["1", "-2", "+3"], np.array([1, -2, 3])),
        (["1", "2.5", "1e3"], np.array([1, 2.5, 1000])),
        # More than 64 bits hold: as floats, different ones would be one class.
        (["7", "1" + "0" * 20], np.array(["7", "1" + "0" * 20])),
        (["1", "1_0"], np.array(["1", "1_0"])),
        (["1", "nan"], np.array(["1", "nan"])),
    ],
)
def test_cells_are_integers_or_else_numbers_or_else_text(texts, expected):
    found = typed(texts)
    assert found.tolist() == expected.tolist()
    assert found.dtype == expected.dtype


def test_a_table_without_names_of_columns_is_refused(tmp_path):
    """users: its first frame was lost. Names may be numbers in order, such as wavelengths."""
    path = tmp_path / "v.csv"
    path.write_text("3,1,2\n4,5,6\n")
    with pytest.raises(ValueError, match=r"v\.csv: .* names of columns in the first"):
        open_recording(path, fewest_classes=0)
    for names in ("400,401,402", "402,401.5,-1"):
        path.write_text(f"{names}\n3,1,2\n4,5,6\n")
        assert len(open_recording(path, fewest_classes=0)) == 2


@pytest.mark.parametrize("name", ["", "Unnamed: 0"])
def test_a_column_that_nobody_named_is_not_learnt(folder, tmp_path, name):
    """The index that pandas writes told the classes of a sorted table apart."""
    path = tmp_path / "v.csv"
    path.write_text(f"{name},label,400\n0,a,1\n1,b,2\n")
    with pytest.raises(ValueError, match=rf"v\.csv: .* found '{name}' \(pandas"):
        open_recording(path)
    (folder / "t.csv").write_text(f"{name},image,x\n0,a/1.png,5\n1,a/2.png,6\n")
    recording = open_recording(folder, table="t.csv")
    assert (recording.value_names, recording.values.tolist()) == (("x",), [[5], [6]])


# Vectors -----------------------------------------------------------------------------------------


def test_a_table_of_vectors_has_what_is_learnt_or_says_what_is_missing(tmp_path):
    path = tmp_path / "v.csv"
    path.write_text("400,401,order,force\n1,2,7,0.5\n3,4,6,1.5\n")
    for fewest in (1, 2):
        found = open_recording(path, value_columns=["force"], fewest_classes=fewest)
        assert found.frames([0, 1]).tolist() == [[1, 2], [3, 4]]
        assert (found.labels, found.value_names) == (None, ("force",))
        assert found.values.tolist() == [[0.5], [1.5]]
        assert found.order.tolist() == [7, 6]
        assert found.place(1) == f"{path}, line 3"
        with pytest.raises(ValueError, match=r"v\.csv: .* with z, found"):
            open_recording(path, value_columns=["z"], fewest_classes=fewest)
        with pytest.raises(ValueError, match=r"v\.csv: expected a column label, or"):
            open_recording(path, fewest_classes=fewest)
    unlabelled = open_recording(path, value_columns=["z"], fewest_classes=0)
    assert (unlabelled.labels, unlabelled.values) == (None, None)
    assert unlabelled.frames([1]).tolist() == [[3, 4, 1.5]]
    path.write_text("label,400\na,1\na,2\n")
    with pytest.raises(ValueError, match=r"v\.csv: expected two classes or more"):
        open_recording(path)
    assert open_recording(path, fewest_classes=1).names == ["a", "a"]
    path.write_text("label,order\na,1\nb,2\n")
    with pytest.raises(ValueError, match=r"v\.csv: expected columns of numbers, found"):
        open_recording(path)
    path.write_text("label,400,401\na,1,2\nb,?,3\n")
    message = r"v\.csv, line 3: expected a number in 400, found '\?'"
    with pytest.raises(ValueError, match=message):
        open_recording(path)
    path.write_text("label,400\n")
    with pytest.raises(ValueError, match=r"v\.csv: expected a row per frame"):
        open_recording(path)


def test_folders_of_several_depths_are_refused_and_named(tmp_path, pixels):
    for file in ("a/1/x.png", "b/2/3/x.png"):
        write(tmp_path / file, pixels[0])
    message = (
        r"folders of one depth, found a/1/x\.png and b/2/3/x\.png \(a manifest\.csv"
    )
    with pytest.raises(SettingError, match=message):
        open_recording(tmp_path)


@pytest.mark.parametrize(
    ("texts", "learnt"),
    [
        ("1 2", ["depth"]),
        ("1 2 a b", []),  # half of them are numbers
        ("1 - a b", []),
        ("1 2 a", "row 2: expected a number in depth, found 'a'"),
    ],
)
def test_a_column_of_which_more_than_half_are_numbers_is_one_of_numbers(texts, learnt):
    cells = texts.split()
    places = [f"row {i}" for i in range(len(cells))]
    columns = Columns.of("t.csv", places, [{"depth": cell} for cell in cells])
    if isinstance(learnt, list):
        assert columns.numeric() == learnt
        return
    with pytest.raises(ValueError, match=learnt):
        columns.numeric()


def test_where_all_images_are_missing_nothing_is_advised_that_fails(folder):
    (folder / "t.csv").write_text("image,x\nelsewhere/1.png,1\nelsewhere/2.png,2\n")
    for skip in (False, True):
        with pytest.raises(ValueError, match=r"t\.csv: .* found none of 2, .*/1\.png$"):
            open_recording(folder, table="t.csv", skip_missing=skip)
