"""The campaign: damages do what they say, every file withstands them, and all is counted."""

from __future__ import annotations

import json

import numpy as np
import pytest

from experiments import fuzz, fuzz_table, measurement, record
from experiments.fuzz import kinds
from experiments.fuzz_bombs import bombs
from experiments.fuzz_damage import DAMAGES, field_of
from experiments.isolate import Outcome

KINDS = {f"{kind.group}: {kind.variant}": k for k, kind in enumerate(kinds())}


def case(k, damage, number=0, folder="."):
    return fuzz.Case(k, damage, 1, number, str(folder))


@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_is_named_or_read(name, tmp_path):
    """RuntimeErrors, of files that are not named, and whatever else is raised go through."""
    k = KINDS[name]
    for damage in (*DAMAGES, *([fuzz.FIELD] if kinds()[k].replace else [])):
        try:
            assert fuzz.read_case(case(k, damage, folder=tmp_path)) in fuzz.RESULTS
        except ValueError as error:
            assert "expected" in str(error)  # noqa: PT017


@pytest.mark.parametrize("name", KINDS)
def test_a_sound_file_is_read_as_what_it_is(name, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "DAMAGES", {"none": lambda data, rng: data})
    assert fuzz.read_case(case(KINDS[name], "none", folder=tmp_path)) == "correct"


BOMBS = {bomb.name: k for k, bomb in enumerate(bombs())}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("60,000 × 60,000", r"at most 16777216 pixels .*, found 60000 × 60000"),
        ("one row of 4096", "found one that does not decode"),
        ("a thousand scans", "at most 64 scans, found 1006"),
        ("two million frames", "at most 1048576 frames, found 2097152"),
        ("a list of 100,000 levels", "record.json: expected a record in JSON"),
    ],
)
def test_what_asks_for_much_is_refused(name, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        fuzz.read_case(case(BOMBS[name], fuzz.BOMB, folder=tmp_path))


def test_an_error_that_names_no_file_is_none_of_the_named_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "_read", lambda *_: int("x"))
    with pytest.raises(RuntimeError, match="names no file: invalid literal"):
        fuzz.read_case(case(0, "flip", folder=tmp_path))


def test_a_result_that_differs_when_read_again_is_unstable(tmp_path, monkeypatch):
    kind = kinds()[0]
    monkeypatch.setattr(fuzz, "kinds", lambda: [fuzz.Kind("g", "v", "m", kind.make, _changing())])
    assert fuzz.read_case(case(0, "flip", folder=tmp_path)) == "unstable"


def _changing():
    seen = []
    return lambda folder: str(seen.append(folder) or len(seen))


def test_cases_are_made_from_their_numbers_alone():
    kind = kinds()[KINDS["bmp: grey"]]
    made = [fuzz.damaged(kind, damage, 1, n) for damage in DAMAGES for n in range(20)]
    assert made == [fuzz.damaged(kind, damage, 1, n) for damage in DAMAGES for n in range(20)]
    assert made != [fuzz.damaged(kind, damage, 2, n) for damage in DAMAGES for n in range(20)]
    assert len({*made}) > 80


@pytest.mark.parametrize("damage", DAMAGES)
def test_damages_do_what_they_say(damage):
    data = bytes(range(128, 256)) * 6
    rng = np.random.default_rng(0)
    made = [DAMAGES[damage](data, rng) for _ in range(50)]
    assert all(m != data for m in made)
    differ = [sum(a != b for a, b in zip(m, data, strict=False)) for m in made]
    if damage == "truncate":
        assert all(data.startswith(m) for m in made)
    elif damage == "splice":
        assert {len(m) < len(data) for m in made} == {len(m) > len(data) for m in made}
    else:
        assert all(len(data) <= len(m) <= len(data) + 20 * (damage == "large") for m in made)
        assert max(differ) <= {"flip": 8, "zero": 64, "large": 8}[damage]


