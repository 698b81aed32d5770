"""From Python: a run, a data frame with unpacked answers, two models compared, a search."""

import math

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

import experiments
from experiments import run
from experiments.records.configs import CONFIGS


def test_results_have_unpacked_answers_and_name_what_they_cannot_use(
    write_run, tmp_path
):
    write_run("hdc", wrong=range(5))
    with (tmp_path / "records.jsonl").open("a") as file:
        file.write("no record\n")
    with pytest.warns(UserWarning, match="line 2"):
        lines = experiments.results(tmp_path)
    (line,) = lines.to_dict("records")
    assert (line["model"], line["seed.run"]) == ("hdc", 0)
    assert np.flatnonzero(line["labels"] != line["predicted"]).tolist() == [*range(5)]


@pytest.fixture
def two(write_run, tmp_path):
    """Lines of HDC and of a softmax, of three seeds each."""
    for seed, (wrong, of_softmax) in enumerate(((3, 9), (5, 7), (4, 10))):
        write_run("hdc", seed=seed, wrong=range(wrong))
        write_run("softmax", seed=seed, wrong=range(1, of_softmax))
    lines = experiments.results(tmp_path)
    return [lines[lines.model == name] for name in ("hdc", "softmax")]


def test_groups_are_units_where_they_are_known(two):
    hdc, softmax = (lines.head(1) for lines in two)
    n = len(hdc.labels.iloc[0])
    groups = np.arange(n) % 4
    gained = (hdc.predicted.iloc[0] == hdc.labels.iloc[0]).astype(float)
    gained -= softmax.predicted.iloc[0] == softmax.labels.iloc[0]
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


def test_a_sweeper_gets_the_accuracy_inside_the_training_frames(recording, monkeypatch):
    words = ["experiment=validation", "scene=recorded", f"scene.path={recording()}"]
    words += ["exclusive=false", "threads=1", "task.folds=2"]
    record = run.run(*words)
    rows = record.rows.dicts()
    frames = rows[0]["n_train"] + rows[0]["n_validation"]
    assert frames == run.run(*words[1:-1]).results["n_train"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("config", overrides=words, return_hydra_config=True)
    monkeypatch.setattr(run.HydraConfig, "get", lambda: cfg.hydra)
    own = OmegaConf.masked_copy(cfg, [key for key in cfg if key != "hydra"])
    found = run.CommandLine(words).carry_out(own)
    assert found == sum(row["validation_accuracy"] for row in rows) / 2
