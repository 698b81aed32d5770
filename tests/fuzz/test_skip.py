"""A bad frame among many: the run stops, or goes on without it and says so wherever it is asked."""

from __future__ import annotations

import pytest
from hydra import compose, initialize_config_dir

from experiments import fuzz_files, record, run
from experiments.selection import CONFIGS
from experiments.trial import instantiate


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    frame = fuzz_files.good_frame()["a/1.png"]
    files = {f"{label}/{i}.png": frame for label in "ab" for i in range(6)}
    fuzz_files.write(files, tmp_path / "frames")
    return tmp_path / "frames"


def carry_out(folder, *overrides):
    words = [f"scene.path={folder}", "scene=recorded", "model=hdc", "exclusive=false", *overrides]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("config", overrides=words)
    return run.run(cfg, {"scene": "recorded", "model": "hdc", "stop": "paper"})


def test_a_run_stops_or_counts_and_lists_what_it_skipped(folder, capsys):
    whole = carry_out(folder, "scene.on_bad_frame=skip")
    assert whole["scene"]["skipped"] == []
    assert "skipped" not in capsys.readouterr().out
    bad = folder / "b" / "[bold]7.png"
    bad.write_bytes(b"")
    with pytest.raises(ValueError, match=r"b/\[bold\]7.png: expected an image, found an empty"):
        carry_out(folder)
    one = carry_out(folder, "scene.on_bad_frame=skip")
    assert one["scene"]["n"] == 12
    assert one["scene"]["skipped"] == [f"{bad}: expected an image, found an empty file"]
    out = capsys.readouterr().out
    assert f"1 frame skipped, listed in the record; the first: {bad}: expected" in out
    (folder / "b" / "8.png").write_bytes(b"x")
    two = carry_out(folder, "scene.on_bad_frame=skip")
    assert len(two["scene"]["skipped"]) == 2
    assert "2 frames skipped" in capsys.readouterr().out
    assert len({entry["id"] for entry in (whole, one, two)}) == 3
    again = carry_out(folder, "scene.on_bad_frame=skip")
    assert again == record.read_record(record.results_dir() / "runs" / two["id"])
    assert "2 frames skipped" in capsys.readouterr().out  # also where the run is not repeated


def test_a_damaged_record_of_a_finished_run_is_named_and_kept(folder):
    entry = carry_out(folder)
    path = record.results_dir() / "runs" / entry["id"]
    for change in ({"training_s": "soon"}, {"confusion": None}):
        record.write_record(path, {**entry, **change})
        with pytest.raises(ValueError, match=rf"{entry['id']}/record.json: .*force=true"):
            carry_out(folder)
    without = {key: value for key, value in entry.items() if key != "test_ci_low"}
    record.write_record(path, without)
    with pytest.raises(ValueError, match=rf"{entry['id']}/record.json: test_ci_low: expected"):
        carry_out(folder)


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("scene.crop=[0,0,1e3,5]", "scene.crop"),
        ("scene.crop={x:1}", "scene.crop"),
        ("scene.on_bad_frame=yes", "scene.on_bad_frame"),
        ("scene.max_pixels=inf", "scene.max_pixels"),
        ("scene.path=[1,2]", "scene.path"),
        ("scene.intervals=true", "scene.intervals"),
        ("scene.threads=nan", "scene.threads"),
    ],
)
def test_config_values_of_the_wrong_kind_name_their_key(folder, override, key):
    words = ["scene=recorded", f"scene.path={folder}", override]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("config", overrides=words)
    with pytest.raises(ValueError, match=rf"^{key}: expected .* found"):
        instantiate(cfg.scene, "scene")
