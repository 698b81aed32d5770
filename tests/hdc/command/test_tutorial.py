"""The tutorial's walks on nested folders and on numbers, on small made-up copies of them."""

import re
import shlex
from pathlib import Path

import cv2
import numpy as np

TUTORIAL = Path(__file__).resolve().parents[3] / "docs" / "tutorial.md"


def shown(language, word):
    """The block of code of the tutorial that has a word."""
    text = TUTORIAL.read_text(encoding="utf-8")
    blocks = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    return next(block for block in blocks if word in block)


def save(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image.astype(np.uint8))


def test_nested_folders_by_a_template(typed):
    rng = np.random.default_rng(0)
    base = {
        name: rng.integers(0, 150, (30, 40, 3)) for name in ("wood", "felt", "glass")
    }
    for day in (1, 2):
        for name, pattern in base.items():
            for cycle in range(4):
                folder = Path(f"press/day{day}/material_{name}/cycle_{cycle}_A")
                image = pattern + rng.integers(0, 60, pattern.shape)
                save(folder / "frame.png", image)
                (folder / "settings.json").write_text("{}")
    printed = []
    for line in shown("sh", "press/").splitlines():
        status, out, err = typed(*shlex.split(line)[1:])
        assert status == 0, line
        printed.append(out + err)
    trained, predicted = printed
    assert "12 frames, 3 classes" in trained
    assert "held out in the last sessions: accuracy 100.0 %" in trained
    assert (
        "left out 24 other files: day1/material_felt/cycle_0_A/settings.json" in trained
    )
    assert predicted.splitlines()[1].split("\t")[1] == "wood"


def test_levels_and_lda_in_python():
    """The classes differ by a faint touch on a scene that is common to all."""
    rng = np.random.default_rng(0)
    common = rng.integers(0, 200, (48, 64))
    for day, n in (("touches", 20), ("tomorrow", 10)):
        for name, side in (("left", slice(8, 24)), ("right", slice(40, 56))):
            for k in range(n):
                image = common + rng.integers(0, 40, common.shape)
                image[16:32, side] += 12
                save(Path(day, name, f"{k}.png"), image)
    names = {}
    exec(shown("python", 'encoder="levels"'), names)
    truth = np.array(names["later"].names)
    found = names["loaded"].predict(names["later"].frames(range(20)))
    assert names["accuracy"] == (found == truth).mean()
    assert names["accuracy"] > names["published"]
