"""The compiled backend: the same bits as numpy's, on request only, and clear where it is not."""

import importlib
import pickle
import sys

import numpy as np
import pytest
import torch

import hdc
from hdc import HDCClassifier, backends

needs_numba = pytest.mark.usefixtures("numba")


@pytest.fixture(scope="module")
def numba():
    found = pytest.importorskip(
        "numba", reason="numba is not installed: pip install 'speckle-hdc[compiled]'"
    )
    importlib.import_module("hdc.compiled")  # before a test says that it is not loaded
    return found


def frames_of(n, d):
    return torch.from_numpy(np.random.default_rng(n).integers(0, 256, (n, d), np.uint8))


def test_other_devices_are_refused():
    message = "backend: 'compiled' expects device 'cpu', found 'meta'"
    with pytest.raises(ValueError, match=message):
        backends.kernels("compiled", "meta")


@pytest.fixture
def fresh():
    """A process that has neither loaded the kernels nor encoded anything."""
    for function in (backends._load, backends._loads):
        function.cache_clear()
    yield
    for function in (backends._load, backends._loads):
        function.cache_clear()


@pytest.fixture
def without_numba(fresh, monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    for name in [name for name in sys.modules if name.startswith("hdc.compiled")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(hdc, "compiled", raising=False)


@needs_numba
def test_auto_is_compiled_once_it_pays(fresh):
    assert backends.choose_backend("auto", "cpu", backends.ENOUGH - 1) == "numpy"
    assert backends.choose_backend("auto", "cpu", backends.ENOUGH) == "compiled"
    assert backends.choose_backend("auto", "cpu") == "compiled"


def test_without_numba_the_parameter_is_named(without_numba):
    message = r"backend: 'compiled' expects numba \(pip install 'speckle-hdc\[compiled\]'\), found"
    frames = frames_of(4, 100)
    with pytest.raises(ValueError, match=message):
        HDCClassifier(backend="compiled").fit(frames, [0, 1, 0, 1])
    with pytest.raises(ValueError, match=message):
        hdc.compile_kernels()
    for _ in range(2):  # tried once, asked twice
        assert backends.choose_backend("auto", "cpu", backends.ENOUGH) == "numpy"


@needs_numba
def test_no_backend_changes_between_fit_and_load(fresh, tmp_path):
    """A loop of single frames stalled for seconds where it loaded the kernels."""
    frames = frames_of(40, 1000)
    labels = [0, 1, 2, 3] * 10
    small = HDCClassifier().fit(frames, labels)
    small.save(tmp_path / "m")
    assert small.backend_ == "numpy"
    for _ in range(backends.ENOUGH // 40_000 // 1000):
        small.predict(frames)
    hdc.compile_kernels()
    small.predict(frames)
    assert small.backend_ == "numpy"
    for later in (
        HDCClassifier().fit(frames, labels),
        HDCClassifier.load(tmp_path / "m"),
        pickle.loads(pickle.dumps(small)),
    ):
        assert later.backend_ == "compiled"
        assert np.array_equal(later.predict(frames), small.predict(frames))
        assert np.array_equal(later.p_values(frames), small.p_values(frames))
