"""Fixtures that several parts of the tests share."""

import os
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder with the measured data: ``SHARED_DATA``, else the one beside the checkout."""
    folder = Path(os.environ.get("SHARED_DATA", CHECKOUT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the measured data are not here: no folder {folder}; set SHARED_DATA")
    return folder
