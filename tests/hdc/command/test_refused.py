"""What can be wrong with what a command is given: one line each, and nothing is written."""

import os
import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from hdc import HDCRegressor, command


def contents():
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def test_what_is_read_is_named_in_one_line(hdc, model, frames, write):
    write("r", frames)
    write("few", [frames[0], frames[2, :1]], "ab")
    write("other", frames[:1], "x")
    write("broken", frames)
    broken = Path("broken/a/7.png")
    broken.write_bytes(broken.read_bytes()[:-20])
    os.mkdir("empty")
    model.rename("m")
    HDCRegressor().fit(frames[0], np.arange(12.0)).save("n")
    before = contents()
    for typed, message in (
        ("train no -o out", "found nothing: no"),
        ("train r -o no/m", "expected a folder to save m in"),
        ("train broken -o out", "broken/a/7.png: expected a whole image"),
        ("train few -o out --test-fraction 0.5",
         "--test-fraction: expected a frame of each class to test and another to learn"),
        ("train r -o out --set encoder__tie=spread", "found 'encoder__tie'"),
        ("predict r/a/0.png m", "r/a/0.png: expected"),
        ("predict m 'no\n.png'", "no .png: expected a readable file, found none"),
        ("predict m empty", "empty: expected images (.png"),
        ("predict m r/a/0.png --template {label}/*.png",
         "--template: expected a folder or a file of arrays, found r/a/0.png"),
        ("predict n r --reject", "--reject: expected a model of classes, found HDCRegressor"),
        ("evaluate r m", "expected a saved model, found what is not a regular file"),
        ("recalibrate m other -o out",
         "other: expected classes among a, b, c, found 'x' (to add a class: hdc train "),
        # An image of the recording and a device were replaced.
        ("train r -o r/a/0.png", "expected a saved model or no file"),
        ("recalibrate m r -o /dev/null", "expected a regular file or none"),
    ):  # fmt: skip
        status, out, (line,) = hdc(*shlex.split(typed))
        assert (status, out) == (1, []), typed
        assert line.startswith("error: ")
        assert message in line
    assert contents() == before


def test_a_wrong_command_line_is_one_line_and_2(hdc):
    for typed, message in (
        ("trian", "Did you mean 'train'?"),
        ("train x", "Missing option '-o'"),
        ("train x -o m --test-fraction 1", "'--test-fraction': 1.0 is not in"),
        ("train x -o m --choose", "--choose: this option left; hdc compare shows the options of"),
        ("train x -o m --circular 360",
         "--circular: this option left; learn cosine and sine as two"),
        ("evaluate --choose", "No such option"),
        ("train x -o m --set thresholds=15",
         "expected PART__NAME=VALUE such as encoder__thresholds=15, found thresholds=15"),
    ):  # fmt: skip
        status, out, (line,) = hdc(*typed.split())
        assert (status, out) == (2, [])
        assert line.startswith("error: ")
        assert message in line
    for typed in ("", "train", "predict", "evaluate", "recalibrate", "info"):
        status, out, err = hdc(*typed.split(), "--help")
        assert (status, err, out[0][:10]) == (0, [], "Usage: hdc")


@pytest.mark.parametrize(
    ("name", "typed", "extra"),
    [
        ("click", "--help", "command"),
        ("nicegui", "live --folder r", "live"),
        ("sklearn", "compare r", "compare"),
        ("av", "train x.mp4 -o m", "files"),
        ("tifffile", "train x.tif -o m", "readers"),
    ],
)
def test_a_missing_package_names_its_extra(frames, write, name, typed, extra):
    code = f"import sys; sys.modules[{name!r}] = None\nfrom hdc.command import main; main()"
    write("r", frames)
    for file in ("x.mp4", "x.tif"):
        Path(file).touch()
    command = [sys.executable, "-c", code, *typed.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    said = f"error: expected the package {name}, found none; pip install 'speckle-hdc[{extra}]'\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", said)


def test_no_code_of_a_name_reaches_the_terminal(hdc, tmp_path):
    odd = tmp_path / "a\x1b[31m\u202eb"
    status, _, (line,) = hdc("train", odd, "-o", "m")
    assert (status, line.isprintable()) == (1, True)
    assert r"a\x1b[31m\u202eb" in line
    frames, names = np.eye(12, dtype="u1").reshape(12, 3, 4), ["\x1b[2J", "b"] * 6
    odd.mkdir()
    model, array = odd / "m", odd / "x\x1b[0m.npz"
    np.savez(array, frames=frames, labels=names)
    for words in (
        ("look", odd),
        ("look", array),
        ("train", array, "-o", model),
        ("evaluate", model, array),
        ("recalibrate", model, array, "-o", model),
        ("export", model, "-o", odd / "m.h"),
        ("sample", odd),
    ):
        status, out, err = hdc(*words)
        assert (status, bool(out)) == (0, True), words
        assert all(line.isprintable() for line in [*out, *err]), words


def test_a_file_that_cannot_be_written_is_the_one_that_was_asked_for(
    hdc, folder, model, monkeypatch
):
    """It was a temporary one."""

    def fail(*_):
        raise OSError(30, "Read-only file system", "a temporary file")

    kept = model.read_bytes()
    monkeypatch.setattr(os, "replace", fail)
    status, _, lines = hdc("train", folder, "-o", model)
    assert (status, lines) == (
        1,
        [f"error: [Errno 30] Read-only file system: '{model}'"],
    )
    assert model.read_bytes() == kept


def test_a_full_disk_is_a_short_line(hdc, tmp_path, monkeypatch):
    """Of a sample all files were listed, in 6 kB."""

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    status, _, (line,) = hdc("sample", tmp_path / "s")
    assert status == 1
    full_disk = "error: [Errno 28] No space left on device"
    assert line.startswith(f"{full_disk}: '{tmp_path}/s/touches/")


@pytest.fixture
def instead(capsys, monkeypatch):
    """instead(run) → exit status and lines of errors of a command that does this."""

    def ended(run):
        monkeypatch.setattr(command, "_run", run)
        with pytest.raises(SystemExit) as caught:
            command.main([])
        return caught.value.code, capsys.readouterr().err.splitlines()

    return ended


def test_a_memory_that_is_too_small_is_one_line(instead):
    def fill(_):
        raise MemoryError("Unable to allocate 9 GiB")

    status, (line,) = instead(fill)
    assert status == 1
    assert line.startswith("error: expected more memory: Unable to allocate 9")


def test_a_warning_is_said_once_whatever_its_share(instead):
    """A comparison trains the same model fold after fold, and each has its share of ties."""

    def warn(_):
        for text in (
            "80 % are tied",
            "81 % are tied",
            "left out day1",
            "left out day2",
        ):
            warnings.warn(text, stacklevel=2)
        return 0

    said = ["80 % are tied", "left out day1", "left out day2"]
    assert instead(warn) == (0, [f"warning: {text}" for text in said])
