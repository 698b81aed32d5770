"""The exported header: compiled, it answers as Python does, bit for bit."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, bits
from hdc.encoders import Deviation, Encoder, Levels, Median, Quantile, Smoothed
from hdc.export import Plan, Sizes, header
from hdc.readers import Window
from hdc.readouts import Majority

pytestmark = pytest.mark.filterwarnings("ignore:.*constant frame", "ignore:.*ties=")

PAGE = Path(__file__).parents[2] / "docs" / "export.md"
STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow"]

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


ANSWER = """
#include "touch.h"

int answer(touch_scratch *s, const touch_pixel *frame);

int answer(touch_scratch *s, const touch_pixel *frame)
{
    int found = touch_predict(s, frame);

    return touch_known(s) ? found : -1;
}
"""


@pytest.fixture(scope="module")
def gcc():
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("no C compiler here: looked for gcc")
    return found


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
    (folder / "driver.c").write_text(DRIVER.replace("KNOWN", known))
    command = [gcc, "-std=c99", "-O1", *STRICT, *options, "-o", "driver", "driver.c"]
    subprocess.run(command, cwd=folder, check=True)
    pixels = np.ascontiguousarray(frames, f"uint{plan.sizes.pixel_bits}")
    done = subprocess.run(
        [folder / "driver"], input=pixels.tobytes(), capture_output=True, check=True
    )
    answers = np.frombuffer(done.stdout, np.int64).reshape(len(frames), -1)
    width, n_classes = plan.sizes.words, plan.sizes.classes
    assert answers.shape[1] == width + n_classes + 2
    return Answers(
        words=answers[:, :width].view(np.uint64),
        scores=answers[:, width : width + n_classes],
        classes=answers[:, -2],
        known=answers[:, -1],
    )


def trained_on(d, encoder="median", readout="majority", dtype="uint8", classes=4):
    """A model of frames [N, D] of classes that differ."""
    rng = np.random.default_rng(d)
    labels = np.arange(8 * classes) % classes
    scale = 1 if dtype == "uint8" else 200
    base = rng.integers(0, 150 * scale, (classes, d))
    frames = base[labels] + rng.integers(0, 90 * scale, (len(labels), d))
    frames = frames.astype(dtype)
    return HDCClassifier(encoder, readout).fit(frames, labels), frames


def assert_equal_to_python(answers, model, frames):
    words = model.encode(frames)
    scores = model._head.scores(words).numpy()
    assert np.array_equal(answers.words, words.packed.numpy().view(np.uint64))
    assert np.array_equal(answers.scores, scores)
    assert np.array_equal(model.classes_[answers.classes], model.predict(frames))


# Bit by bit --------------------------------------------------------------------------------------

ENCODERS = [
    Median(),
    Median("raster"),
    Median("below"),
    Quantile("9/10"),
    Levels(3),
    Levels(2, ties="raster"),
    Levels(2, lit=0.9),
    Deviation(),
    Deviation([-0.7, "1/3"]),
]


@pytest.mark.parametrize(("d", "dtype"), [(65, "uint16"), (4097, "uint8")])
@pytest.mark.parametrize("encoder", ENCODERS, ids=repr)
def test_any_frame_with_any_ties(encoder, d, dtype, gcc, tmp_path, kinds_of_frames):
    """Constant frames, two grey levels, few, saturated ones, and the extremes of each type."""
    model, frames = trained_on(d, encoder, dtype=dtype)
    extremes = np.full((2, d), [[0], [np.iinfo(dtype).max]], dtype)
    queries = np.concatenate([kinds_of_frames(d, dtype), extremes, frames[:3]])
    plan = Plan.of(model, "touch", 8 * np.dtype(dtype).itemsize)
    answers = compiled(gcc, tmp_path, plan, queries)
    assert_equal_to_python(answers, model, queries)
    assert len(np.unique(answers.classes)) > 1


@pytest.mark.parametrize(
    "encoder", [Median("below"), Levels(2, lit=0.9), Deviation()], ids=repr
)
def test_compilers_of_cpp_have_nothing_to_say(encoder, tmp_path):
    gpp = shutil.which("g++")
    if gpp is None:
        pytest.skip("no C++ compiler here: looked for g++")
    model, _ = trained_on(100, encoder)
    plan = Plan.of(model, "touch", alpha=0.2)
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a test"))
    (tmp_path / "sketch.cpp").write_text(ANSWER)
    strict = [*STRICT, "-Wold-style-cast", "-Wuseless-cast"]
    command = [gpp, "-std=c++17", *strict, "-c", "-o", "sketch.o", "sketch.cpp"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("d", "encoder"),
    [*((d, Levels(3)) for d in (1, 2, 63, 64)), (1, Deviation()), (64, Deviation())],
    ids=repr,
)
def test_few_pixels(d, encoder, gcc, tmp_path, kinds_of_frames):
    model, _ = trained_on(d, encoder)
    queries = kinds_of_frames(d)
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), queries)
    assert_equal_to_python(answers, model, queries)


def test_variances_are_rounded_down(gcc, tmp_path, variance_below_one):
    encoder, frame = variance_below_one
    model = HDCClassifier(encoder, "majority").fit(frame.repeat(2, 1), [0, 1])
    model.encoder_.reference_ = encoder.reference_
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), frame.numpy())
    assert_equal_to_python(answers, model, frame.numpy())


@pytest.mark.parametrize("readout", ["majority", "trained", "lda"])
@pytest.mark.parametrize(
    ("encoder", "options"),
    [(Median(), ()), (Levels(3), ("-mpopcnt",)), (Deviation(), ())],
    ids=repr,
)
def test_any_readout(readout, encoder, options, gcc, tmp_path, kinds_of_frames):
    """With the machine's instruction for counting ones, too, where it is one of x86."""
    if options and "x86" not in subprocess.getoutput(f"{gcc} -dumpmachine"):
        pytest.skip("-mpopcnt is for x86")
    model, frames = trained_on(4097, encoder, readout)
    queries = np.concatenate([kinds_of_frames(4097), frames])
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), queries, *options)
    assert_equal_to_python(answers, model, queries)
    assert len(np.unique(answers.classes)) == 4


