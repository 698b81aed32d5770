"""A file, an array or a column per trial: from the files to an accuracy in two typed lines.

The accuracy is that of scikit-learn's leave-one-group-out over frames that the test has itself.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict

from hdc import HDCClassifier

pytestmark = pytest.mark.filterwarnings("ignore:fit. the largest class has")
CLASSES, TRIALS, N, SHAPE = ("ball", "mug", "pen"), 3, 4, (12, 10)
RNG = np.random.default_rng(0)
PATTERN = RNG.integers(0, 60, (len(CLASSES), 1, 1, *SHAPE))
OF_TRIAL = RNG.integers(0, 60, (len(CLASSES), TRIALS, 1, *SHAPE))
NOISE = RNG.integers(0, 130, (len(CLASSES), TRIALS, N, *SHAPE))
FRAMES = (PATTERN + OF_TRIAL + NOISE).astype(np.uint8)  # [class, trial, frame, H, W]
NAMES = np.repeat(CLASSES, TRIALS * N)
TRIAL = np.tile(np.repeat(np.arange(TRIALS), N), len(CLASSES))
EACH = np.repeat(np.arange(len(CLASSES) * TRIALS), N)


def each_trial():
    """Class, number of the trial, and frames [4, 12, 10], of nine trials."""
    for c, name in enumerate(CLASSES):
        for trial in range(TRIALS):
            yield name, trial, FRAMES[c, trial]


def films(path, write_film):
    path.mkdir()
    for name, trial, frames in each_trial():
        write_film(path / f"{name}__t={trial}.avi", frames, "FFV1")


def one_frame_each(path, _):
    for name, trial, frames in each_trial():
        (path / name).mkdir(parents=True, exist_ok=True)
        for k, frame in enumerate(frames):
            np.save(path / name / f"t{trial}_{k}.npy", frame)


def field(path, _):
    cube = np.moveaxis(FRAMES.reshape(-1, *SHAPE), 0, -1)
    kinds = NAMES.astype(object)
    scipy.io.savemat(path, {"cube": cube, "label": kinds, "runNo": TRIAL})


def structs(path, _):
    of_trials = [
        {"label": name, "frames": np.moveaxis(frames, 0, -1), "force": 0.5 * trial}
        for name, trial, frames in each_trial()
    ]
    scipy.io.savemat(path, {"trials": np.array(of_trials, object)})


def groups(path, _):
    with h5py.File(path, "w") as file:
        for k, (name, _, frames) in enumerate(each_trial()):
            file[f"data/demo_{k}/frames"] = frames
            file[f"data/demo_{k}"].attrs["label"] = name


def named_groups(path, _):
    with h5py.File(path, "w") as file:
        for name, trial, frames in each_trial():
            file[f"{name}_{trial}/frames"] = frames
            file[f"{name}_{trial}/times"] = np.arange(N) / 30


LAYOUTS = [
    ("r", films, "--template {label}__t={group}.avi", TRIAL),
    ("r", one_frame_each, "--template {label}/t{group}_*.npy --axes height,width", TRIAL),
    ("x.mat", field, "--groups runNo", TRIAL),
    ("x.mat", structs, "--template trials/{group}/frames", EACH),
    ("x.h5", groups, "--template data/{group}/frames", EACH),
    ("x.h5", named_groups, "--template {label}_{group}/frames", TRIAL),
]  # fmt: skip


@pytest.mark.parametrize(("name", "write", "options", "unit"), LAYOUTS)
def test_files_of_trials_are_read_alike_by_every_command(
    typed, write_film, name, write, options, unit
):
    """hdc predict found no images in a folder that hdc train had read."""
    write(Path(name), write_film)
    shown = typed("look", name)[1].replace("'", "")
    is_typed_by_hand = write is one_frame_each
    assert f" {options}" in shown or is_typed_by_hand
    words, flat = options.split(), FRAMES.reshape(-1, *SHAPE)
    split = {"groups": unit, "cv": LeaveOneGroupOut()}
    right = cross_val_predict(HDCClassifier(), flat, NAMES, **split) == NAMES
    assert 0.4 < right.mean() < 1
    rows = typed("compare", name, *words)[1].splitlines()
    (row,) = (line for line in rows if line.startswith("median, majority  "))
    assert f" {100 * right.mean():.1f} %" in row
    assert typed("train", name, *words, "-o", "m")[0] == 0
    expected = HDCClassifier().fit(flat, NAMES).predict(flat)
    score = json.loads(typed("evaluate", "m", name, *words, "--json")[1])
    assert score["accuracy"] == pytest.approx((expected == NAMES).mean())
    if write is field or Path(name).is_dir():
        words = words[2:]  # nothing is split, and a folder is read file by file
    out = typed("predict", "m", name, *words, "--json")[1]
    assert [json.loads(line)["label"] for line in out.splitlines()] == expected.tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("x.h5", "--template", "{label}/pixels"), "expected arrays {label}/pixels, found ball_0/"),
        (("x.h5:/ball_0/frames", "--template", "*"), "expected null with x.h5:/ball_0/frames"),
        (("x.h5", "--template", "{group}/frames"), "expected a label of each frame"),
        (("flat", "--template", "{label}.npy"), "ball.npy: an array of two axes: expected one of "
         "--axes height,width; or --axes frame,feature"),
    ],
)  # fmt: skip
def test_what_is_no_trial_is_named(typed, words, said):
    named_groups("x.h5", None)
    Path("flat").mkdir()
    for name in CLASSES[:2]:
        np.save(f"flat/{name}.npy", FRAMES[0, 0, 0])
    status, _, err = typed("train", *words, "-o", "m")
    assert (status, err.count("\n")) == (1, 1)
    assert said in err
