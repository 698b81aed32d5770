"""The compiler of this machine."""

from __future__ import annotations

import shutil

import pytest


@pytest.fixture(scope="module")
def gcc():
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("no C compiler here: looked for gcc")
    return found
