"""Studies of numerics can fail: each notices the mistake that it is there to notice."""

import os
from functools import partial

import pytest
import torch

from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.footprint import measure as footprint
from experiments.studies.limits.numerics import measure as numerics
from experiments.studies.limits.stability.measure import CASES
from hdc import bits
from hdc.encoders import Levels, Median, ranks
from hdc.prototypes import Counters
from hdc.readouts import lda
from scenes.sensor.camera import MountedCamera

pytestmark = pytest.mark.usefixtures("one_thread")


def failing(part):
    """Names of the cases of a part that fail."""
    rows = (case.row() for case in CASES if case.part == part)
    return {row["case"] for row in rows if row["verdict"] == "fails"}


DEFINED = {case.name for case in CASES if case.name.startswith("definition")}


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
    missed = DEFINED - failing("hypervectors")
    # Of equal pixels there is nothing to follow.
    assert missed <= {
        "definition of a constant frame",
        "definition of signed zeros",
    }


def test_ties_by_another_order_in_each_frame_fail(monkeypatch):
    monkeypatch.setattr(Median, "encode", as_method(by_frame))
    assert "definition with ties at the median" in failing("hypervectors")


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
    rows = partial(footprint.footprint.rows, Run(), **_arguments(task))
    (row,) = rows()
    assert row["status"] == "ok"
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{before}")
    (row,) = rows()
    assert row["status"] == "fails: loads pandas"


def _arguments(task):
    return {key: task[key] for key in task if key != "_target_"}


def test_distances_that_leave_out_a_word_fail(monkeypatch):
    true = bits.hamming
    monkeypatch.setattr(
        bits, "hamming", lambda a, b, *r: true(a[..., :-1], b[..., :-1], *r)
    )
    assert "distances above 255" in failing("hypervectors")


def test_counters_that_forget_a_frame_fail(monkeypatch):
    true = Counters.add
    monkeypatch.setattr(
        Counters, "add", lambda self, words, rows: true(self, words[1:], rows[1:])
    )
    assert {"counters above 2 to the 16", "unequal classes"} <= failing("hypervectors")


def test_one_more_bit_where_pixels_are_odd_in_number_fails(monkeypatch):
    true = ranks.count_ones
    monkeypatch.setattr(
        ranks, "count_ones", lambda q, n: [ones + n % 2 for ones in true(q, n)]
    )
    assert "median of 65 pixels" in failing("encoders")


def test_one_level_fewer_fails(monkeypatch):
    true = Levels.quantiles
    fewer = property(lambda levels: true.fget(levels)[:-1])
    monkeypatch.setattr(Levels, "quantiles", fewer)
    assert "levels of 65 pixels" in failing("encoders")


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_lda_with_another_shrinkage_fails(monkeypatch, share):
    """None at all; and all of it, as where the spread of the covariance is negated."""
    monkeypatch.setattr(lda, "closed_form", lambda *given: share)
    assert failing("read-outs") == {"lda of a singular scatter"}


def test_encoders_and_read_outs_hold():
    assert failing("encoders") == failing("read-outs") == set()
