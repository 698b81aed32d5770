"""The compiler of this machine."""

import shutil

import pytest


@pytest.fixture(scope="module")
def gcc():
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("no C compiler here: looked for gcc")
    return found
