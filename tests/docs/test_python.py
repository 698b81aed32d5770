"""Examples in Python that README and docs show run, and do what the text beside them says."""

import importlib.util
import re
from pathlib import Path

import numpy as np

from scenes.fibre import FibreScene

CHECKOUT = Path(__file__).resolve().parents[2]


def examples(name):
    text = (CHECKOUT / name).read_text("utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def test_readme():
    rng = np.random.default_rng(0)
    touches = rng.integers(0, 200, (2, 24, 32))
    labels = np.arange(20) % 2
    frames = touches[labels] + rng.integers(0, 50, (20, 24, 32))
    names = {"frames": frames, "labels": labels, "queries": frames[:2]}
    (code,) = examples("README.md")
    exec(code, names)
    assert len(list(filter(None, code.splitlines()))) == 2
    assert names["answers"].tolist() == [0, 1]


def test_a_camera(capsys):
    (code,) = examples("docs/choose.md")
    exec(code, {})
    assert capsys.readouterr().out


def test_drift_with_and_without_labels():
    (code,) = examples("docs/adapt.md")
    names = {}
    exec(code, names)
    assert names["before"] < 0.9 < names["after"]
    assert names["without_labels"] > 0.9


def test_from_python(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "mine"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # no other run holds these cores
    *codes, own = examples("docs/extend.md")
    assert "class First(Readout)" in own  # tests/experiments/test_own.py runs it
    names = {}
    for code in codes:
        exec(code, names)
    lines = names["lines"]
    assert len(lines) == 6
    right = [
        (p == t).mean() for p, t in zip(lines.predicted, lines.labels, strict=True)
    ]
    assert right == lines.test_accuracy_final.tolist()
    assert names["low"] <= names["difference"] <= names["high"]
    assert names["accuracy"](1.0) > 0.5
    assert len(names["rows"]) > 1000
    assert set(names["rows"]["scene.photons"].dropna()) == {50}


def test_picture_of_the_method():
    spec = importlib.util.spec_from_file_location(
        "method", CHECKOUT / "docs" / "examples" / "method.py"
    )
    method = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(method)
    scene = FibreScene(CHECKOUT / "tests/data/mmf_disorder")
    (frame, ones, prototype), distances = method.pictures(scene)
    assert frame[ones].min() >= frame[~ones].max()
    assert 2 * ones.sum() <= ones.numel()
    assert distances.argmin() == method.SHOWN
    assert distances[method.SHOWN] == (ones != prototype).float().mean()
    assert len(method.draw(scene).axes) == 4
