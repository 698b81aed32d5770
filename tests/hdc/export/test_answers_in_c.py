"""The exported header: compiled, it answers as Python does, bit for bit."""

import subprocess

import numpy as np
import pytest

from hdc import HDCClassifier
from hdc.encoders import Deviation, Levels, Median
from hdc.export import Plan, header
from hdc.readers import Window
from hdc.readouts import Majority, Trained
from tests.hdc.export.compiler import ENCODERS, run, trained_on

pytestmark = pytest.mark.filterwarnings(
    "ignore:.*constant frame", "ignore:.*order of pixels"
)

DRIVER = """
#include <stdio.h>
#include "touch.h"

static touch_pixel frame[TOUCH_PIXELS];
static touch_scratch scratch;

int main(void)
{
    while (fread(frame, sizeof frame, 1, stdin) == 1) {
        int64_t last[2];
        last[0] = touch_predict(&scratch, frame);
        last[1] = KNOWN;
        fwrite(scratch.hypervector, sizeof scratch.hypervector, 1, stdout);
        fwrite(scratch.scores, sizeof scratch.scores, 1, stdout);
        fwrite(last, sizeof last, 1, stdout);
    }
    return 0;
}
"""


def compiled(gcc, folder, plan, frames, *options):
    """What a compiled header says of N frames: words int64 [N, W], scores int64 [N, L], classes
    [N], and whether each is known [N]."""
    (folder / "touch.h").write_text(header(plan, "touch.h", "a test"))
    known = "1" if plan.alpha is None else "touch_known(&scratch)"
    pixels = np.ascontiguousarray(frames, f"uint{plan.pixel_bits}").tobytes()
    source = DRIVER.replace("KNOWN", known)
    found = run(gcc, folder, source, *options, given=pixels)
    answers = np.frombuffer(found, np.int64).reshape(len(frames), -1)
    width = plan.words
    words, scores, rest = np.split(answers, [width, width + len(plan.classes)], axis=1)
    return words, scores, *rest.T


# Bit by bit --------------------------------------------------------------------------------------

CASES = [
    *((e, "majority", d, t) for e in ENCODERS for d, t in ((65, "uint16"), (4097, "uint8"))),
    *((e, "majority", d, "uint8") for d in (1, 2, 63, 64) for e in (Levels(3), Deviation())),
    *((e, "lda", 4097, "uint8") for e in (Median(), Levels(3), Deviation())),
    (Median(), "trained", 4097, "uint8"),
    (Deviation(), "lda", 250_000, "uint16"),
]  # fmt: skip


@pytest.mark.parametrize(("encoder", "readout", "d", "dtype"), CASES, ids=repr)
def test_any_frame(encoder, readout, d, dtype, gcc, tmp_path, kinds_of_frames):
    """Constant frames, two grey levels, few, saturated ones, and the extremes of each type."""
    model, frames = trained_on(d, encoder, readout, dtype)
    extremes = np.full((2, d), [[0], [np.iinfo(dtype).max]], dtype)
    kinds = kinds_of_frames(d, dtype)[:: 1 if d < 250_000 else 9]
    queries = np.concatenate([kinds, extremes, frames[:8]])
    plan = Plan.of(model, "touch", 8 * np.dtype(dtype).itemsize)
    is_x86 = "x86" in subprocess.getoutput(f"{gcc} -dumpmachine")
    counting = ["-mpopcnt"] if is_x86 and readout == "lda" else []
    words, scores, classes, _ = compiled(gcc, tmp_path, plan, queries, *counting)
    expected = model.encode(queries)
    assert np.array_equal(words, expected.packed)
    assert np.array_equal(scores, model._head.scores(expected))
    assert np.array_equal(model.classes_[classes], model.predict(queries))
    assert len(np.unique(classes)) > 1 or d < 63
    if (d, readout) == (4097, "lda"):  # scores of lda need 64 bits
        assert np.abs(scores).max() > 2**31


CUT = """
#include <stdio.h>
#include "touch.h"

static touch_pixel image[9 * 14], frame[TOUCH_PIXELS];

int main(void)
{
    if (fread(image, sizeof image, 1, stdin) != 1)
        return 1;
    touch_window(image, 14, frame);
    fwrite(frame, sizeof frame, 1, stdout);
    return 0;
}
"""


def test_the_window_of_training_is_cut_out(gcc, tmp_path):
    window, rng = Window((2, 1, 11, 7), 2), np.random.default_rng(0)
    image = rng.integers(0, 256, (9, 14), np.uint8)
    frames = rng.integers(0, 256, (4, *window.shape(9, 14)), np.uint8)
    model = HDCClassifier().fit(frames, [0, 1, 0, 1])
    text = header(Plan.of(model, "touch", window=window), "touch.h", "a test")
    (tmp_path / "touch.h").write_text(text)
    found = run(gcc, tmp_path, CUT, given=image.tobytes())
    assert found == window.of(image).tobytes()


# Rejection ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "encoder", [Median(), Levels(3, lit=0.9), Deviation()], ids=repr
)
@pytest.mark.parametrize(
    "readout",
    ["majority", Majority(class_weight="balanced"), "lda", Trained(margin=0.5)],
    ids=repr,
)
@pytest.mark.parametrize("grouped", [False, True])
def test_every_form_refuses_the_frames_that_python_refuses(
    encoder, readout, grouped, gcc, tmp_path
):
    rng = np.random.default_rng(1)
    base = rng.integers(0, 150, (3, 2000))

    def of(classes):
        noise = rng.integers(0, 90, (len(classes), 2000))
        return (base[classes] + noise).astype(np.uint8)

    labels = np.repeat([0, 1, 2], [19, 27, 11])  # balanced, prototypes are thinned
    groups = np.arange(57) % 5 if grouped else None
    model = HDCClassifier(encoder, readout).fit(of(labels), labels, groups=groups)
    plan = Plan.of(model, "touch", alpha=0.2)
    queries = of(np.arange(150) % 3)
    queries[90:, :400] = rng.integers(0, 256, (60, 400))
    queries[130:] = rng.integers(0, 256, (20, 2000))
    known = model.is_known(queries, 0.2)
    assert known[:90].mean() > 0.5
    assert not known[130:].any()
    *_, answers = compiled(gcc, tmp_path, plan, queries)
    assert np.array_equal(answers.astype(bool), known)
    assert ("majority" in plan.tables) != (readout == "majority")
    text = (tmp_path / "touch.h").read_text()
    assert "#define TOUCH_REJECTION 2 " in text
    assert ("Whole groups were" in text) == grouped


def test_too_few_frames_refuse_none_and_say_so():
    model, _ = trained_on(100, classes=2)
    with pytest.warns(
        UserWarning, match=r"99 training .*, found 16; no frame is refused"
    ):
        plan = Plan.of(model, "touch", alpha=0.01)
    assert plan.farthest >= 100
