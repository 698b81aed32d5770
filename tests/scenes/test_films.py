"""Films of touches as a scene: which frames are pressed, whose groups and sessions they are."""

import numpy as np
import pytest

from scenes.films import FilmScene, pressed
from scenes.frames import Scene

ABOUT = {"repository": "somebody/grasps", "commit": "0123abc", "cite": "Somebody, 2024"}
DAYS = [
    {"folder": "day1", "template": "{label}_{group:d}.avi"},
    {"folder": "day2", "template": "{label}__t={group}.avi"},
]


def film(heights, shape=(4, 6)):
    """A film uint8 [T, H, W] that is so much brighter than its first frame."""
    return np.full((len(heights), *shape), 50, np.uint8) + np.array(
        heights, np.uint8
    ).reshape(-1, 1, 1)


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ([0, 0, 10, 20, 30, 20, 10, 0], [3, 4, 5]),  # at least half of 30
        ([0, 20, 5, 20, 30, 20, 5, 20], [3, 4, 5]),  # what lies around the largest
        ([0, 0, 0, 0, 15, 20, 25, 30], [4, 6, 7]),  # to the end of the film
    ],
)
def test_a_film_is_pressed_around_its_largest_change(heights, expected):
    assert pressed(film(heights), 3).tolist() == expected


@pytest.fixture
def films(tmp_path, monkeypatch, write_film):
    """Two balls, two grasps each, on two days; a brick on the first."""
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    root = tmp_path / "grasps"
    for day, name in (("day1", "{}_{}.avi"), ("day2", "{}__t={}.avi")):
        (root / day).mkdir(parents=True)
        for k, label in enumerate(("green_ball", "golf_ball")):
            for grasp in (1, 2):
                frames = film([0, 0, 40 + 10 * k, 60, 60, 0], (32, 48))
                write_film(root / day / name.format(label, grasp), frames)
    write_film(root / "day1" / "brick_1.avi", film([0, 9, 0], (32, 48)))
    return root


def test_films_are_a_scene_of_their_pressed_frames(films):
    scene = FilmScene(ABOUT, DAYS, ["golf_ball", "green_ball"], 2, subsample=2)
    assert isinstance(scene, Scene)
    assert scene.classes == ("golf_ball", "green_ball")
    assert (scene.shape, len(scene)) == ((16, 24), 16)
    assert scene.samples["session"].tolist() == [0] * 8 + [1] * 8
    assert scene.samples["group"].tolist() == [0, 0, 1, 1] * 4
    assert np.bincount(scene.labels).tolist() == [8, 8]
    levels = scene.frames(range(16)).float().mean((1, 2))
    assert (levels > 80).all()  # none is of an untouched sensor
    whole = FilmScene(ABOUT, DAYS[:1], None, 2, subsample=2)
    assert whole.classes[0] == "brick"
    assert whole.fingerprint() != scene.fingerprint()