def test_one_field_is_replaced_or_gone():
    tree = {"a": [1, {"b": 2}], "c": "d"}
    made = [field_of(tree, np.random.default_rng(n)) for n in range(300)]
    assert tree == {"a": [1, {"b": 2}], "c": "d"}
    assert {"c": "d"} in made
    assert {"a": [1, {"b": 2}]} in made
    assert {"a": [1, {"b": None}], "c": "d"} in made


def test_rows_count_every_end():
    named = Outcome("error", error="BadFrame", message="x", seconds=1.0, peak_bytes=5)
    ended = [
        named, named, Outcome("value", "correct"), Outcome("value", "changed"),
        Outcome("value", "unstable"), Outcome("error", error="KeyError", message="'x'"),
        Outcome("crash", error="SIGSEGV"), Outcome("hang", error="nothing in 1 s", seconds=9.0),
    ]  # fmt: skip
    row = fuzz.row("g", "v", "flip", ended)
    assert row == {
        "kind": "g", "variant": "v", "damage": "flip", "cases": 8, "named_errors": 2, "correct": 1,
        "changed": 1, "unnamed_errors": 1, "unstable": 1, "crashes": 1, "hangs": 1,
        "slowest_s": 9.0, "peak_bytes": 5,
        "first_failures": "4: unstable; 5: KeyError 'x'; 6: SIGSEGV",
    }  # fmt: skip


def test_the_campaign_and_its_table(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    assert fuzz_table.table(tmp_path) == []
    campaign = fuzz.campaign
    monkeypatch.setattr(fuzz, "campaign", lambda *given: campaign(*given, groups=["model"]))
    monkeypatch.setattr(fuzz, "DAMAGES", {"flip": DAMAGES["flip"]})
    fuzz.run(cases=2, seed=0, limit_s=20, limit_bytes=1e9)
    found = measurement.read(tmp_path, "fuzz")
    assert [row["damage"] for row in found.rows] == ["flip", fuzz.FIELD]
    assert all(row["cases"] == "2" and row["crashes"] == "0" for row in found.rows)
    sources = found.record["environment"]["sources"]
    assert {"scenes/recorded/header.py", "hdc/files.py", "experiments/schema.py"} <= set(sources)
    paths = fuzz_table.table(tmp_path)
    assert [path.name for path in paths] == ["fuzz.csv", "fuzz.md"]
    assert paths[0].read_text().splitlines()[-1].startswith("all,4,")
    text = paths[1].read_text()
    assert "| model | 4 |" in text
    assert f"{fuzz_table.hypothesis_examples()} files" in text


def test_the_table_adds_up():
    rows = [
        {"kind": kind, "damage": damage, **dict.fromkeys(fuzz_table._COUNTS, "2"),
         "slowest_s": seconds, "peak_bytes": "200000000"}
        for kind, damage, seconds in (
            ("png", "flip", "0.5"), ("png", "zero", "0.7"), ("png", "bomb", "3"),
        )
    ]  # fmt: skip
    made = fuzz_table.summary(rows)
    assert [row["kind"] for row in made] == ["png", "asking for much", "all"]
    assert [row["cases"] for row in made] == [4, 2, 6]
    assert [row["slowest_s"] for row in made] == [0.7, 3.0, 3.0]
    assert made[0]["peak_mb"] == 200


def test_examples_are_counted_where_they_are_asked_for(tmp_path):
    (tmp_path / "test_x.py").write_text("@settings(max_examples=7)\ndef f(): g(max_examples=5)\n")
    assert fuzz_table.hypothesis_examples(tmp_path) == 12
    assert fuzz_table.hypothesis_examples() > 500


def test_a_measurement_that_is_none_is_named(tmp_path):
    record.write_atomically(tmp_path / "measured/fuzz/record.json", json.dumps({"schema": 2}))
    with pytest.raises(ValueError, match=r"measured/fuzz/record\.json"):
        fuzz_table.table(tmp_path)
