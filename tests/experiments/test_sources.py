"""Which files make a record, and what changes their digest."""

from __future__ import annotations

import subprocess
import sys

import pytest

from experiments import sources

HDC = {"model": {"_target_": "hdc.HDCClassifier"}}
CNN = {"model": {"_target_": "baselines.cnn.CNN"}}


def test_a_run_is_made_by_what_it_imports_and_by_the_trial():
    files = sources.sources(HDC)
    assert {"hdc/bits.py", "hdc/encode.py", "experiments/trial.py", "experiments/clock.py"} <= set(
        files
    )
    assert not any(name.startswith("baselines/") for name in files)
    assert {"experiments/run.py", "experiments/tables.py"}.isdisjoint(files)
    drift = sources.sources({"_target_": "experiments.drift.run"})
    assert "experiments/drift.py" in drift
    assert {"experiments/measurement.py", "experiments/record.py"}.isdisjoint(drift)
    assert "baselines/training.py" in sources.sources(CNN)
    assert not any(name.startswith("hdc/") for name in sources.sources(CNN))


def test_targets_are_found_anywhere_in_a_configuration():
    nested = {"scene": {"sessions": [{"_target_": "scenes.sensor.environment.Room"}]}}
    assert "scenes/sensor/environment.py" in sources.sources(nested)
    assert set(sources.sources({"a": {"_target_": "torch.nn.Linear"}})) == set(sources.sources({}))


def test_every_module_that_a_run_loads_is_among_its_sources():
    script = (
        "import sys, hdc.classifier\n"
        "print(*(m.__file__ for name, m in sys.modules.items() if name.startswith('hdc')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=sources.ROOT
    )
    loaded = {path.removeprefix(f"{sources.ROOT}/") for path in done.stdout.split()}
    assert "hdc/bits.py" in loaded
    assert loaded <= set(sources.sources(HDC))


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ('"""Other words."""\n\ndef f(x):\n    """Other."""\n    return x  + 1 # why\n', True),
        ('"""Words."""\ndef f(x):\n    return x + 2\n', False),
        ('"""Words."""\ndef f(y):\n    return y + 1\n', False),
    ],
)
def test_comments_docstrings_and_layout_do_not_count(tmp_path, text, same):
    (tmp_path / "a.py").write_text('"""Words."""\ndef f(x):\n    """More."""\n    return x + 1\n')
    (tmp_path / "b.py").write_text(text)
    assert (sources.digest(tmp_path / "a.py") == sources.digest(tmp_path / "b.py")) == same


def test_outdated_files():
    now = sources.sources(HDC)
    assert sources.outdated(now) == []
    old = {**now, "hdc/bits.py": "0" * 12, "hdc/gone.py": "1" * 12}
    assert sources.outdated(old) == ["hdc/bits.py", "hdc/gone.py"]
    assert sources.code_hash(now) != sources.code_hash(old)
