"""Studies of numerics can fail: each notices the mistake that it is there to notice."""

import os

import pytest
import torch

from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.footprint import measure as footprint
from experiments.studies.limits.numerics import measure as numerics
from experiments.studies.limits.stability.measure import CASES
from hdc import bits
from hdc.encoders import Levels, Median, deviation, ranks, relative, smoothed
from hdc.prototypes import Counters
from hdc.readouts import kernel, lda, ridge
from hdc.readouts.discriminant import Problem
from scenes.sensor.camera import MountedCamera

pytestmark = pytest.mark.usefixtures("one_thread")


def failing(part, among=None):
    """Names of the cases of a part that fail, of those named."""
    names = among or {case.name for case in CASES}
    rows = (case.row() for case in CASES if case.part == part and case.name in names)
    return {row["case"] for row in rows if row["verdict"] == "fails"}


ENCODE = Median().encode


def as_method(encode):
    """A function of frames in place of an encoder's method."""
    return lambda self, frames, *_, **__: encode(frames)


def ignoring(frames, **_):
    """Half ones, whatever the pixels are."""
    d = frames[0].numel()
    return bits.pack((torch.arange(d) % 2 == 0).expand(len(frames), d))


def inverted(frames, true=ENCODE):
    """Ones where the pixels are dark."""
    d = frames[0].numel()
    return bits.pack(~bits.unpack(true(frames), d).bool())


def by_frame(frames, true=ENCODE):
    """Ties by an order that depends on the frame: turned round in all frames but the first."""
    words = true(frames)
    words[1:] = true(frames[1:].flip(1))
    d = frames[0].numel()
    words[1:] = bits.pack(bits.unpack(words[1:], d).bool().flip(1))
    return words


@pytest.mark.parametrize("mutant", [ignoring, inverted])
def test_an_encoder_that_does_not_follow_the_pixels_fails(monkeypatch, mutant):
    monkeypatch.setattr(Median, "encode", as_method(mutant))
    every = {case.name for case in CASES if case.part == "bits of a frame"}
    # Of equal pixels there is nothing to follow.
    assert every - failing("bits of a frame") <= {"a constant frame", "signed zeros"}


def test_ties_by_another_order_in_each_frame_fail(monkeypatch):
    monkeypatch.setattr(Median, "encode", as_method(by_frame))
    assert "ties at the median" in failing("bits of a frame")


class Accepted(float):
    """An objective that is never too large: the line search takes every full step."""

    def __le__(self, other):
        return True


def test_newton_without_line_search_fails(monkeypatch):
    true = DualSoftmaxRegression._objective
    monkeypatch.setattr(
        DualSoftmaxRegression, "_objective", lambda *given: Accepted(true(*given))
    )
    assert failing("training") == {"steps that overshoot"}


@pytest.fixture
def camera_in_float32(monkeypatch):
    """A camera that rounds its phases to float32."""
    true = MountedCamera.intensity
    monkeypatch.setattr(
        MountedCamera,
        "intensity",
        lambda camera, phases: true(camera, phases.float().double()),
    )


def phases_fail():
    return [
        row["method"]
        for row, _ in numerics.phases()
        if row["ours"] and row["error"] > row["tolerance"]
    ]


def test_a_camera_with_phases_in_float32_fails_in_stability(camera_in_float32):
    assert failing("sensor") == {"phases of a million turns"}


def test_a_camera_with_phases_in_float32_fails_in_numerics(camera_in_float32):
    assert "to 1e+07 rad" in phases_fail()


def test_the_camera_itself_holds():
    assert failing("sensor") == set()
    assert phases_fail() == []


def test_a_module_that_the_library_does_not_need_fails(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'hdc': import pandas\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    task = configs.task("footprint")
    task |= {"scenes": ["touch"], "models": ["hdc"], "frames": 3}
    del task["_target_"]
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{before}")
    # Without the finder its status is ok: tests/experiments/studies/test_footprint.py.
    (row,) = footprint.footprint.rows(Run(), **task)
    assert row["status"] == "fails: loads pandas"


def test_distances_that_leave_out_a_word_fail(monkeypatch):
    true = bits.hamming
    monkeypatch.setattr(
        bits, "hamming", lambda a, b, *r: true(a[..., :-1], b[..., :-1], *r)
    )
    assert "distances above 255" in failing("counting")


def test_counters_that_forget_a_frame_fail(monkeypatch):
    true = Counters.add
    monkeypatch.setattr(
        Counters, "add", lambda self, words, rows: true(self, words[1:], rows[1:])
    )
    assert {"counters above 2 to the 16", "unequal classes"} <= failing("counting")


SMALL = {case.name for case in CASES if "16,777,217" not in case.name}


def mutant_of(monkeypatch, owner, name, change):
    """Put a change of a function or method in its place."""
    true = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *given: change(true(*given)))


@pytest.mark.parametrize(
    ("owner", "name", "change", "case"),
    [
        # One more bit where pixels are odd in number.
        (ranks, "count_ones", lambda ones: [n + 1 for n in ones], "median of 65 pixels"),
        (ranks, "count_ones", lambda ones: [n + 1 for n in ones], "quantile of 65 pixels"),
        # Without the sign.
        (relative, "standardised", abs, "Reference of 65 pixels"),
        (deviation, "deviations_of", lambda sigmas: [s + 1 for s in sigmas],
         "Deviation of 65 pixels, equal frames"),
        (deviation, "_level", lambda level: level - 1, "Deviation of 65 pixels, equal frames"),
        # The edge is repeated, and mirrored no longer.
        (smoothed, "_mirrored", lambda places: places.roll(1), "Smoothed image of 5 × 13 pixels"),
    ],
)  # fmt: skip
def test_an_encoder_that_is_off_by_one_fails(monkeypatch, owner, name, change, case):
    mutant_of(monkeypatch, owner, name, change)
    assert case in failing("encoders", SMALL)


def test_one_level_fewer_fails(monkeypatch):
    true = Levels.quantiles
    fewer = property(lambda levels: true.fget(levels)[:-1])
    monkeypatch.setattr(Levels, "quantiles", fewer)
    assert "levels of 65 pixels" in failing("encoders", SMALL)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_lda_with_another_shrinkage_fails(monkeypatch, share):
    """None at all; and all of it, as where the spread of the covariance is negated."""
    monkeypatch.setattr(lda, "closed_form", lambda *given: share)
    assert failing("read-outs") == {"lda of few frames"}


@pytest.mark.parametrize(
    ("owner", "name", "change", "cases"),
    [
        (lda, "_LEVELS", 2, {"lda of few frames"}),  # five steps instead of 15
        (kernel, "likeness", lambda near: near**2, {"kernel of few frames"}),
        (kernel, "median_of_pairs", lambda m: m + 1, {"kernel of single frames"}),
        (Problem, "_offsets", lambda b: 0 * b, {"lda of few frames", "kernel of few frames"}),
        (Problem, "trace", property(lambda problem: 1.0), {"kernel of few frames"}),
    ],
)  # fmt: skip
def test_a_read_out_that_learns_something_else_fails(
    monkeypatch, owner, name, change, cases
):
    if callable(change):
        mutant_of(monkeypatch, owner, name, change)
    else:
        monkeypatch.setattr(owner, name, change)
    assert cases <= failing("read-outs")


def test_ridge_with_another_penalty_fails(monkeypatch):
    true = ridge.Ridge.fit
    monkeypatch.setattr(
        ridge.Ridge, "fit", lambda self, *given: true(ridge.Ridge(1.0), *given)
    )
    assert "ridge of few frames" in failing("read-outs")