@pytest.mark.parametrize(
    ("encoder", "readout", "dtype"),
    [
        ("median", "majority", "uint8"),
        ("deviation", "lda", "uint16"),
    ],
)
def test_a_camera_of_250000_pixels(
    encoder, readout, dtype, gcc, tmp_path, camera_frames
):
    frames = camera_frames(6, dtype=dtype)
    model = HDCClassifier(encoder, readout).fit(frames[:4], np.arange(4) % 2)
    plan = Plan.of(model, "touch", 8 * np.dtype(dtype).itemsize)
    constant = np.full((1, 500, 500), 7, dtype)
    two_valued = np.where(frames[:1] > 100, 200, 3).astype(dtype)
    queries = np.concatenate([frames, constant, two_valued])
    assert_equal_to_python(compiled(gcc, tmp_path, plan, queries), model, queries)


def test_scores_of_lda_need_64_bits(gcc, tmp_path):
    model, frames = trained_on(4097, readout="lda")
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), frames)
    assert np.abs(answers.scores).max() > 2**31
    assert_equal_to_python(answers, model, frames)


def test_of_equal_scores_the_first_wins(gcc, tmp_path):
    frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2]] * 2, np.uint8)
    model = HDCClassifier().fit(frames, [0, 1, 2, 3])
    answers = compiled(gcc, tmp_path, Plan.of(model, "touch"), frames)
    assert (answers.scores == answers.scores[:, :1]).all()
    assert (answers.classes == 0).all()


def test_classes_without_frames_are_left_out(gcc, tmp_path):
    _, frames = trained_on(70)
    labels = np.array(["b", "d"])[np.arange(len(frames)) % 2]
    model = HDCClassifier().partial_fit(frames, labels, classes=list("abcd"))
    plan = Plan.of(model, "touch")
    assert (plan.classes, plan.left_out) == (("b", "d"), ("a", "c"))
    answers = compiled(gcc, tmp_path, plan, frames)
    assert np.array_equal(
        np.array(plan.classes)[answers.classes], model.predict(frames)
    )


