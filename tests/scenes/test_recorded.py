"""A recording as a scene; its readers are tested with hdc."""

import numpy as np
import pytest

from hdc.readers import Ambiguous
from scenes.recorded import open_recording


def test_readings_are_named_as_this_scene_takes_them(tmp_path):
    """They were options of the command hdc, which no config takes."""
    np.savez(tmp_path / "x.npz", first=np.zeros((4, 5, 6)), second=np.zeros((4, 5, 6)))
    with pytest.raises(Ambiguous) as caught:
        open_recording(tmp_path / "x.npz")
    said = str(caught.value)
    assert f"scene.path={tmp_path}/x.npz:/first" in said
    assert "--" not in said
    folder = tmp_path / "folder"
    (folder / "day" / "wood").mkdir(parents=True)
    (folder / "day" / "wood" / "0.png").touch()
    with pytest.raises(
        Ambiguous, match=r"\"\+scene\.template='\{label\}/\{group\}/\*'\""
    ):
        open_recording(folder)
