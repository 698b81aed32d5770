"""Studies of numerics can fail: each notices the mistake that it is there to notice."""

import os

import pytest
import torch

from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.task import Context
from experiments.studies.footprint import measure as footprint
from experiments.studies.limits.numerics import measure as numerics
from experiments.studies.limits.stability.measure import CASES
from hdc import bits
from hdc.encoders import Levels, Median, deviation, ranks, relative, smoothed
from hdc.prototypes import Counters
from hdc.readouts import kernel, lda, ridge
from hdc.readouts.discriminant import Problem
from scenes.sensor.camera import MountedCamera
from tests.experiments import composed

pytestmark = pytest.mark.usefixtures("one_thread")
FRAME_BITS = "bits of a frame"
LDA, KERNEL = {"lda of few frames"}, {"kernel of few frames"}


def failing(part):
    """Names of the cases of a part that fail; those of many million numbers are left out."""
    cases = [c for c in CASES if c.part == part and "16,777,217" not in c.name]
    rows = [case.row() for case in cases]
    return {row["case"] for row in rows if row["verdict"] == "fails"}


def after(change):
    """A change of what a function returns."""
    return lambda true: lambda *given: change(true(*given))


def constant(value):
    return lambda true: value


class Accepted(float):
    """An objective that is never too large: the line search takes every full step."""

    def __le__(self, other):
        return True


def by_frame(true):
    """Ties by an order that depends on the frame: turned round in all frames but the first."""

    def encode(self, frames, *_, **__):
        words = true(self, frames)
        d = frames[0].numel()
        turned = bits.unpack(true(self, frames[1:].flip(1)), d).bool()
        words[1:] = bits.pack(turned.flip(1))
        return words

    return encode


def fewer_levels(true):
    return property(lambda levels: true.fget(levels)[:-1])


def without_a_word(true):
    return lambda a, b, *rest: true(a[..., :-1], b[..., :-1], *rest)


def without_a_frame(true):
    return lambda self, words, rows: true(self, words[1:], rows[1:])


def another_penalty(true):
    return lambda self, *given: true(ridge.Ridge(1.0), *given)


def in_float32(true):
    """A camera that rounds its phases to float32."""
    return lambda camera, phases: true(camera, phases.float().double())


@pytest.mark.parametrize(
    ("part", "owner", "name", "mutant", "cases"),
    [
        (FRAME_BITS, Median, "encode", by_frame, {"ties at the median"}),
        ("training", DualSoftmaxRegression, "_objective", after(Accepted),
         {"steps that overshoot"}),
        ("sensor", MountedCamera, "intensity", in_float32, {"phases of a million turns"}),
        ("counting", bits, "hamming", without_a_word, {"distances above 255"}),
        ("counting", Counters, "add", without_a_frame,
         {"counters above 2 to the 16", "unequal classes"}),
        # One more bit where pixels are odd in number.
        ("encoders", ranks, "count_ones", after(lambda ones: [n + 1 for n in ones]),
         {"median of 65 pixels", "quantile of 65 pixels"}),
        # Without the sign.
        ("encoders", relative, "standardised", after(abs), {"Reference of 65 pixels"}),
        ("encoders", deviation, "deviations_of", after(lambda sigmas: [s + 1 for s in sigmas]),
         {"Deviation of 65 pixels, equal frames"}),
        ("encoders", deviation, "_level", after(lambda level: level - 1),
         {"Deviation of 65 pixels, equal frames"}),
        # The edge is repeated, and mirrored no longer.
        ("encoders", smoothed, "_mirrored", after(lambda places: places.roll(1)),
         {"Smoothed image of 5 × 13 pixels"}),
        ("encoders", Levels, "quantiles", fewer_levels, {"levels of 65 pixels"}),
        # No shrinkage; and all of it, as where the spread of the covariance is negated.
        ("read-outs", lda, "closed_form", after(lambda share: 0.0), LDA),
        ("read-outs", lda, "closed_form", after(lambda share: 1.0), LDA),
        ("read-outs", lda, "_LEVELS", constant(2), LDA),  # five steps instead of 15
        ("read-outs", kernel, "likeness", after(lambda near: near**2), KERNEL),
        ("read-outs", kernel, "median_of_pairs", after(lambda m: m + 1),
         {"kernel of single frames"}),
        ("read-outs", Problem, "_offsets", after(lambda b: 0 * b), LDA | KERNEL),
        ("read-outs", Problem, "trace", constant(property(lambda problem: 1.0)), KERNEL),
        ("read-outs", ridge.Ridge, "fit", another_penalty, {"ridge of few frames"}),
    ],
)  # fmt: skip
def test_a_mistake_fails(monkeypatch, part, owner, name, mutant, cases):
    monkeypatch.setattr(owner, name, mutant(getattr(owner, name)))
    assert cases <= failing(part)


def ignoring(true):
    """Half ones, whatever the pixels are."""

    def encode(self, frames, *_, **__):
        d = frames[0].numel()
        return bits.pack((torch.arange(d) % 2 == 0).expand(len(frames), d))

    return encode


def inverted(true):
    """Ones where the pixels are dark."""

    def encode(self, frames, *_, **__):
        d = frames[0].numel()
        return bits.pack(~bits.unpack(true(self, frames), d).bool())

    return encode


@pytest.mark.parametrize("mutant", [ignoring, inverted])
def test_an_encoder_that_does_not_follow_the_pixels_fails(monkeypatch, mutant):
    monkeypatch.setattr(Median, "encode", mutant(Median.encode))
    every = {case.name for case in CASES if case.part == FRAME_BITS}
    # Of equal pixels there is nothing to follow.
    assert every - failing(FRAME_BITS) <= {"a constant frame", "signed zeros"}


def test_a_camera_with_phases_in_float32_fails_in_numerics(monkeypatch):
    def failing_phases():
        rows = [row for row, _ in numerics.phases() if row["ours"]]
        return [row["method"] for row in rows if row["error"] > row["tolerance"]]

    assert failing_phases() == []
    mutant = in_float32(MountedCamera.intensity)
    monkeypatch.setattr(MountedCamera, "intensity", mutant)
    assert "to 1e+07 rad" in failing_phases()


def test_a_module_that_the_library_does_not_need_fails(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'hdc': import pandas\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{before}")
    # Without the finder its status is ok: tests/experiments/studies/test_footprint.py.
    needed = composed.task("footprint")["needed"]
    (row,) = footprint.Footprint(["touch"], ["hdc"], 3, needed).rows(Context())
    assert row["status"] == "fails: loads pandas"
