"""Which files of a folder belong to the scene, and what is said where none do."""

import os

import cv2
import numpy as np
import pytest

from hdc.readers import BadFrame, open_recording


def write(path, image, *parameters):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image, parameters)


def test_files_and_classes_are_in_natural_order(tmp_path, pixels):
    names = ["class2/f10.png", "class2/f2.png", "class10/f1.png", "class10/F1.bmp"]
    for name, image in zip(names, pixels, strict=False):
        write(tmp_path / name, image)
    scene = open_recording(tmp_path)
    assert scene.classes == ("class2", "class10")
    assert scene.samples["file"].tolist() == [
        "class2/f2.png", "class2/f10.png", "class10/F1.bmp", "class10/f1.png",
    ]  # fmt: skip


MANIFEST = """file,label,order,session,depth,note,class_index
c/1.png,none,2,0,0.5,x,1
a/1.png,touch,0,0,1.5,y,0
b/1.png,touch,1,1,-1e-3,7,0
"""


def test_a_manifest_says_what_belongs_to_the_scene(folder, pixels):
    (folder / "manifest.csv").write_text(MANIFEST)
    scene = open_recording(folder)
    assert scene.classes == ("touch", "none")
    assert scene.labels.tolist() == [1, 0, 0]
    assert np.array_equal(scene.frames([0, 1, 2]), pixels[[8, 0, 4]])
    assert {k: v.tolist() for k, v in scene.samples.items()} == {
        "order": [2, 0, 1],
        "session": [0, 0, 1],
        "depth": [0.5, 1.5, -1e-3],
        "note": ["x", "y", "7"],
        "file": ["c/1.png", "a/1.png", "b/1.png"],
    }
    (folder / "manifest.csv").write_text("file,label\nb/1.png,x10\na/1.png,x9\n")
    scene = open_recording(folder)
    assert scene.classes == ("x9", "x10")
    assert scene.samples["order"].tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "manifest.csv: expected a CSV table .* columns file, label, found an empty file"),
        ("a,b\n1,2\n", "expected columns file, label, found no file, label"),
        ("file,label\n", "expected at least one row"),
        ("file,label\na/1.png\n", "line 2: expected 2 values, found 1"),
        ("file,label\na/1.png,\nb/1.png,y\n", "line 2: expected a label"),
        ("file,label\n../x.png,a\n", "line 2: expected a path inside the folder"),
        ("file,label\n/etc/x.png,a\n", "line 2: expected a path inside the folder"),
        ("file,label\na/1.png,x\na/./1.png,y\n", "line 3: expected each file once"),
        ("file,label\na/1.png,x\nb/9.png,y\n", "b/9.png: expected a readable file"),
        ("file,label\na/1.png,x\nb/1.png,x\n", "expected two classes or more, found only 'x'"),
        ("file,label,order\na/1.png,x,?\nb/1.png,y,1\n", "expected 2 numbers in the column order"),
        ("file,label,class_index\na/1.png,x,1\nb/1.png,y,2\n", "one class_index a label, 0 … 1"),
        ("file,label,class_index\na/1.png,x,0\nb/1.png,y,0\n", "one class_index a label, 0 … 1"),
        ("file,label,label\na/1.png,x,y\n", "expected different column names"),
        (b"file,label\n\xff\xfe,x\n", "expected a CSV table in UTF-8"),
        ("file,label,session\na/1.png,x,nan\nb/1.png,y,1\n", "2 numbers in the column session"),
        (
            f"file,label\na/1.png,{'x' * 201}\nb/1.png,y\n",
            "line 2: expected a label of at most 200",
        ),
        (b"file,label\n" + b"a,b\n" * 2**21, "expected at most 8388608 bytes, found 8388619"),
        (f"{'x' * 200_000}\n", "expected a CSV table in UTF-8 .*, found: field larger"),
        ('file,label,note\n\n\na/1.png,x,"two\nlines"\nb/1.png,y\n', "line 6: expected 3 values"),
        ("file,label\na/1.png,x\u2028y\n", r"line 2: expected a label of printable letters, found"),
        ('file,label\n"a/1.png,x\n', "expected a CSV table in UTF-8"),
        ("file,label\na/1\0.png,x\nb/1.png,y\n", r"1\\x00.png"),
    ],
)
def test_a_broken_manifest_is_named(folder, text, message):
    (folder / "manifest.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=message) as caught:
        open_recording(folder)
    assert str(folder) in str(caught.value)


def test_what_desktops_leave_behind_is_no_frame(folder):
    for name in (".DS_Store", "Thumbs.db", "._1.png"):
        (folder / "a" / name).write_bytes(b"x")
    for name in (".cache", "__MACOSX", "@eaDir", "a/@eaDir"):
        (folder / name).mkdir()
        (folder / name / "1.png").write_bytes(b"x")
    (folder / "README.txt").write_text("about")
    assert len(open_recording(folder)) == 12


def test_folders_that_make_no_scene_are_named(tmp_path, folder, pixels, monkeypatch):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(
        ValueError, match=r"empty: expected one sub-folder a class, or a .*, found none"
    ):
        open_recording(empty)
    write(empty / "x.png", pixels[0])
    with pytest.raises(ValueError, match=r"x.png: expected images in one sub-folder a class"):
        open_recording(empty)
    one = tmp_path / "one"
    write(one / "a" / "x.png", pixels[0])
    with pytest.raises(ValueError, match="expected two classes or more, found only 'a'"):
        open_recording(one)
    (one / "b").mkdir()
    with pytest.raises(ValueError, match="one/b: expected images of this class, found none"):
        open_recording(one)
    (one / "b" / "x.png").write_bytes(b"")
    with pytest.raises(ValueError, match="one: class 'b': none of its frames can be used"):
        open_recording(one, on_bad_frame="skip")
    (one / "a" / "x.png").write_bytes(b"")
    with pytest.raises(BadFrame, match="one: expected images, found none that can be read"):
        open_recording(one, on_bad_frame="skip")
    (folder / "a\n").mkdir()
    with pytest.raises(ValueError, match=r"a\\n: expected a label of printable letters"):
        open_recording(folder)
    (folder / "a\n").rmdir()
    (folder / "loop").symlink_to("loop")
    with pytest.raises(ValueError, match="loop: expected a file or folder, found: Too many levels"):
        open_recording(folder)
    (folder / "loop").unlink()

    listdir = os.listdir  # chmod does not stop root, under whom tests may run

    def refuse(path):
        if str(path).endswith("/b"):
            raise PermissionError(13, "Permission denied")
        return listdir(path)

    monkeypatch.setattr(os, "listdir", refuse)
    with pytest.raises(
        ValueError, match="/b: expected a readable folder, found: Permission denied"
    ):
        open_recording(folder)
