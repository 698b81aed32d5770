"""Parquet files with a column of encoded images."""

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from hdc.readers import open_recording
from tests.hdc.readers.writers import FRAMES, NAMES, check

CELLS = [cv2.imencode(".png", frame)[1].tobytes() for frame in FRAMES]
STRUCTS = [{"bytes": cell, "path": None} for cell in CELLS]
TABLE = {"image": CELLS, "label": NAMES, "force": [0.5, 1, 2, 4]}
HUGGING = (
    '{"info": {"features": {"label": {"names": ["a", "bb"], "_type": "ClassLabel"}}}}'
)
CATEGORIES = pa.array(NAMES, pa.dictionary(pa.int8(), pa.string()))


@pytest.mark.parametrize(
    ("columns", "stated", "settings"),
    [
        (TABLE, "", {}),
        ({**TABLE, "image": STRUCTS}, "", {}),
        ({"rgb": CELLS, "kind": NAMES}, "", {"labels": "kind"}),
        ({**TABLE, "rgb": CELLS[::-1]}, "", {}),
        ({"image": CELLS, "label": CATEGORIES}, "", {}),
        ({"image": CELLS, "label": [0, 1, 0, 1]}, HUGGING, {}),
        (TABLE, "{}", {}),
        (TABLE, "no JSON", {}),
        (TABLE, '{"info": {"features": null}}', {}),
        (TABLE, "[]", {}),
    ],
)
def test_images_and_labels_are_those_that_were_written(
    tmp_path, columns, stated, settings
):
    table = pa.table(columns).replace_schema_metadata({"huggingface": stated})
    pq.write_table(table, tmp_path / "x.parquet", row_group_size=3)
    check(open_recording(tmp_path / "x.parquet", **settings))


def test_numbers_are_values_where_there_are_no_labels_or_they_are_named(tmp_path):
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table(TABLE), path)
    named = open_recording(path, value_columns=["force"])
    assert named.values[:, 0].tolist() == [0.5, 1, 2, 4]
    pq.write_table(pa.table(TABLE).drop_columns("label"), path)
    assert open_recording(path).value_names == ("force",)
    pq.write_table(pa.table({"image": CELLS}), path)
    assert np.array_equal(open_recording(path, fewest_classes=0)[:], FRAMES)


BARE = cv2.imencode(".png", FRAMES[0].T)[1].tobytes()


@pytest.mark.parametrize(
    ("columns", "settings", "message"),
    [
        (TABLE, {"labels": "y"}, "labels: .*expected one of label, force, found 'y'"),
        ({"rgb": CELLS, "label": NAMES}, {"image_column": "depth"}, "one of rgb, found"),
        ({"label": NAMES}, {}, "expected a column of encoded images, found label"),
        ({**TABLE, "label": ["a", "b", None, "a"]}, {}, "label .* found none of frame 2"),
        ({"image": pa.array([], pa.binary())}, {}, "expected a row per frame, found none"),
        ({**TABLE, "image": [*CELLS[:3], None]}, {}, "row 3: expected an image, found none"),
        ({**TABLE, "image": [*CELLS[:3], BARE]}, {}, "row 3: expected 5 × 3"),
    ],
)  # fmt: skip
def test_a_parquet_that_cannot_be_used_is_named(tmp_path, columns, settings, message):
    pq.write_table(pa.table(columns), tmp_path / "x.parquet")
    with pytest.raises(ValueError, match=message) as caught:
        open_recording(tmp_path / "x.parquet", **settings)[:]
    assert "x.parquet" in str(caught.value) or "image_column" in str(caught.value)


def test_a_damaged_parquet_is_named(tmp_path):
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table(TABLE), path, compression="gzip")
    whole, said = path.read_bytes(), []
    for place in range(4, len(whole) - 8, 37):
        damaged = bytearray(whole)
        damaged[place : place + 4] = b"\xff" * 4
        path.write_bytes(damaged)
        try:
            open_recording(path)[:]
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 10
    assert all("x.parquet" in text for text in said)
