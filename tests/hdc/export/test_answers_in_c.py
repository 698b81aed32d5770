"""The exported header: compiled, it answers as Python does, bit for bit."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.encoders import Deviation, Levels, Median
from hdc.export import Plan, header
from hdc.readers import Window
from hdc.readouts import Majority
from tests.hdc.export.compiler import ENCODERS, run, trained_on

pytestmark = pytest.mark.filterwarnings("ignore:.*constant frame", "ignore:.*ties=")

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


@dataclass(frozen=True)
class Answers:
    """What a compiled header says of N frames."""

    words: np.ndarray  # uint64 [N, W]
    scores: np.ndarray  # int64 [N, L]
    classes: np.ndarray  # int64 [N]
    known: np.ndarray  # int64 [N]


def compiled(gcc, folder, plan, frames, *options):
    """The answers of a header made of a plan, by way of a compiler."""
    (folder / "touch.h").write_text(header(plan, "touch.h", "a test"))
    known = "1" if plan.share is None else "touch_known(&scratch)"
    pixels = np.ascontiguousarray(frames, f"uint{plan.sizes.pixel_bits}").tobytes()
    source = DRIVER.replace("KNOWN", known)
    found = run(gcc, folder, source, *options, given=pixels)
    answers = np.frombuffer(found, np.int64).reshape(len(frames), -1)
    width, n_classes = plan.sizes.words, plan.sizes.classes
    assert answers.shape[1] == width + n_classes + 2
    return Answers(
        words=answers[:, :width].view(np.uint64),
        scores=answers[:, width : width + n_classes],
        classes=answers[:, -2],
        known=answers[:, -1],
    )


def assert_equal_to_python(answers, model, frames):
    words = model.encode(frames)
    scores = model._head.scores(words).numpy()
    assert np.array_equal(answers.words, words.packed.numpy().view(np.uint64))
    assert np.array_equal(answers.scores, scores)
    assert np.array_equal(model.classes_[answers.classes], model.predict(frames))


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
    answers = compiled(gcc, tmp_path, plan, queries, *counting)
    assert_equal_to_python(answers, model, queries)
    assert len(np.unique(answers.classes)) > 1 or d < 63
    if (d, readout) == (4097, "lda"):  # scores of lda need 64 bits
        assert np.abs(answers.scores).max() > 2**31


def test_of_equal_scores_the_first_wins(gcc, tmp_path):
    frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2]] * 2, np.uint8)
    model = HDCClassifier().fit(frames, [0, 1, 2, 3])
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), frames)
    assert (answers.scores == answers.scores[:, :1]).all()
    assert (answers.classes == 0).all()


def test_the_window_of_training_is_cut_out(gcc, tmp_path):
    window = Window((2, 1, 11, 7), 2)
    image = np.random.default_rng(0).integers(0, 256, (9, 14), np.uint8)
    frames = np.stack([window.of(np.roll(image, k, 1)) for k in range(4)])
    model = HDCClassifier().fit(frames, [0, 1, 2, 3])
    plan = Plan.of(model, "touch", window=window)
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a test"))
    pixels = ", ".join(str(p) for p in image.flatten())
    source = f"""
#include <stdio.h>
#include "touch.h"
static const touch_pixel image[] = {{{pixels}}};
static touch_pixel frame[TOUCH_PIXELS];
int main(void)
{{
    touch_window(image, 14, frame);
    fwrite(frame, sizeof frame, 1, stdout);
    return 0;
}}
"""
    found = np.frombuffer(run(gcc, tmp_path, source), np.uint8)
    found = found.reshape(plan.frame_shape)
    assert np.array_equal(found, frames[0])


# Rejection ---------------------------------------------------------------------------------------


def leave_one_out(words, index):
    """Distance of a frame to the majority of the others, by counting."""
    others = np.delete(words, index, axis=0)
    majority = 2 * others.sum(0) > len(others)
    return int((majority != words[index]).sum())


@pytest.mark.parametrize("unequal", [False, True])
def test_rejection_by_distances_of_left_out_frames(unequal, gcc, tmp_path):
    d, rng = 2000, np.random.default_rng(1)
    labels = np.arange(57) % 3
    if unequal:
        labels[labels == 2] = np.arange(19) % 4 // 3  # nearly all go to class 0
        labels[:11] = 2
    base = rng.integers(0, 150, (3, d))

    def of(classes):
        return (base[classes] + rng.integers(0, 90, (len(classes), d))).astype(np.uint8)

    frames = of(labels)
    balanced = Majority(class_weight="balanced")  # thinned, where classes are unequal
    model = HDCClassifier(readout=balanced).fit(frames, labels)
    plan = Plan.of(model, "touch", alpha=0.2)
    junk = rng.integers(0, 256, (20, d), np.uint8)
    queries = np.concatenate([of(np.arange(60) % 3), junk])
    answers = compiled(gcc, tmp_path, plan, queries)

    masks = bits.unpack(model.encoder_.encode(torch.from_numpy(frames)), d).numpy()
    asked = bits.unpack(model.encoder_.encode(torch.from_numpy(queries)), d).numpy()
    expected = np.zeros(len(queries), bool)
    for c in range(3):
        own, n = masks[labels == c], (labels == c).sum()
        kept = model._head.sample.kept[c]
        places = [
            next(
                i for i in range(n) if (bits.pack(torch.from_numpy(own[i])) == k).all()
            )
            for k in kept
        ]
        distances = sorted((leave_one_out(own, i) for i in places), reverse=True)
        threshold = distances[int((len(places) + 1) / 5) - 1]
        assert plan.tables["thresholds"][c] == threshold
        majority = 2 * own.sum(0) > n
        expected |= (asked != majority).sum(1) <= threshold
    assert np.array_equal(answers.known.astype(bool), expected)
    assert not answers.known[60:].any()
    agreement = answers.known.astype(bool) == model.is_known(queries, 0.2)
    assert agreement.mean() >= 0.9
    assert ("majority" in plan.tables) == unequal


def test_few_frames_of_a_class_are_judged_with_those_of_others():
    model, frames = trained_on(500)  # 8 frames of each of 4 classes: 1/9 > 0.05 > 1/33
    plan = Plan.of(model, "touch", alpha=0.05)
    held_out = []
    masks = bits.unpack(model.encoder_.encode(torch.from_numpy(frames)), 500).numpy()
    for c in range(4):
        of_class = [leave_one_out(masks[c::4], i) for i in range(8)]
        held_out += [of_class]
    means = [sum(own) / 8 for own in held_out]
    farthest = max(
        d - mean for own, mean in zip(held_out, means, strict=True) for d in own
    )
    expected = [int(mean + farthest) for mean in means]
    assert plan.tables["thresholds"].tolist() == expected


def test_too_few_frames_refuse_none_and_say_so():
    model, _ = trained_on(100, classes=2)
    with pytest.warns(
        UserWarning, match="expected .* 99 in all, found 16; no frame is"
    ):
        plan = Plan.of(model, "touch", alpha=0.01)
    assert plan.tables["thresholds"].tolist() == [100, 100]
