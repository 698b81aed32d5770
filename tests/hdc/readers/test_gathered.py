"""A folder of files of arrays or videos: what names say, and which frames of which file come."""

import numpy as np
import pytest

from hdc.readers import Ambiguous, BadFrame, open_recording
from hdc.readers.template import suggested
from tests.hdc.readers.writers import mat, said

N, H, W = 6, 16, 24
NAMES = ("day1/ball_1", "day1/ball_2", "day1/mug_1", "day2/ball_1", "day2/mug_1")
TEMPLATE = "{session}/{label}_{group}"


def frames_of(number):
    """uint8 [6, 16, 24]: uniform frames, different in each file and each place."""
    greys = 40 * number + 5 * np.arange(N)
    return np.broadcast_to(greys[:, None, None], (N, H, W)).astype(np.uint8)


@pytest.fixture
def gathered(tmp_path, write_film):
    """gathered(suffix) → a folder with a file of six frames for each of the names."""
    writers = {
        "npy": np.save,
        "mat": lambda path, frames: mat(path, cube=np.moveaxis(frames, 0, -1)),
        "mkv": write_film,
        "avi": lambda path, frames: write_film(path, frames, "MJPG"),
    }

    def make(suffix):
        for number, name in enumerate(NAMES):
            path = tmp_path / f"{name}.{suffix}"
            path.parent.mkdir(exist_ok=True)
            writers[suffix](path, frames_of(number))
        (tmp_path / "day1" / "notes.txt").touch()
        return tmp_path

    return make


@pytest.mark.parametrize("suffix", ["npy", "mat", "mkv", "avi"])
def test_files_are_labelled_by_their_names(gathered, suffix):
    """Six of nine data sets had a file per recording, and needed a script."""
    root, files = gathered(suffix), [f"{name}.{suffix}" for name in NAMES]
    template, crop = f"{TEMPLATE}.{suffix}", [8, 0, 16, 8]
    recording = open_recording(root, template=template, crop=crop)
    assert recording.shape == (5 * N, 8, 16)
    assert recording.dtype == np.uint8
    each = ["ball day1 1", "ball day1 2", "mug day1 1", "ball day2 1", "mug day2 1"]
    assert said(recording, "label session_name group") == np.repeat(each, N).tolist()
    assert recording.samples["file"].tolist() == np.repeat(files, N).tolist()
    assert recording.place(7).startswith(f"{root / files[1]}, frame 1")
    assert recording.other_files == ("day1/notes.txt",)
    expected = np.concatenate([frames_of(k) for k in range(5)])[:, :8, :16].astype(int)
    order = np.random.default_rng(0).permutation(5 * N)
    for index in (np.arange(5 * N), order, [7, 7, 0]):
        found = recording.frames(index).astype(int)
        assert np.abs(found - expected[index]).max() <= 2 * (suffix == "avi")


def test_a_file_is_a_group_where_the_template_has_none(gathered):
    root = gathered("npy")
    expected = np.repeat(np.arange(5), N).tolist()
    assert open_recording(root, template="*/{label}_*.npy").group.tolist() == expected
    names = open_recording(root, template="day1/{label}.npy")  # a class a file
    assert names.group is None
    assert names.notes[-1] == "each class: recorded once, so its frames are split"
    alone = open_recording(root, template="day1/{label}_*.npy")
    assert alone.group[: 2 * N].tolist() == [0] * N + [1] * N
    assert len({*alone.group[2 * N :].tolist()}) == N
    assert alone.notes[-1] == "mug: recorded once, so its frames are split"


def test_what_names_do_not_say_is_said_by_the_files(tmp_path, write_film):
    """Labels, runs and numbers in a file for each day; a film with its table."""
    kept = {"labels": ["a", "b", "a"], "value_names": ["force"], "run": [0, 0, 1]}
    for day in (1, 2):
        kept |= {"frames": frames_of(day)[:3], "values": np.arange(3.0) * day}
        np.savez(tmp_path / f"day{day}.npz", **kept)
        film = tmp_path / f"film{day}.mkv"
        write_film(film, frames_of(day))
        film.with_suffix(".csv").write_text("start_s,end_s,label\n0,0.2,a\n0.2,0.6,b\n")
    recording = open_recording(tmp_path, template="{session}.npz", groups="run")
    expected = ["a 0 0", "b 0 0", "a 0 1", "a 1 2", "b 1 2", "a 1 3"]
    assert said(recording, "label session group") == expected
    forced = open_recording(tmp_path, template="{session}.npz", value_columns=["force"])
    assert said(forced, "force") == [*"012024"]
    named = open_recording(tmp_path, template="{label}.npz")
    assert named.classes == ("day1", "day2")
    assert "labels of the names of the files, not those in them" in named.notes
    films = open_recording(tmp_path, template="{session}.mkv")
    assert films.names == [*"aabbbb"] * 2


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (["ball__t=0.avi", "ball__t=1.avi", "mug__t=0.avi"],
         ["{label}__t={group}.avi", "{label}.avi", "{session}.avi"]),
        (["ball1.mat", "ball2.mat", "mug1.mat", "x.avi"],
         ["{label}{group:d}.mat", "{label}.mat", "{session}.mat", "{label}.avi", "{session}.avi"]),
        (["a_ball_run1.avi", "a_ball_run2.avi", "mug_run1.avi"],
         ["{label}_run{group}.avi", "{label}.avi", "{session}.avi"]),
        (["ball_1.avi", "mug_1.avi"], ["{label}.avi", "{session}.avi"]),
        (["d1/ball_1.avi", "d1/ball_2.avi", "d2/mug_1.avi"],
         ["{session}/{label}_*.avi", "{label}/{group}.avi", "{session}/{label}.avi"]),
    ],
)  # fmt: skip
def test_templates_are_suggested_by_names(files, expected):
    assert suggested(files, ("{label}", "{session}")) == expected


def test_files_without_a_template_and_one_of_other_frames_are_named(gathered):
    root = gathered("npy")
    with pytest.raises(Ambiguous, match=r"5 files of frames, such as day1/ball_1\.npy"):
        open_recording(root)
    np.save(root / "day2" / "mug_1.npy", frames_of(1)[:, 1:])
    with pytest.raises(BadFrame, match=r"mug_1\.npy: expected frames \(16, 24\) uint8"):
        open_recording(root, template=f"{TEMPLATE}.npy")


@pytest.mark.parametrize("suffix", ["npy", "mat"])
def test_a_vector_in_each_file_is_one_frame(tmp_path, suffix):
    """Public data sets of key points and of slices had no way through."""
    vectors = np.random.default_rng(0).random((4, 30))
    for number, vector in enumerate(vectors):
        path = tmp_path / f"{'ab'[number % 2]}_{number}.{suffix}"
        if suffix == "npy":
            np.save(path, vector)
        else:
            mat(path, data=vector, torque=0.5)
    template = f"{{label}}_{{group}}.{suffix}"
    if suffix == "npy":
        with pytest.raises(
            ValueError, match=r"\(30,\) .*--axes feature a vector that is one"
        ):
            open_recording(tmp_path, template=template)
    recording = open_recording(tmp_path, template=template, axes=["feature"])
    assert said(recording, "label group") == ["a 0", "a 2", "b 1", "b 3"]
    assert np.array_equal(recording.frames(range(4)), vectors[[0, 2, 1, 3]])