def test_the_window_of_training_is_cut_out(gcc, tmp_path):
    window = Window((2, 1, 11, 7), 2)
    image = np.random.default_rng(0).integers(0, 256, (9, 14), np.uint8)
    frames = np.stack([window.of(np.roll(image, k, 1)) for k in range(4)])
    model = HDCClassifier().fit(frames, [0, 1, 2, 3])
    plan = Plan.of(model, "touch", window=window)
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a test"))
    pixels = ", ".join(str(p) for p in image.flatten())
    (tmp_path / "window.c").write_text(f"""
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
""")
    command = [gcc, "-std=c99", *STRICT, "-o", "window", "window.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "window"], capture_output=True, check=True)
    found = np.frombuffer(done.stdout, np.uint8).reshape(plan.frame_shape)
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


@pytest.mark.parametrize("readout", ["trained", "lda"])
def test_a_rejection_of_other_read_outs_is_refused(readout):
    """Their files have no frames to compare with."""
    model, _ = trained_on(100, "median", readout)
    with pytest.raises(ValueError, match=r"^alpha: expected the read-out majority, wh"):
        Plan.of(model, "touch", alpha=0.2)


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


# What it is made of ------------------------------------------------------------------------------


def sample_plans():
    for encoder in ENCODERS:
        for pixel_bits in (8, 16):
            model, _ = trained_on(130, encoder)
            yield Plan.of(model, "touch", pixel_bits, alpha=0.2)


def test_no_floating_point_no_allocation_no_library_and_little_code(gcc, tmp_path):
    """2 KB with -Os; the rest of what `size` calls text are tables and names."""
    for plan in sample_plans():
        text = header(plan, "touch.h", "a test")
        assert not re.search(r"float|double|malloc|calloc", text)
        assert re.findall(r"#include.*", text) == ["#include <stdint.h>"]
        (tmp_path / "touch.h").write_text(text)
        (tmp_path / "touch.c").write_text(ANSWER)
        command = [gcc, "-std=c99", "-Os", "-ffreestanding", *STRICT, "-c", "touch.c"]
        subprocess.run(command, cwd=tmp_path, check=True)

        def asked(*words):
            command = [*words, "touch.o"]
            return subprocess.check_output(command, cwd=tmp_path, text=True)

        assert asked("nm", "-u") == ""
        text, data, bss = (int(n) for n in asked("size").split()[6:9])
        assert (data, bss) == (0, 0)
        assert plan.sizes.constant_bytes < text < plan.sizes.constant_bytes + 2048


def test_sizes_are_those_of_the_compiler(gcc, tmp_path):
    for plan in sample_plans():
        text = header(plan, "touch.h", "a test")
        names = re.findall(r"^static const u?int\d+_t (\w+)\[", text, re.MULTILINE)
        (tmp_path / "touch.h").write_text(text)
        total = " + ".join(f"sizeof {name}" for name in names)
        (tmp_path / "sizes.c").write_text(
            '#include <stdio.h>\n#include "touch.h"\n'
            "int main(void)\n{\n"
            f'    printf("%zu %zu", {total}, TOUCH_SCRATCH_BYTES);\n    return 0;\n}}\n'
        )
        command = [gcc, "-std=c99", "-O1", "-o", "sizes", "sizes.c"]
        subprocess.run(command, cwd=tmp_path, check=True)
        done = subprocess.run([tmp_path / "sizes"], capture_output=True, check=True)
        constants, scratch = (int(n) for n in done.stdout.split())
        assert constants == plan.sizes.constant_bytes
        assert scratch == plan.sizes.scratch_bytes


CASES = [
    (
        "100 × 100 × 8 bits, 10 classes, median, majority",
        Sizes(10_000, 10_000, 8, 1, 10),
    ),
    (
        "500 × 500 × 8 bits, 10 classes, median, majority",
        Sizes(250_000, 250_000, 8, 1, 10),
    ),
    ("the same with 16 bits", Sizes(250_000, 250_000, 16, 1, 10)),
    (
        "100 × 100 × 8 bits, 10 classes, levels (7), majority",
        Sizes(10_000, 10_000, 8, 7, 10),
    ),
    (
        "100 × 100 × 8 bits, 10 classes, median, lda",
        Sizes(10_000, 10_000, 8, 1, 10, planes=4),
    ),
]


def test_the_table_of_the_page_is_computed():
    page = PAGE.read_text(encoding="utf-8")
    for what, sizes in CASES:
        numbers = (
            sizes.constant_bytes,
            sizes.scratch_bytes,
            sizes.frame_bytes,
            sizes.pixel_steps,
            sizes.word_steps,
        )
        row = " | ".join([what, *(f"{number:,}" for number in numbers)])
        assert f"| {row} |\n" in page, f"| {row} |"


def test_programs_of_the_page_compile(tmp_path):
    """The C++ program whole; of the ROS 2 node what is ours, as no ROS is here."""
    if shutil.which("g++") is None:
        pytest.skip("no compiler here: looked for g++")
    window = Window((0, 0, 16, 16), 2)
    frames = np.random.default_rng(0).integers(0, 256, (40, 8, 8), np.uint8)
    model = HDCClassifier().fit(frames, np.arange(40) % 2)
    plan = Plan.of(model, "touch", alpha=0.1, window=window)
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a test"))
    programs = re.findall(r"```cpp\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(programs) == 2
    (tmp_path / "program.cpp").write_text(programs[0])
    command = ["g++", "-std=c++11", *STRICT[:4], "-o", "program", "program.cpp"]
    subprocess.run(command, cwd=tmp_path, check=True)
    (tmp_path / "frames.raw").write_bytes(np.ascontiguousarray(frames[:3]).tobytes())
    done = subprocess.run(
        [tmp_path / "program", "frames.raw"],
        cwd=tmp_path,
        capture_output=True,
        check=True,
    )
    known = model.is_known(frames[:3], 0.1)
    found = np.where(known, model.predict(frames[:3]).astype(str), "")
    assert done.stdout.decode().splitlines() == found.tolist()
    used = set(re.findall(r"\b(?:touch|TOUCH)_\w+", programs[1]))
    written = (tmp_path / "touch.h").read_text()
    assert used
    for name in used:
        assert re.search(rf"\b{name}\b", written), name


def test_names_of_any_kind(gcc, tmp_path):
    names = ['a "b" \\', "??/", "ü\t", "*/ /*", "1" * 60]
    frames = np.random.default_rng(0).integers(0, 256, (5, 64), np.uint8)
    plan = Plan.of(HDCClassifier().fit(frames, names), "touch")
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a */ /* test\n#error"))
    (tmp_path / "names.c").write_text(
        '#include <stdio.h>\n#include "touch.h"\nint main(void)\n{\n'
        "    for (int c = 0; c < TOUCH_CLASSES; c++) {\n"
        "        fputs(touch_classes[c], stdout);\n        fputc(0, stdout);\n    }\n"
        "    return 0;\n}\n"
    )
    command = [gcc, "-std=c99", *STRICT, "-o", "names", "names.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "names"], capture_output=True, check=True)
    assert done.stdout.decode().split("\0")[:-1] == sorted(names)


# Refusals ----------------------------------------------------------------------------------------


class Bright(Encoder):
    def __init__(self):
        pass

    def encode(self, frames):
        return bits.pack(frames.flatten(1) > 127)


class Shifted(Majority):
    pass


@pytest.mark.parametrize(
    ("encoder", "readout", "message"),
    [
        (
            "reference",
            "majority",
            "expected the encoder median, quantile, levels or dev",
        ),
        (Bright(), "majority", "expected the encoder median, quantile, levels or dev"),
        ("median", "counts", "cosines of which need roots"),
        ("median", "ridge", "weights of which are no whole numbers"),
        ("median", "neighbours", "keeps every training frame"),
        ("median", "kernel", "keeps every training frame"),
        ("median", Shifted(), "which export does not know"),
    ],
    ids=str,
)
def test_what_is_not_exported_is_refused_with_the_reason(encoder, readout, message):
    model, _ = trained_on(65, encoder, readout)
    with pytest.raises(ValueError, match=message):
        Plan.of(model, "touch")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": "1"}, "name: expected letters"),
        ({"pixel_bits": 12}, "bits: expected one of 8, 16, found 12"),
        ({"alpha": 1.0}, r"alpha: expected a share in \(0, 1\), found 1.0"),
        ({"alpha": 0.0}, r"alpha: expected a share in \(0, 1\), found 0.0"),
    ],
    ids=str,
)
def test_settings_that_are_not_allowed(settings, message):
    model, _ = trained_on(65)
    with pytest.raises(ValueError, match=message):
        Plan.of(model, **{"name": "touch", **settings})


def test_smoothing_is_not_exported():
    frames = np.random.default_rng(0).integers(0, 256, (6, 8, 9), np.uint8)
    model = HDCClassifier(Smoothed("deviation", 1), "lda").fit(frames, [0, 1] * 3)
    with pytest.raises(ValueError, match=r"expected the encoder .* found Smoothed"):
        Plan.of(model, "touch")


def test_frames_too_large_for_sums_of_64_bits_are_refused():
    encoder = Deviation([0])
    model, _ = trained_on(65, encoder)
    model.n_features_in_ = 2**21 + 1
    with pytest.raises(ValueError, match="at most 2097152 pixels of 16 bits with the"):
        Plan.of(model, "touch", 16)


def test_a_regressor_and_an_untrained_model_are_refused():
    frames = np.random.default_rng(0).integers(0, 256, (9, 64), np.uint8)
    values = HDCRegressor().fit(frames, np.arange(9.0))
    with pytest.raises(ValueError, match="expected a classifier, found HDCRegressor"):
        Plan.of(values, "touch")
    with pytest.raises(ValueError, match="expected a trained model"):
        Plan.of(HDCClassifier(), "touch")


# The command -------------------------------------------------------------------------------------


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "m.safetensors"
    trained_on(130)[0].save(path, {"crop": None, "subsample": 2})
    return path


@pytest.mark.parametrize(
    ("compiler", "pixel_bits"),
    [
        (("gcc", "-std=c99", "-O0"), 8),
        (("gcc", "-std=c99", "-O3"), 16),
        (("g++", "-std=c++11", "-O3", "-x", "c++"), 8),
    ],
)
def test_test_vectors_agree_and_notice_a_change(
    compiler, pixel_bits, model, tmp_path, hdc
):
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"no compiler here: looked for {compiler[0]}")
    target = tmp_path / "my-touch.h"
    words = ("--bits", pixel_bits, "--reject", 0.2, "--test-vectors", 9)
    status, out, err = hdc("export", model, "-o", target, *words)
    assert (status, err) == (0, [])
    assert out == [
        f"classes: 4, frames of 130 pixels of {pixel_bits} bits, 130 bits compared",
        f"tables: {8 * 3 * 4 + 4 + 8 * 4} bytes",
        f"memory: {8 * 3 + 8 * 4 + (pixel_bits // 8) * 1024 + 256} bytes, and "
        f"{130 * pixel_bits // 8} of the frame",
        f"operations a frame: {130 * (2 + pixel_bits // 8)} of a pixel, 12 of a word of 64 bits",
        f"{target}: written",
        f"{tmp_path / 'my-touch_test.c'}: written, 9 frames",
    ]
    command = [*compiler, *STRICT, "-o", "vectors", "my-touch_test.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "vectors"], check=False).returncode == 0
    text = target.read_text()
    start = text.index("my_touch_prototypes")
    word = re.search("0x[0-9a-f]{16}", text[start:])[0]
    for before, after in ((word, f"0x{int(word, 16) ^ 1:016x}"), (">> 26", ">> 25")):
        assert before not in text[:start]
        target.write_text(text.replace(before, after, 1))
        subprocess.run(command, cwd=tmp_path, check=True)
        assert subprocess.run([tmp_path / "vectors"], check=False).returncode > 0


def test_only_own_files_are_replaced(model, tmp_path, hdc):
    target, vectors = tmp_path / "touch.h", tmp_path / "touch_test.c"
    vectors.write_text("int main(void) { return 0; }")
    status, _, err = hdc("export", model, "-o", target, "--test-vectors", 1)
    assert (status, len(err)) == (1, 1)
    assert str(vectors) in err[0]
    assert not target.exists()
    vectors.unlink()
    for _ in range(2):
        assert hdc("export", model, "-o", target, "--test-vectors", 1)[0] == 0
    first = target.read_text()
    assert hdc("export", model, "-o", target)[0] == 0
    assert target.read_text() == first
    target.write_text("mine")
    assert hdc("export", model, "-o", target)[0] == 1
    assert target.read_text() == "mine"


@pytest.mark.parametrize("name", ["touch.txt", "1.h", "nowhere/touch.h"])
def test_other_names_of_a_header_are_refused_in_one_line(name, model, tmp_path, hdc):
    status, out, err = hdc("export", model, "-o", tmp_path / name)
    assert (status, out, len(err)) == (1, [], 1)
    assert "expected" in err[0]


def test_the_file_of_a_model_is_named_in_refusals(tmp_path, hdc):
    path = tmp_path / "m.safetensors"
    trained_on(65, readout="ridge")[0].save(path)
    status, out, err = hdc("export", path, "-o", tmp_path / "touch.h")
    assert (status, out, len(err)) == (1, [], 1)
    assert err[0].startswith(f"error: {path}: export: expected the read-out majority")
    assert not (tmp_path / "touch.h").exists()
