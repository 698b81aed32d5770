"""From Python: two models compared by groups, and a search. Docs run the rest of it
(tests/docs/test_python.py)."""

import math

import numpy as np
import pytest
from omegaconf import OmegaConf

import experiments
from experiments import run
from tests.experiments.composed import tree


def test_groups_are_units_where_they_are_known(write_run, tmp_path):
    write_run("hdc", wrong=range(3))
    write_run("softmax", wrong=range(1, 9))
    with (tmp_path / "records.jsonl").open("a") as file:
        file.write("no record\n")
    with pytest.warns(UserWarning, match="line 3"):
        lines = experiments.results(tmp_path)
    hdc, softmax = (lines[lines.model == name] for name in ("hdc", "softmax"))
    gained = np.zeros(100)
    gained[0], gained[3:9] = -1, 1  # only one of the two has them right
    groups = np.arange(100) % 4
    means = [gained[groups == g].mean() for g in range(4)]
    found = experiments.compare(hdc, softmax, groups)
    half = 3.182446 * np.std(means, ddof=1) / 2  # of Student, three degrees of freedom
    assert found == pytest.approx(
        (np.mean(means), np.mean(means) - half, np.mean(means) + half)
    )
    assert math.isnan(experiments.compare(hdc, softmax).low)  # one seed
    with pytest.raises(ValueError, match=r"groups: expected .* found 3"):
        experiments.compare(hdc, softmax, [1, 2, 3])
    other = softmax.assign(test_set="another")
    with pytest.raises(ValueError, match="expected seeds and test frames in common"):
        experiments.compare(hdc, other)


def test_a_search_leaves_whole_groups_out(carry_out, tmp_path, frames_and_labels):
    frames, labels = frames_and_labels(60, 3)
    days = np.arange(60) // 6
    np.savez(tmp_path / "days.npz", frames=frames, labels=labels, day=days)
    grouped = ("split.kind=grouped", "split.group=day", "split.test_fraction=0.2")
    record = carry_out("experiment=validation", *grouped, scene=tmp_path / "days.npz")
    rows = record.rows.dicts()
    assert {row["folds"] for row in rows} == {"by group"}
    # Eight days of six frames train, in five folds.
    assert sorted(row["n_validation"] for row in rows) == [6, 6, 12, 12, 12]


def test_a_sweeper_gets_the_accuracy_inside_the_training_frames(
    recording, results, monkeypatch
):
    words = ["experiment=validation", "scene=recorded", f"scene.path={recording()}"]
    words += ["exclusive=false", "threads=1", "task.folds=2"]
    record = run.run(*words)
    rows = record.rows.dicts()
    frames = rows[0]["n_train"] + rows[0]["n_validation"]
    assert frames == run.run(*words[1:-1]).results["n_train"]
    cfg = tree(*words, with_hydra=True)
    monkeypatch.setattr(run.HydraConfig, "get", lambda: cfg.hydra)
    own = OmegaConf.masked_copy(cfg, [key for key in cfg if key != "hydra"])
    found = run.CommandLine().carry_out(own)
    assert found == sum(row["validation_accuracy"] for row in rows) / 2
