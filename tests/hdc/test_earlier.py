"""Words and files of version 2.0 and 3.0."""

from __future__ import annotations

import numpy as np
import pytest

from hdc import HDCClassifier, io
from hdc.export import Plan
from tests.hdc.speckle import Speckle


def test_words_of_version_2_0_name_those_of_today():
    frames, labels = Speckle(0).frames(50)
    model = HDCClassifier("reference").fit(frames, labels)
    for call, message in (
        (lambda: model.predict(frames, reject=True), r"predict: expected is_known\("),
        (lambda: model.is_known(frames, reject=0.1), "is_known: expected alpha, found"),
        (lambda: Plan.of(model, "touch", reject=0.1), "of: expected alpha, found"),
    ):
        with pytest.raises(TypeError, match=f"^{message}") as caught:
            call()
        assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match=r"^recalibrate: .*labels: rezero\(frames\)$"):
        model.recalibrate(frames)


@pytest.mark.parametrize("readout", ["majority", "neighbours", "ridge", "lda"])
def test_a_file_of_version_2_0_predicts_and_says_where_it_lacks_scores(
    readout, tmp_path
):
    """Such a file has the sharpness of probabilities, and no scores of left-out frames."""
    speckle = Speckle(0)
    model = HDCClassifier(readout=readout).fit(*speckle.frames(50))
    queries, _ = speckle.frames(30)
    model.save(tmp_path / "m")
    header, tensors = io.read_model(tmp_path / "m")
    old = {k: v for k, v in tensors.items() if not k.startswith("held_out.")}
    assert (len(old) < len(tensors)) == (readout in ("ridge", "lda"))
    header["sharpness"] = None
    if len(old) < len(tensors):
        header["sharpness"] = model._head.sharpness
    io.write_model(tmp_path / "m", header, old, lambda *_: None)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert np.array_equal(loaded.predict(queries), model.predict(queries))
    assert np.array_equal(loaded.predict_proba(queries), model.predict_proba(queries))
    expected = model.is_known(queries, 0.2)
    assert np.array_equal(loaded.is_known(queries, 0.2), expected)
    if len(old) < len(tensors):
        with pytest.raises(ValueError, match=r"saved by version 2\.0, of .*; fit anew"):
            loaded.predict_set(queries, 0.2)
