"""Every warning points at the line of the program that called the library."""

import warnings

import numpy as np
import pytest

from hdc import HDCClassifier

X = np.random.default_rng(0).integers(0, 255, (12, 8, 8)).astype("u1")
Y = [0, 1] * 6
FLAT = np.full((3, 8, 8), 7, "u1")
TIED = np.where(X > 127, 255, 0).astype("u1")
MODEL = HDCClassifier().fit(X, Y)


def of(encoder="median", readout="majority"):
    return HDCClassifier(encoder, readout)


def saved_by_another_revision(path):
    model = of().fit(X, Y)
    model.encoder_.revision = 0
    model.save(path / "m")
    return HDCClassifier.load(path / "m")


WARNED = {
    "constant": (lambda _: MODEL.predict(FLAT), "constant frame"),
    "constant, deviation": (
        lambda _: of("deviation").fit([*X, *FLAT], [*Y, 0, 0, 1]),
        "constant",
    ),
    "ties": (lambda _: of().fit(TIED, Y), "equal its threshold"),
    "sets": (lambda _: MODEL.predict_set(X, 0.01), "no frame is refused"),
    "known": (lambda _: MODEL.is_known(X, 0.01), "no frame is refused"),
    "groups": (lambda _: of().fit(X, Y, groups=[0, 1] * 6), "groups: expected two"),
    "column": (lambda _: of().fit(X, np.c_[Y]), "column-vector"),
    "lda": (lambda _: of(readout="lda").fit(X[:2], [0, 1]), "nearest mean is learned"),
    "kernel": (
        lambda _: of(readout="kernel").fit(X[:2], [0, 1]),
        "nearest mean is learned",
    ),
    "recalibrate": (
        lambda _: of().fit(X, Y).recalibrate(X[:1], [0]),
        "no new frames of 1",
    ),
    "rezero": (
        lambda _: of("reference").fit(X, [0, 1, 2] * 4).rezero(X[:1]),
        "are put into 1 of 3 classes",
    ),
    "revision": (saved_by_another_revision, "made by revision 0"),
}


@pytest.mark.parametrize(("call", "text"), WARNED.values(), ids=WARNED)
def test_a_warning_names_the_line_of_the_caller(call, text, tmp_path):
    with warnings.catch_warnings(record=True, action="always") as found:
        call(tmp_path)
    assert any(text in str(warning.message) for warning in found)
    assert {warning.filename for warning in found} == {__file__}
