"""Words and files of version 2.0 and 3.0."""

from __future__ import annotations

import pytest

from hdc import HDCClassifier
from hdc.export import Plan
from tests.hdc.net import models
from tests.hdc.net.frames import frames_of
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


@pytest.mark.parametrize("form", ["quantile, ridge", "levels, lda"])
def test_a_file_of_version_2_0_says_where_it_lacks_scores_of_left_out_frames(form):
    model = HDCClassifier.load(models.FOLDER / "2.0.0" / f"{form}.hdc")
    with pytest.raises(ValueError, match=r"saved by version 2\.0, of .*; fit anew"):
        model.predict_set(frames_of("uint8", 3)[0], 0.2)
