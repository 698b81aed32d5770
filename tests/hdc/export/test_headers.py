"""An exported header: its contents and sizes, what is refused, and the command."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Deviation, Smoothed
from hdc.export import Plan, header
from hdc.readers import Window
from hdc.readouts import Majority
from tests.hdc.export.compiler import ENCODERS, STRICT, run, trained_on

pytestmark = pytest.mark.filterwarnings(
    "ignore:.*constant frame", "ignore:.*order of pixels"
)

PAGE = Path(__file__).parents[3] / "docs" / "export.md"

ANSWER = """
#include "touch.h"

int answer(touch_scratch *s, const touch_pixel *frame);

int answer(touch_scratch *s, const touch_pixel *frame)
{
    int found = touch_predict(s, frame);

    return touch_known(s) ? found : -1;
}
"""


# What it is made of ------------------------------------------------------------------------------

SIZES = """#include <stdio.h>
#include "touch.h"
int main(void)
{
    printf("%zu %zu", TABLES, TOUCH_SCRATCH_BYTES);
    return 0;
}
"""


@pytest.mark.parametrize("encoder", ENCODERS[::2], ids=repr)
def test_no_floating_point_no_library_and_the_sizes_that_are_said(
    encoder, gcc, tmp_path
):
    """2 KB of code with -Os; the rest of what `size` calls text are tables and names."""
    plan = Plan.of(trained_on(130, encoder)[0], "touch", 16, alpha=0.2)
    text = header(plan, "touch.h", "a test")
    assert not re.search(r"float|double|malloc|calloc", text)
    assert re.findall(r"#include.*", text) == ["#include <stdint.h>"]
    (tmp_path / "touch.h").write_text(text)
    (tmp_path / "touch.c").write_text(ANSWER)
    names = re.findall(r"^static const u?int\d+_t (\w+)\[", text, re.MULTILINE)
    tables = " + ".join(f"sizeof {name}" for name in names)

    def asked(*words):
        return subprocess.check_output(words, cwd=tmp_path, text=True)

    asked(gcc, "-std=c99", "-Os", "-ffreestanding", *STRICT, "-c", "touch.c")
    assert asked("nm", "-u", "touch.o") == ""
    code, data, bss = (int(n) for n in asked("size", "touch.o").split()[6:9])
    constants = plan.constant_bytes
    assert (data, bss) == (0, 0)
    assert constants < code < constants + 2048
    said = run(gcc, tmp_path, SIZES.replace("TABLES", tables))
    assert said.decode() == f"{constants} {plan.scratch_bytes}"


PAGE_ROWS = {
    "100 × 100 × 8 bits, 10 classes, median, majority": (100, 8, "median", "majority"),
    "500 × 500 × 8 bits, 10 classes, median, majority": (500, 8, "median", "majority"),
    "500 × 500 × 16 bits, 10 classes, median, majority": (500, 16, "median", "majority"),
    "100 × 100 × 8 bits, 10 classes, levels (7), majority": (100, 8, "levels", "majority"),
    "100 × 100 × 8 bits, 10 classes, median, lda": (100, 8, "median", "lda"),
}  # fmt: skip


@pytest.mark.parametrize("what", PAGE_ROWS)
def test_the_table_of_the_page_is_computed(what):
    page = PAGE.read_text(encoding="utf-8")
    side, pixel_bits, encoder, readout = PAGE_ROWS[what]
    frames = np.random.default_rng(0).integers(0, 256, (20, side, side), np.uint8)
    model = HDCClassifier(encoder, readout).fit(frames, np.arange(20) % 10)
    plan = Plan.of(model, "touch", pixel_bits)
    numbers = plan.constant_bytes, plan.scratch_bytes, plan.frame_bytes
    row = " | ".join([what, *(f"{number:,}" for number in numbers)])
    assert f"| {row} |\n" in page


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
    command = [tmp_path / "program", "frames.raw"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    known = model.is_known(frames[:3], 0.1)
    found = np.where(known, model.predict(frames[:3]).astype(str), "")
    assert done.stdout.decode().splitlines() == found.tolist()
    used = {*re.findall(r"\b(?:touch|TOUCH)_\w+", programs[1])}
    assert used
    assert used <= {*re.findall(r"\w+", (tmp_path / "touch.h").read_text())}


CLASS_NAMES = """#include <stdio.h>
#include "touch.h"
int main(void)
{
    for (int c = 0; c < TOUCH_CLASSES; c++) {
        fputs(touch_classes[c], stdout);
        fputc(0, stdout);
    }
    return 0;
}
"""


def test_names_of_any_kind(gcc, tmp_path):
    names = ['a "b" \\', "??/", "ü\t", "*/ /*", "1" * 60]
    frames = np.random.default_rng(0).integers(0, 256, (5, 64), np.uint8)
    plan = Plan.of(HDCClassifier().fit(frames, names), "touch")
    (tmp_path / "touch.h").write_text(header(plan, "touch.h", "a */ /* test\n#error"))
    assert run(gcc, tmp_path, CLASS_NAMES).decode().split("\0")[:-1] == sorted(names)


# Refusals ----------------------------------------------------------------------------------------


class Shifted(Majority):
    pass


IMAGES = np.random.default_rng(0).integers(0, 256, (8, 8, 9), np.uint8)
CLASSES = np.arange(8) % 2
ENCODER = "expected the encoder median, quantile, levels or deviation, found"
REFUSED = [
    (HDCClassifier("reference"), ENCODER),
    (HDCClassifier(Smoothed("deviation", 1), "lda"), f"{ENCODER} Smoothed"),
    (HDCClassifier(readout="counts"), "expected the read-out majority, .* Counts"),
    (HDCClassifier(readout=Shifted()), "expected the read-out majority, .* Shifted"),
    (HDCRegressor(), "expected a classifier, found HDCRegressor"),
]  # fmt: skip


@pytest.mark.parametrize(("model", "message"), REFUSED, ids=repr)
def test_what_is_not_exported_is_refused_with_the_reason(model, message):
    model.fit(IMAGES, CLASSES)
    with pytest.raises(ValueError, match=message):
        Plan.of(model, "touch")


def test_frames_too_large_untrained_models_and_empty_classes_are_refused():
    model, _ = trained_on(65, Deviation([0]))
    model._encoding = replace(model._encoding, frame_shape=(2**21 + 1,))
    with pytest.raises(ValueError, match="at most 2097152 pixels of 16 bits with the"):
        Plan.of(model, "touch", 16)
    with pytest.raises(ValueError, match="expected a trained model"):
        Plan.of(HDCClassifier(), "touch")
    model = HDCClassifier().partial_fit(IMAGES, CLASSES, classes=[0, 1, 2])
    with pytest.raises(ValueError, match="frames of each class, found none of 2"):
        Plan.of(model, "touch")


# The command -------------------------------------------------------------------------------------


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "m.safetensors"
    trained_on(130)[0].save(path, {"crop": None, "subsample": 2})
    return path


@pytest.mark.parametrize(
    "compiler", [("gcc", "-std=c99", "-O3"), ("g++", "-std=c++11", "-O3", "-x", "c++")]
)
def test_test_vectors_agree_and_notice_a_change(compiler, model, tmp_path, hdc):
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"no compiler here: looked for {compiler[0]}")
    target = tmp_path / "my-touch.h"
    words = ("--bits", 16, "--reject", 0.2, "--test-vectors", 9)
    status, _, err = hdc("export", model, "-o", target, *words)
    assert (status, err) == (0, [])
    command = [*compiler, *STRICT, "-o", "vectors", "my-touch_test.c"]

    def answer():
        subprocess.run(command, cwd=tmp_path, check=True)
        words = [tmp_path / "vectors"]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        said = done.stdout.strip()
        differs = f"frame {done.returncode} of 9 differs"
        assert said == (differs if done.returncode else "9 frames agree")
        return done.returncode

    assert answer() == 0
    text = target.read_text()
    start = text.index("my_touch_prototypes")
    word = re.search("0x[0-9a-f]{16}", text[start:])[0]
    for before, after in ((word, f"0x{int(word, 16) ^ 1:016x}"), (">> 26", ">> 25")):
        assert before not in text[:start]
        target.write_text(text.replace(before, after, 1))
        assert answer() > 0


def test_tables_that_a_small_board_has_no_room_for_are_warned_of(tmp_path, hdc):
    frames = np.random.default_rng(0).integers(0, 256, (4, 200, 200), np.uint8)
    for readout, warned in (("lda", 1), ("majority", 0)):
        model = HDCClassifier("levels", readout).fit(frames, [0, 1, 0, 1])
        model.save(tmp_path / "m")
        status, out, err = hdc("export", tmp_path / "m", "-o", tmp_path / "touch.h")
        assert (status, len(err)) == (0, warned)
        table = int(out[1].split()[1])
        assert (table > 2**18) == bool(warned)
        assert all("more than 256 kB; hdc train --subsample 2" in line for line in err)


def test_only_own_files_are_replaced(model, tmp_path, hdc):
    target, vectors = tmp_path / "touch.h", tmp_path / "touch_test.c"
    words = ("export", model, "-o", target, "--test-vectors", 1)
    vectors.write_text("int main(void) { return 0; }")
    status, _, (line,) = hdc(*words)
    assert (status, str(vectors) in line, target.exists()) == (1, True, False)
    vectors.unlink()
    assert [hdc(*words)[0] for _ in range(2)] == [0, 0]
    target.write_text("mine")
    assert hdc(*words)[0] == 1
    assert target.read_text() == "mine"


@pytest.mark.parametrize("name", ["touch.txt", "1.h", "nowhere/touch.h"])
def test_other_names_of_a_header_are_refused_in_one_line(name, model, tmp_path, hdc):
    status, out, err = hdc("export", model, "-o", tmp_path / name)
    assert (status, out, len(err)) == (1, [], 1)
    assert "expected" in err[0]
