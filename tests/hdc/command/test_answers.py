"""Answers, tables and scores of models whose answers can be read off the frames."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from hdc.command import answers, messages, scores
from hdc.readers import BadFrame, Window, open_recording

NAMES = np.array(["a", "b", "c"])
PLAIN = answers.Wanted()


class Nearest:
    """A classifier: the pixels of a frame are its distances to three classes, of 100."""

    frame_shape_ = (1, 3)
    classes_ = NAMES
    dimension_ = 100
    counts_ = np.array([1, 3, 2])
    left_out_ = "group"

    def encode(self, frames):
        return frames[:, 0].astype(int)

    def distances(self, words):
        return words

    def predict(self, words):
        return NAMES[words.argmin(1)]

    def is_known(self, words, alpha):
        return words.min(1) < 100 * (1 - alpha)

    def predict_set(self, words, alpha):
        return [NAMES[row <= 100 * alpha] for row in words]

    def predict_proba(self, words):
        return 1 - words / 100


class Read:
    """A regressor: the first pixels of a frame are its force and its x, exact within the third.

    The ends of an interval are farther for a smaller share outside; 255 is an infinite one.
    """

    mean_ = np.array([4.0, 8.0])
    frame_shape_ = (1, 3)

    def __init__(self):
        self.metadata_ = {"values": ["force", "x"]}

    def encode(self, frames):
        return frames.reshape(len(frames), -1).astype(float)

    def predict(self, words, return_interval=False, alpha=None):
        found, wide = words[:, :2], words[:, 2:]
        wide = np.where(wide == 255, np.inf, wide) / (alpha or 1) / 10
        return (found, found - wide, found + wide) if return_interval else found


def saved(path, frames, **arrays):
    """Frames of a row of pixels each, as an .npz."""
    frames = np.array(frames, np.uint8)[:, None]
    np.savez(path, frames=frames, **arrays)
    return Path(path)


@pytest.fixture
def classes():
    """Four frames of the classes a, a, b, c, of which the second is read as b."""
    frames = [[10, 60, 90], [30, 20, 90], [80, 5, 15], [95, 75, 70]]
    return saved("c.npz", frames, labels=[*"aabc"])


def table(found):
    """Lines of the table of some answers, a bar between two cells."""
    rows = [answers.table_row(answer) for answer in found]
    return ["|".join(row) for row in (rows[0], *(row.values() for row in rows))]


def test_an_answer_of_a_classifier_has_all_that_is_asked_for(classes):
    model = Nearest()
    asked = answers.Wanted(0.4, 0.8, True)
    found = list(answers.ask(model, Window(), [classes], asked, {}))
    assert found[2] == {
        "file": f"{classes}, frame 2",
        "label": "b",
        "set": ["b", "c"],
        "probability": 0.95,
        "probabilities": {"a": pytest.approx(0.2), "b": 0.95, "c": 0.85},
        "distances": {"a": 0.8, "b": 0.05, "c": 0.15},
    }
    assert table(found[2:]) == [
        "file|label|set|probability|distances a|distances b|distances c",
        f"{classes}, frame 2|b|b, c|0.9500|0.8000|0.0500|0.1500",
        f"{classes}, frame 3|(none of these)|(none of these)|0.3000|0.9500|0.7500|0.7000",
    ]

    class Without(Nearest):
        """Without prototypes."""

        @property
        def distances(self):
            raise AttributeError

    first, *_ = answers.ask(Without(), Window(), [classes], PLAIN, {})
    assert first == {"file": f"{classes}, frame 0", "label": "a"}


def test_an_answer_of_a_regressor_has_values_and_the_ends_of_their_intervals():
    path = saved("v.npz", [[5, 7, 4], [6, 8, 255]])
    model = Read()
    plain = list(answers.ask(model, Window(), [path], PLAIN, {}))
    assert plain[0] == {"file": f"{path}, frame 0", "values": {"force": 5.0, "x": 7.0}}
    assert table(plain)[:2] == [
        "file|values force|values x",
        f"{path}, frame 0|5.0000|7.0000",
    ]
    found = list(answers.ask(model, Window(), [path], answers.Wanted(None, 0.8), {}))
    assert [answer["intervals"] for answer in found] == [
        {"force": [3.0, 7.0], "x": [5.0, 9.0]},
        {"force": [None, None], "x": [None, None]},
    ]
    assert table(found) == [
        "file|values force|values x|intervals force|intervals x",
        f"{path}, frame 0|5.0000|7.0000|3.0000, 7.0000|5.0000, 9.0000",
        f"{path}, frame 1|6.0000|8.0000|-, -|-, -",
    ]


def test_files_of_all_kinds_are_answered_in_their_order(write_film, tmp_path):
    film, array, image = (tmp_path / name for name in ("v.MKV", "a.npy", "i.PNG"))
    write_film(film, [np.full((16, 20), grey, np.uint8) for grey in (10, 90)])
    np.save(array, np.full((1, 16, 20), 50, np.uint8))
    assert cv2.imwrite(str(image), np.full((16, 20), 7, np.uint8))
    model = Read()
    model.frame_shape_ = (3,)
    found = answers.ask(model, Window((4, 2, 3, 1)), [film, array, image], PLAIN, {})
    assert [(answer["file"], answer["values"]["x"]) for answer in found] == [
        (f"{film} at 0.000 s", pytest.approx(10, abs=3)),
        (f"{film} at 0.100 s", pytest.approx(90, abs=3)),
        (str(array), 50.0),
        (str(image), 7.0),
    ]
    with pytest.raises(BadFrame, match=r"i\.PNG: expected 3 pixels .* found 20 × 16"):
        list(answers.ask(model, Window(), [image], PLAIN, {}))


def test_a_value_of_a_table_is_no_part_of_its_frame(tmp_path):
    rows = tmp_path / "t.csv"
    rows.write_text("p,force,q,r\n1,9,2,3\n")
    model = Read()
    model.frame_shape_ = (3,)
    (found,) = answers.ask(model, Window(), [rows], PLAIN, {})
    assert found == {"file": f"{rows}, line 2", "values": {"force": 1.0, "x": 2.0}}


def test_a_score_of_classes_is_complete(classes):
    recording = open_recording(classes)
    found = scores.score(Nearest(), recording, np.arange(4), 0.4, 0.8)
    assert found == {
        "frames": 4,
        "accuracy": 0.75,
        "interval": pytest.approx([0.3006, 0.9544], abs=1e-4),
        "interval_by": "4 frames",
        "guessed": "b",
        "guess": 0.25,
        "classes": ["a", "b", "c"],
        "confusion": [[1, 1, 0], [0, 1, 0], [0, 0, 1]],
        "reject": 0.4,
        "refused": 1,
        "left_out": "group",
        "coverage": {
            "asked": 0.8,
            "share": 0.5,  # a, b, b and c, and none
            "interval": pytest.approx([0.15, 0.85], abs=1e-3),
            "mean_size": 1.0,
        },
    }
    assert messages.score_lines(found)[2] == (
        "refused 1 of 4 known frames; expected at most 40 %"
    )


def test_an_interval_is_of_recordings_where_they_are_known():
    """By frame it was 72 to 81 % where the videos gave 44 to 99."""
    rng = np.random.default_rng(0)
    for k in (3, 5, 10):
        held, wide = 0, []
        for _ in range(300):
            share = rng.beta(6, 4, k)
            right = rng.random((k, 40)) < share[:, None]
            low, high = scores.interval_of(right.ravel(), np.repeat(np.arange(k), 40))
            held += low <= 0.6 <= high
            wide.append(high - low)
        assert 0.92 * 300 <= held <= 299  # 0.88, 0.9, 0.91 without Student's t
        assert np.mean(wide) == pytest.approx({3: 0.52, 5: 0.35, 10: 0.22}[k], abs=0.03)
    all_right = scores.interval_of(np.ones(100, bool), np.arange(100) // 25)
    assert all_right[0] < scores.wilson(4, 4)[0]  # no hundred of frames, but four runs
    assert scores.interval_of(np.arange(9) < 6, np.arange(9)) == scores.wilson(6, 9)
    same = np.array([1, 0, 1, 0] * 10, bool)  # units that do not differ
    assert scores.interval_of(same, np.arange(40) // 4)[0] > scores.wilson(5, 10)[0]
    frames = [[0, 0, 4], [9, 9, 4], [0, 0, 4], [9, 9, 4]]
    kept = {"labels": [*"acac"], "group": [0, 0, 1, 1], "session": [5, 5, 5, 5]}
    recording = open_recording(saved("g.npz", frames, **kept))
    found = scores.score(Nearest(), recording, np.arange(4))
    assert found["interval_by"] == "2 groups"
    kept |= {"session": [0, 1, 2, 3], "group": [0, 0, 0, 0]}
    alone = open_recording(saved("s.npz", frames, **kept))
    by = scores.score(Nearest(), alone, np.arange(4))["interval_by"]
    assert by == "4 frames"
    assert "% by 2 groups), 4 of 4 frames" in messages.score_lines(found)[0]


def test_a_score_of_values_is_complete():
    frames = [[5, 7, 4], [6, 8, 4], [0, 0, 4], [1, 1, 4], [1, 1, 255]]
    truth = [[6, 7], [3, 8], [9, 9], [1, 1.5], [1, 1]]
    about = {"value_names": ["force", "x"], "value_units": ["N", ""]}
    recording = open_recording(saved("v.npz", frames, values=truth, **about))
    found = scores.score(Read(), recording, np.array([0, 1, 3]), interval=0.8)
    assert found["frames"] == 3
    assert found["errors"]["force"] == {
        "mean_absolute_error": pytest.approx(4 / 3),
        "guess": 2.0,  # of 4 for 6, 3 and 1
        "r_squared": pytest.approx(1 - 10 / (38 / 3)),
        "unit": "N",
        "coverage": {
            "asked": 0.8,
            "share": 2 / 3,
            "interval": pytest.approx([0.2077, 0.9385], abs=1e-4),
            "mean_width": 4.0,
        },
    }
    assert messages.score_lines(found)[0] == (
        "force: mean absolute error 1.333 N (mean baseline 2 N), R² 0.211, 3 frames"
    )
    wide = scores.score(Read(), recording, np.array([4]), interval=0.8)
    assert messages.score_lines(wide)[3].endswith("mean width inf")
