"""Changed code is adopted where it computes the same, and only there."""

import pytest
from omegaconf import OmegaConf
from rich.console import Console

from experiments import prove
from experiments.records import record
from experiments.records.results import Results

QUIET = Console(quiet=True)


@pytest.fixture
def made(results, carry_out):
    """A folder with a run of HDC by code of another digest in this file; rename(path) names it."""
    entry = carry_out("model=hdc")

    def rename(path):
        text = (results / "code.json").read_text()
        known = entry.environment.sources[path]
        (results / "code.json").write_text(text.replace(f'"{known}"', '"000000000000"'))
        return Results(results).runs[0]

    return results, rename


def read(folder):
    (run,) = Results(folder).runs
    return run


@pytest.mark.parametrize(
    ("path", "timed_again"), [("hdc/classifier.py", False), ("scenes/recorded.py", True)]
)
def test_code_that_computes_the_same_is_adopted(made, path, timed_again):
    """A renamed variable changes a digest; times stay those of the code that was timed."""
    folder, rename = made
    before = rename(path)
    assert before.outdated == [path]
    assert prove.prove(folder, QUIET) == 0
    after = read(folder)
    assert after.outdated == []
    assert after.record.proven["made_by_code"] == before.record.environment.code
    assert after.record.training_s == before.record.training_s
    kept = None if timed_again else before.record.environment.code
    assert after.record.times_by == kept


def test_a_changed_prediction_is_not_adopted(made, monkeypatch):
    folder, rename = made
    rename("hdc/classifier.py")
    differing = prove.train_and_test

    def wrong(*arguments):
        differing(*arguments)
        arguments[4]["predicted"] = (arguments[4]["predicted"] + 1) % 2

    monkeypatch.setattr(prove, "train_and_test", wrong)
    before = (folder / record.RUNS).read_bytes()
    assert prove.prove(folder, QUIET) == 1
    assert (folder / record.RUNS).read_bytes() == before
    assert OmegaConf.create(read(folder).record.config).model._target_ == "hdc.HDCClassifier"
