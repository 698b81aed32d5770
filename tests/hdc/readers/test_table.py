"""Tables that people write, and what their columns mean."""

import numpy as np
import pytest

from hdc.readers import open_recording
from hdc.readers.about import Columns, typed
from hdc.readers.table import columns_in, read_csv
from hdc.readers.vectors import unlike
from tests.hdc.readers.writers import said


@pytest.mark.parametrize(
    ("text", "encoding", "expected"),
    [
        # With a mark of UTF-8, spaces, empty lines, and commas and line feeds in quotes.
        ('\ufeffx , y\r\na.png, 1 \r\n\r\n"b,\r\nc.png",2\r\nd.png,""\r\n', "utf-8",
         ["2: a.png | 1", "5: b,\r\nc.png | 2", "6: d.png | "]),
        ("x;y\na,b;-1,5\n", "utf-16", ["2: a,b | -1.5"]),
        ("x\ty\n 2,5e3 \t1,2,3\n", "utf-8", ["2: 2.5e3 | 1,2,3"]),
        ("sep=;\nx;y\n1,5;b\n", "utf-8", ["3: 1.5 | b"]),
        ("x;y\n1,5;b\n", "utf-16-le", ["2: 1.5 | b"]),
        ("x;y\n1.000;a\n2.500;a\n", "utf-8", ["2: 1.000 | a", "3: 2.500 | a"]),
        # A column of 1.000,5 was not learnt, and 1.000 was read as 1.
        ("x;y\n1.000,5;a\n2,5;a\n", "utf-8", "2: expected 1000 or 1,0, found '1.000,5'"),
        ("x;y\n2,5;a\n1.000;a\n", "utf-8", "3: expected 1000 or 1,0, found '1.000'"),
        ("x,y\n\xff,1\n", "latin1", "expected a CSV table in UTF-8"),
        ('x,y\n"a,1\n', "utf-8", "expected a CSV table in UTF-8"),
    ],
)  # fmt: skip
def test_tables_are_read_as_programs_and_spreadsheets_write_them(
    tmp_path, text, encoding, expected
):
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode(encoding))
    if isinstance(expected, str):
        with pytest.raises(ValueError, match=rf"t\.csv.*{expected}"):
            read_csv(path, ["x"])
        return
    found = [
        f"{place}: {row['x']} | {row['y']}" for place, row in read_csv(path, ["x"])
    ]
    assert found == [f"{path}, line {row}" for row in expected]
    assert columns_in(path) == ["x", "y"]


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        ("1 -2 +3", "[1, -2, 3]"),
        ("1 2.5 1e3", "[1.0, 2.5, 1000.0]"),
        # More than 64 bits hold: as floats, different ones would be one class.
        ("7 100000000000000000000", "['7', '100000000000000000000']"),
        ("1 1_0", "['1', '1_0']"),  # which was session 10
        ("1 nan", "['1', 'nan']"),
    ],
)
def test_cells_are_integers_or_else_numbers_or_else_text(texts, expected):
    assert repr(typed(texts.split()).tolist()) == expected


def test_beside_labels_a_column_of_numbers_has_no_other_cell():
    rows = [("row 0", {"label": "a", "x": "1", "note": "3"})]
    rows += [("row 1", {"label": "b", "x": "2", "note": "again"})]
    columns = Columns.of_rows("t.csv", rows)
    assert columns.numeric() == ["x"]
    assert columns.about((), 2).value_names == ("x",)
    with pytest.raises(
        ValueError, match=r"row 1: expected a number in note, .*--column"
    ):
        columns.about(("note",), 2)


@pytest.mark.parametrize(
    ("texts", "learnt"),
    [
        ("1 2", ["depth"]),
        ("a 1b -", []),
        ("1 a b", "row 1: expected a number in depth, found 'a'"),
        # The column was left out, without a word.
        *((f"1 2 {gap}", "row 2: expected a number in depth") for gap in
          ("nan", "NA", "inf", "1_0", "1,5", "?", "٣")),
    ],
)  # fmt: skip
def test_a_column_with_a_number_is_one_of_numbers(texts, learnt):
    rows = [(f"row {i}", {"depth": cell}) for i, cell in enumerate(texts.split())]
    columns = Columns.of_rows("t.csv", rows)
    if isinstance(learnt, list):
        assert columns.numeric() == learnt
        return
    with pytest.raises(ValueError, match=learnt):
        columns.values(columns.numeric())


