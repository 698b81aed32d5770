"""The examples of the docstrings run and show what they say."""

import doctest
import importlib
import pkgutil
import warnings

import pytest

import hdc
from hdc import encoders, readouts

PACKAGES = (hdc, encoders, readouts)
MODULES = [
    f"{package.__name__}.{module.name}"
    for package in PACKAGES
    for module in pkgutil.iter_modules(package.__path__)
    if not module.ispkg
]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0
