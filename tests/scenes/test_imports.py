"""A scene imports what it needs: OpenCV for images and videos, and nothing else of weight."""

import subprocess
import sys

import pytest

HEAVY = ("cv2", "sklearn", "pandas", "matplotlib", "hydra", "rich", "scipy", "PIL")


@pytest.mark.parametrize(
    "modules",
    ["scenes", "scenes.frames, scenes.split, scenes.fibre", "scenes.recorded, hdc.readers.archive"],
)
def test_heavy_packages_are_not_imported(modules):
    code = f"import sys, {modules}; print(*[m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
