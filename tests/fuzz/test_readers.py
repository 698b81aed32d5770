"""Hypothesis against every reader: whatever a file or a setting holds, an error names it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import fuzz_files
import fuzz_records
import pytest
from fuzz_damage import VALUES
from fuzz_files import write
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.records import measurement
from experiments.records.record import read_curve
from scenes.recorded import open_recording


@given(st.sampled_from([".png", ".jpg", ".bmp", ".tiff", ".npz", ".avi", ".mp4"]), st.binary())
@settings(max_examples=100, deadline=None)
def test_files_of_any_bytes(suffix, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"x{suffix}")
        mark = {".png": b"\x89PNG\r\n\x1a\n", ".jpg": b"\xff\xd8\xff", ".bmp": b"BM"}
        path.write_bytes(mark.get(suffix, b"") + data)
        write({"x.csv": b"start_s,end_s,label\n0,1,a\n1,2,b\n"}, Path(folder))
        with pytest.raises(ValueError, match="expected") as caught:
            open_recording(path if suffix in (".npz", ".avi", ".mp4") else folder)
        assert folder in str(caught.value)


@given(st.text(alphabet=st.sampled_from('training_s,"0159.e+-n\n\r\0é'), max_size=60))
@settings(max_examples=100, deadline=None)
def test_curves_and_rows_of_any_text(text):
    with tempfile.TemporaryDirectory() as folder:
        write({"curve.csv": text.encode(), "measured/m/rows.csv": text.encode()}, Path(folder))
        entry = fuzz_records.MEASURED["measured/m/record.json"]
        write({"measured/m/record.json": entry}, Path(folder))
        for read, name in (
            (lambda: read_curve(Path(folder, "curve.csv")), "curve.csv"),
            (lambda: measurement.read(Path(folder, "measured/m")).rows, "rows.csv"),
        ):
            try:
                rows = read()
            except ValueError as error:
                assert name in str(error)  # noqa: PT017
            else:
                assert all(isinstance(key, str) for row in rows for key in row)


KEYS = ["crop", "subsample", "on_bad_frame", "threads", "memory_bytes", "max_pixels", "intervals"]


@given(st.sampled_from(KEYS), VALUES)
@settings(max_examples=150, deadline=None)
def test_settings_of_any_kind(key, value):
    with tempfile.TemporaryDirectory() as folder:
        write(fuzz_files.good_frame(), Path(folder))
        write({"b/1.png": fuzz_files.good_frame()["a/1.png"]}, Path(folder))
        try:
            scene = open_recording(folder, **{key: value})
        except ValueError as error:
            assert f"scene.{key}" in str(error)  # noqa: PT017
        else:
            assert len(scene) == 2
