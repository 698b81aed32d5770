"""Which files make a record, and what changes their digest."""

from __future__ import annotations

import pytest

from experiments.records import sources

HDC = {"model": {"_target_": "hdc.HDCClassifier"}}
CNN = {"model": {"_target_": "baselines.cnn.CNN"}}


def test_a_run_is_made_by_what_it_imports_and_by_the_trial():
    files = sources.sources(HDC)
    assert {
        "hdc/bits.py",
        "hdc/encode.py",
        "experiments/protocol/trial.py",
        "experiments/protocol/clock.py",
    } <= set(files)
    assert not any(name.startswith("baselines/") for name in files)
    assert {
        "experiments/run.py",
        "experiments/reporting/rows.py",
        "hdc/io.py",
    }.isdisjoint(files)
    drift = sources.sources({"_target_": "experiments.studies.drift.measure.drift"})
    assert "experiments/studies/drift/measure.py" in drift
    assert {
        "experiments/records/measurement.py",
        "experiments/records/record.py",
    }.isdisjoint(drift)
    assert "baselines/training.py" in sources.sources(CNN)
    # What a package offers counts where it is asked for, what a type checker reads nowhere.
    assert "hdc/classifier.py" in set(files) - set(sources.sources(CNN))


# Digests ------------------------------------------------------------------------------------------

WRITTEN = '"""Words."""\nfrom hdc.bits import a\ndef f(x):\n    """More."""\n    return x + 1\n'


@pytest.mark.parametrize(
    ("text", "same"),
    [
        (
            '"""Other."""\n\nfrom hdc.bits import a\ndef f( x ):\n    return x  + 1 # why\n',
            True,
        ),
        (
            "from hdc.packed import a\ndef f(x):\n    return x + 1\n",
            True,
        ),  # has its own digest
        ("from hdc.bits import b\ndef f(x):\n    return x + 1\n", False),
        ("from numpy import a\ndef f(x):\n    return x + 1\n", False),
        ("from hdc.bits import a\ndef f(x):\n    return x + 2\n", False),
        ("from hdc.bits import a\ndef f(y):\n    return y + 1\n", False),
    ],
)
def test_what_computes_the_same_has_the_same_digest(tmp_path, text, same):
    (tmp_path / "a.py").write_text(WRITTEN)
    (tmp_path / "moved").mkdir()
    (tmp_path / "moved" / "b.py").write_text(text)
    first, second = (sources.digest(tmp_path / name) for name in ("a.py", "moved/b.py"))
    assert (first == second) == same


def test_outdated_files():
    now = sources.sources(HDC)
    assert sources.outdated(now, HDC) == []
    old = {**now, "hdc/bits.py": "0" * 12, "hdc/gone.py": "1" * 12}
    assert sources.outdated(old, HDC) == ["hdc/bits.py", "hdc/gone.py"]
    assert (
        sources.outdated({**sources.sources(CNN), "hdc/classifier.py": "0" * 12}, CNN)
        == []
    )
    assert sources.outdated(sources.sources(CNN), HDC)  # code that took no part in it
    study = "experiments/studies/drift/measure.py"
    assert study in sources.outdated({**now, study: "0" * 12}, HDC)
    assert sources.code_hash(now) != sources.code_hash(old)
    moved = {f"hdc/moved/{k}": digest for k, digest in enumerate(now.values())}
    assert sources.outdated(moved, HDC) == []
    assert sources.code_hash(moved) == sources.code_hash(now)
