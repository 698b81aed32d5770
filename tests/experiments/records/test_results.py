"""What may stand in one row, and that every run is seen somewhere."""

import numpy as np
import pytest

from experiments.records import configs
from experiments.records.groups import Groups
from experiments.records.results import Results
from experiments.reporting.rows import runs_table

OTHER = {"experiments": 0, "hdc.HDCClassifier": 1}  # of an earlier protocol


def rows(found):
    """What groups there are, by name, with the seeds of their runs."""
    return {
        (g.scene, g.model, g.n_train, g.pixels): [run.seed for run in g.runs]
        for g in Groups(found.runs)
    }


def test_runs_of_one_config_and_code_stand_in_one_row_by_seed(tmp_path, write_run):
    for seed in (2, 0, 1):
        write_run("hdc", seed=seed, wrong=range(seed))
    found = Results(tmp_path)
    assert rows(found) == {("touch", "hdc", None, None): [0, 1, 2]}
    group = Groups(found.runs).group("touch", "hdc")
    assert group.status == "ok"
    assert group.right.tolist().count(False) == 3
    assert np.trace(group.confusion()) == 297
    assert group.others == 0


def test_runs_of_other_revisions_are_not_averaged_and_todays_come_first(
    tmp_path, write_run
):
    write_run("hdc", seed=0)
    for seed in (1, 2, 3):
        write_run("hdc", seed=seed, made_by=OTHER)
    group = Groups(Results(tmp_path).runs).group("touch", "hdc")
    assert [run.seed for run in group.runs] == [0]
    assert group.runs[0].outdated == []
    assert group.status == "3 more left out: of other code or settings"


def test_the_stopping_rule_of_the_paper_comes_first_then_the_larger_group(
    tmp_path, write_run
):
    for seed in range(3):
        write_run(
            "softmax", seed=seed, stop="quick", curve=[{"training_s": 1.0, "loss": 1.0}]
        )
    write_run("softmax", stop="paper", curve=[{"training_s": 1.0, "loss": 1.0}])
    group = Groups(Results(tmp_path).runs).group("touch", "softmax")
    assert [run.choices.stop for run in group.runs] == ["paper"]
    assert group.others == 3


@pytest.mark.parametrize(
    ("first", "others"),
    [  # timed alone; by the code of today
        ({"stop": "quick"}, {"environment": {"exclusive": False}}),
        ({"stop": "reached"}, {"made_by": OTHER}),
    ],
)
def test_a_run_timed_alone_or_of_today_comes_before_the_rule_and_before_more(
    tmp_path, write_run, first, others
):
    curve = [{"training_s": 1.0, "loss": 1.0}]
    write_run("softmax", seed=0, curve=curve, **first)
    for seed in (1, 2, 3):
        write_run("softmax", seed=seed, curve=curve, **others)
    (run,) = Groups(Results(tmp_path).runs).group("touch", "softmax").runs
    assert run.seed == 0


def test_what_learns_in_one_pass_ends_by_itself_whatever_the_rule(tmp_path, write_run):
    write_run("hdc", seed=0, stop="quick")
    write_run("hdc", seed=1, stop="paper")
    assert rows(Results(tmp_path)) == {("touch", "hdc", None, None): [0, 1]}


CHANGED = {
    "model.readout.ties": ("one", ("touch", 'hdc (readout.ties="one")')),
    "scene.sensor.seed": (9, None),  # a seed: another repetition
    "scene.samples_per_class": (20, ("touch (samples_per_class=20)", "hdc")),
    "split.kind": ("ordered", ('touch (kind="ordered")', "hdc")),
    "split.test_fraction": (0.4, ("touch (test_fraction=0.4)", "hdc")),
}


@pytest.mark.parametrize("key", CHANGED)
def test_a_run_with_another_value_has_a_row_of_its_own(tmp_path, write_run, key):
    value, name = CHANGED[key]
    write_run("hdc", seed=0)
    for seed in (1, 2):
        write_run("hdc", seed=seed, change={key: value})
    found = Results(tmp_path)
    if name is None:
        assert rows(found) == {("touch", "hdc", None, None): [0, 1, 2]}
        return
    assert rows(found) == {
        ("touch", "hdc", None, None): [0],
        (*name, None, None): [1, 2],
    }
    overrides = [row["overrides"] for row in runs_table(found).data.to_dict("records")]
    assert sorted(text.partition("=")[0] for text in overrides) == ["", key, key]