@pytest.mark.parametrize("name", ["", "Unnamed: 0"])
def test_a_column_that_nobody_named_is_not_learnt(folder, name):
    """The index that pandas writes told the classes of a sorted table apart."""
    (folder / "t.csv").write_text(f"{name},image,x\n0,a/1.png,5\n1,a/2.png,6\n")
    recording = open_recording(folder, table="t.csv")
    assert recording.value_names == ("x",)


# Vectors -----------------------------------------------------------------------------------------

RNG = np.random.default_rng(0)
SPECTRUM = [f"{k}nm" for k in range(400, 412)]
CHANNELS = [f"ch{k}" for k in range(12)]


def test_a_table_of_vectors_is_a_recording(tmp_path):
    path = tmp_path / "v.csv"
    path.write_text("400,401,order,force\n1,2,7,0.5\n3,4,6,1.5\n")
    found = open_recording(path, value_columns=["force"])
    assert found[:].tolist() == [[1, 2], [3, 4]]
    assert said(found, "order force") == ["7 0.5", "6 1.5"]
    assert found.place(1) == f"{path}, line 3"
    assert (found.features, found.notes) == (("400", "401"), ())
    bare = open_recording(path, value_columns=["z"], fewest_classes=0, subsample=2)
    assert (bare.labels, bare.values) == (None, None)
    assert bare[1].tolist() == [3, 1.5]
    for names in ("400,401,402", "402,401.5,-1"):  # in order, such as wavelengths
        path.write_text(f"{names}\n3,1,2\n4,5,6\n")
        assert len(open_recording(path, fewest_classes=0)) == 2
    path.write_text(",".join([*SPECTRUM, "force"]) + "\n" + ",".join("3" * 13))
    (note,) = open_recording(path, fewest_classes=0).notes
    assert note.startswith("force: a pixel unlike the others, --column learns a number")


@pytest.mark.parametrize(
    ("rows", "settings", "message"),
    [
        ("400,z\n1,2", {}, ": expected a label of each frame, or numbers to learn"),
        ("400,401\n1,2", {"value_columns": ["z"]}, ": expected different columns, z, found"),
        ("label,order\na,1\nb,2", {}, ": expected columns of numbers, found"),
        # Its first frame was lost.
        ("3,1,2\n4,5,6", {"fewest_classes": 0}, ": expected a name of each column .* '3, 1, 2'"),
        (",label,400\n0,a,1\n1,b,2", {}, r": .* found '' \(pandas"),
    ],
)  # fmt: skip
def test_a_table_of_vectors_that_cannot_be_used_is_named(
    tmp_path, rows, settings, message
):
    (tmp_path / "v.csv").write_text(rows)
    with pytest.raises(ValueError, match=rf"v\.csv{message}"):
        open_recording(tmp_path / "v.csv", **settings)


@pytest.mark.parametrize(
    ("names", "numbers", "odd"),
    [
        (["position", *SPECTRUM[:5], "trial", *SPECTRUM[5:]], 1, "position, trial"),
        # By its range; a spectrum that rises and falls is none.
        (CHANNELS, [1] * 5 + [100] + [1] * 6, "ch5"),
        (CHANNELS, [1] * 5 + [0.01] + [1] * 6, "ch5"),
        (CHANNELS, 4.0 ** -np.abs(np.arange(12) - 6), ""),
        ([*"abcdefghi"], 1, ""),
        (["400nm", "401nm", "force"], 1, ""),  # too few to say
    ],
)  # fmt: skip
def test_a_pixel_unlike_its_neighbours_is_named(names, numbers, odd):
    """A force was learnt as a pixel, and a position leaked: 100 %."""
    vectors = RNG.uniform(0.5, 1, (6, len(names))) * numbers
    assert ", ".join(unlike(names, vectors)) == odd


def test_a_column_is_the_session_or_the_group_that_is_asked_for(tmp_path):
    """Of a table of vectors it is no pixel then."""
    rows = "label,run,p1,object,p2\na,r10,1,x,2\nb,r2,3,y,4\na,r2,5,x,6"
    (tmp_path / "t.csv").write_text(rows)
    found = open_recording(tmp_path / "t.csv", sessions="run", groups="object")
    expected = ["1 r10 0", "0 r2 1", "0 r2 0"]
    assert said(found, "session session_name group") == expected
    assert found[:].tolist() == [[1, 2], [3, 4], [5, 6]]
    (tmp_path / "t.csv").write_text("label,p1\na,1\nb,3")
    with pytest.raises(ValueError, match=r"groups: expected one of label \(.*, found"):
        open_recording(tmp_path / "t.csv", groups="nothing")
