"""Readers import what a recording needs: no torch at all, OpenCV for images and videos."""

import subprocess
import sys

import pytest

HEAVY = ("torch", "cv2", "PIL", "rich", "click")


@pytest.mark.parametrize(
    ("modules", "loaded"),
    [
        ("hdc, hdc.readers, hdc.readers.archive", ""),
        ("hdc.readers.images, hdc.readers.video", "cv2 PIL"),
    ],
)
def test_only_what_is_needed_is_imported(modules, loaded):
    code = f"import sys, {modules}; print(*[m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == loaded