def test_another_learning_rate_or_another_end_is_no_canonical_run(tmp_path, write_run):
    curve = [{"training_s": 1.0, "loss": 1.0}]
    write_run("softmax", seed=0, curve=curve)
    for seed in range(1, 4):  # more of them, so that they would be preferred
        write_run("softmax", seed=seed, curve=curve, change={"model.lr": 0.5})
        write_run("softmax", seed=seed, curve=curve, change={"stop.budget_s": 7})
    found = Results(tmp_path)
    assert rows(found) == {
        ("touch", "softmax", None, None): [0],
        ("touch", "softmax (lr=0.5)", None, None): [1, 2, 3],
        ("touch", "softmax (budget_s=7)", None, None): [1, 2, 3],
    }
    assert len(runs_table(found).data) == 7


def test_what_is_no_record_costs_itself_only(tmp_path, write_run):
    good = write_run("hdc")
    with (tmp_path / "records.jsonl").open("a") as file:
        file.write('no\n{"schema": 4}\n')
    results = Results(tmp_path)
    assert [run.id for run in results.runs] == [good]
    assert results.measurements == []
    for name in ("records.jsonl, line 2", "records.jsonl, line 3"):
        assert sum(name in problem for problem in results.problems) == 1, name


def test_records_of_version_2_are_named_and_left_as_they_are(tmp_path, write_run):
    (tmp_path / "runs.jsonl").write_text("{}\n")
    (tmp_path / "measured").mkdir()
    write_run("hdc")
    results = Results(tmp_path)
    assert len(results.runs) == 1
    for name, problem in zip(("runs.jsonl", "measured"), results.problems, strict=True):
        assert problem.startswith(f"{tmp_path / name}: records of version 2.0, which")
    assert (tmp_path / "runs.jsonl").read_text() == "{}\n"


def test_what_was_changed_is_named_frames_first(tmp_path, write_run):
    keys = {"stop.budget_s": 7, "model.lr": 0.5, "split.kind": "ordered",
            "scene.samples_per_class": 20}  # fmt: skip
    curve = [{"training_s": 1.0, "loss": 1.0}]
    write_run("softmax", change=keys, curve=curve)
    (run,) = Results(tmp_path).runs
    assert list(run.differences) == [
        "scene.samples_per_class",
        "split.kind",
        "model.lr",
        "stop.budget_s",
    ]
    assert run.scene_label == 'touch (samples_per_class=20, kind="ordered")'
    assert run.model_label == "softmax (lr=0.5, budget_s=7)"


def test_a_model_and_a_scene_of_no_file_are_shown_as_their_records_say(
    tmp_path, write_run, monkeypatch
):
    monkeypatch.setattr(configs, "_own_displays", {})
    shown = {"display": {"name": "Mine"}, "scene_display": {"name": "My sensor"}}
    write_run("hdc", **shown)
    write_run("hdc", **shown, choices={"model": "own", "scene": "mine"})
    write_run("hdc", choices={"model": "other", "scene": "others"})
    Results(tmp_path)
    names = [configs.display(model)["name"] for model in ("hdc", "own", "other")]
    assert names == ["HDC", "Mine", "other"]
    scenes = [configs.scene_display(scene)["name"] for scene in ("mine", "others")]
    assert scenes == ["My sensor", "others"]
    assert configs.scene_display("touch")["name"] != "My sensor"


@pytest.mark.parametrize("first", [1, 2, 3])
def test_of_measurements_changed_equally_little_the_last_one_counts(
    tmp_path, write_measurement, first
):
    """As after a change of the experiment's own file: an id says nothing of the time."""
    for n in (first, 4 - first, first):
        config = {"n_test": n}  # not that of the file
        write_measurement("drift", [{"n": n}], scene="drift", config=config)
        assert Results(tmp_path).frame("drift").n.tolist() == [n]
    write_measurement("drift", [{"n": 0}], scene="drift")  # nothing was changed
    write_measurement("drift", [{"n": 1}], scene="drift", config={"n_test": 1})
    assert Results(tmp_path).frame("drift").n.tolist() == [0]


def test_runs_of_todays_files_come_before_more_of_files_as_they_were(
    tmp_path, write_run
):
    curve = [{"training_s": 1.0, "loss": 1.0}]
    for seed in range(3):
        write_run("softmax", seed=seed, curve=curve, change={"model.lr": 0.5})
    write_run("softmax", seed=7, curve=curve)
    runs = Results(tmp_path).runs
    for run in runs:  # as when the file of the model had 0.5
        run.changed = {}
    group = Groups(runs).group("touch", "softmax")
    assert [run.seed for run in group.runs] == [7]
    assert group.others == 3
