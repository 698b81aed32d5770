"""The examples of the docstrings run and show what they say."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import warnings

import pytest

import hdc
from hdc import encoders, readouts


def modules() -> list[str]:
    names = [
        "hdc.bank",
        "hdc.bits",
        "hdc.classifier",
        "hdc.parameters",
        "hdc.regressor",
    ]
    for package in (encoders, readouts):
        found = pkgutil.iter_modules(package.__path__, f"{package.__name__}.")
        names += [module.name for module in found]
    return names


@pytest.mark.parametrize("name", modules())
def test_examples(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0


def test_there_are_examples():
    finder = doctest.DocTestFinder(exclude_empty=True)
    for thing in (
        hdc.HDCClassifier,
        hdc.HDCRegressor,
        encoders.Encoder,
        readouts.Readout,
    ):
        examples = [
            example for found in finder.find(thing) for example in found.examples
        ]
        assert len(examples) >= 3
