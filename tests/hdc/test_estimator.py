"""scikit-learn's conventions, by scikit-learn's own checks."""

import warnings
from pathlib import Path

import pytest
from sklearn.utils.estimator_checks import check_estimator

import hdc
from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Quantile
from hdc.readouts import LDA, NeighbourValues


@pytest.mark.parametrize(
    "model",
    [
        HDCClassifier(),
        HDCClassifier("reference", "counts"),
        HDCClassifier(readout="neighbours"),
        HDCClassifier("deviation", "ridge"),
        HDCClassifier(Quantile("2/3"), LDA(0.5)),
        HDCClassifier(readout="trained"),
        HDCClassifier("levels", "kernel"),
        HDCRegressor(),
        HDCRegressor("levels", NeighbourValues(3)),
    ],
    ids=lambda x: repr(x)[:60],
)
def test_all_checks_are_met(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        checks = check_estimator(model, on_fail=None)
    passed = [c for c in checks if c["status"] in ("passed", "skipped")]
    assert passed == checks


def test_the_version_is_that_of_the_project():
    """pyproject.toml reads it from the package, without importing it."""
    setuptools = pytest.importorskip("setuptools.config.pyprojecttoml")
    found = setuptools.read_configuration(
        Path(hdc.__file__).parents[1] / "pyproject.toml"
    )
    assert found["project"]["version"] == hdc.__version__
