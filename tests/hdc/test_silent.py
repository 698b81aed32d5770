"""What once answered silently wrong, or not at all: refused, or right."""

import datetime
import enum
import sys
import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, accuracy, bits
from hdc.encoders import ENCODERS, Encoder, Levels, Median, Quantile, Reference
from hdc.readouts import Majority, RidgeValues
from hdc.readouts.values import NeighbourValues

X = np.random.default_rng(0).integers(0, 255, (12, 8, 8)).astype("u1")
Y = [0, 1] * 6


def test_an_encoder_says_that_it_takes_tensors():
    with pytest.raises(
        TypeError, match="frames: expected a torch tensor, found ndarray"
    ):
        Median().encode(X)


def test_a_loaded_model_does_not_live_on_its_file(tmp_path):
    path = tmp_path / "model"
    HDCClassifier().fit(X, Y).save(path)
    loaded = HDCClassifier.load(path)
    before = loaded.predict(X)
    with path.open("r+b") as file:
        file.truncate(16)
    assert (loaded.predict(X) == before).all()


@pytest.mark.parametrize("metadata", [{1: "a", "1": "b"}, {"a": [{2: 0}]}])
def test_metadata_whose_keys_would_become_one_are_refused_before_writing(
    metadata, tmp_path
):
    with pytest.raises(TypeError, match=r"metadata: .*keys must be texts, not"):
        HDCClassifier().fit(X, Y).save(tmp_path / "model", metadata=metadata)
    assert not (tmp_path / "model").exists()


# Parts and parameters that change after training -------------------------------------------------


def test_what_was_trained_is_saved_whatever_becomes_of_the_objects_given(tmp_path):
    encoder, readout = Quantile("3/4"), Majority("one")
    model = HDCClassifier(encoder, readout).fit(X, Y)
    expected = model.distances(X)
    encoder.at, readout.ties = "1/4", "zero"
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert (loaded.distances(X) == expected).all()
    assert (loaded.encoder.at, loaded.readout.ties) == ("3/4", "one")
    base = Quantile("3/4")
    nested = HDCClassifier(Reference(base)).fit(X, Y)
    expected = nested.distances(X)
    base.at = "1/4"
    nested.save(tmp_path / "n")
    assert (HDCClassifier.load(tmp_path / "n").distances(X) == expected).all()


def test_further_frames_are_learnt_by_what_was_trained():
    readout = RidgeValues(2.0)
    model = HDCRegressor(readout=readout).fit(X[:8], np.arange(8.0))
    readout.penalty = 1e-4
    model.partial_fit(X[8:], np.arange(8.0, 12.0))
    expected = HDCRegressor(readout=RidgeValues(2.0)).fit(X, np.arange(12.0))
    assert (model.predict(X) == expected.predict(X)).all()


@pytest.mark.parametrize("kind", [HDCClassifier, HDCRegressor])
def test_a_device_that_is_set_after_training_is_refused(kind):
    model = kind().fit(X, Y).set_params(device="gpu")
    with pytest.raises(
        ValueError, match=r"^device: changed after training; .*; to\(device\) moves it$"
    ):
        model.predict(X)


@pytest.mark.parametrize("device", ["gpu", "cuda:99", "meta", "", 1.5, None])
@pytest.mark.parametrize("kind", [HDCClassifier, HDCRegressor])
def test_a_device_that_is_none_is_named_in_one_line(kind, device):
    with pytest.raises(ValueError, match=r"^device: expected 'cpu'.*, found") as caught:
        kind(device=device).fit(X, Y)
    assert "\n" not in str(caught.value)


# Whole or nothing --------------------------------------------------------------------------------


def test_a_failed_first_batch_leaves_no_names_of_columns():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(X.reshape(12, -1)).add_prefix("pixel ")
    model = HDCClassifier()
    before = vars(model).copy()
    with pytest.raises(ValueError, match="labels: expected 12"):
        model.partial_fit(table, Y[:3])
    assert vars(model) == before
    other = table.rename(columns=str.upper)
    assert model.partial_fit(other, Y).feature_names_in_[0] == "PIXEL 0"


def test_a_merge_that_fails_halfway_changes_nothing(monkeypatch):
    mine = HDCClassifier(readout="neighbours").fit(X, Y)
    other = HDCClassifier(readout="neighbours").fit(255 - X, [1, 2] * 6)
    before = mine.predict(X), mine.counts_.tolist(), mine._head

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(type(mine.readout_), "merge", fail)
    with pytest.raises(MemoryError):
        mine.merge(other)
    untrained = HDCClassifier(readout="neighbours")
    with pytest.raises(MemoryError):
        untrained.merge(other)
    assert not hasattr(untrained, "classes_")
    assert mine.classes_.tolist() == [0, 1]
    assert (mine.predict(X) == before[0]).all()
    assert mine.counts_.tolist() == before[1]
    assert mine._head is before[2]


# Labels ------------------------------------------------------------------------------------------


class Colour(enum.IntEnum):
    RED = 1


BIG = 2**53 + 1
EXACT = {
    "large": [BIG, BIG - 1],
    "larger": [2**63, -1],
    "largest": [2**70, 2**70 + 1],
    "objects": np.array([BIG, BIG - 1], object),
    "mixed": [BIG, 0.5],
    "objects of numpy": np.array([np.int64(BIG), np.int64(3)], object),
    "uint64": np.array([2**64 - 1, 1], np.uint64),
    "float16": np.array([0.5, 1], np.float16),
    "float32": np.array([0.1, 1], np.float32),
    "bools": [True, False],
    "text": ["1", "1\0"],
    "numpy's text": np.array(["b", "a"]),
    "scalars": [np.str_("b"), np.str_("a")],
    "tensors": [torch.tensor(BIG), torch.tensor(1)],
}


@pytest.mark.parametrize("name", EXACT)
def test_labels_are_exactly_those_given(name):
    given = EXACT[name]
    model = HDCClassifier().fit(X, [*given] * 6)
    wanted = [x.item() if hasattr(x, "item") else x for x in given]
    assert model.classes_.tolist() == sorted(wanted)
    found = {type(label) for label in model.classes_.tolist()}
    assert found == {type(label) for label in wanted}
    asked = model.predict(X).tolist()
    assert set(asked) == set(wanted)


@pytest.mark.parametrize("kind", ["Int64", "string", "category", "boolean", "object"])
def test_labels_of_pandas_are_exactly_those_given(kind):
    pandas = pytest.importorskip("pandas")
    values = {"Int64": [BIG, BIG - 1], "boolean": [True, False]}.get(kind, ["b", "a"])
    labels = pandas.Series(values * 6, dtype=kind)
    model = HDCClassifier().fit(X, labels)
    assert model.classes_.tolist() == sorted(values)
    assert type(model.classes_.tolist()[0]) is type(values[0])


TODAY = datetime.date(2024, 1, 1)
REFUSED = {
    "days": np.array(["2024-01-01", "2024-01-02"], "M8[D]"),
    "nanoseconds": np.array([0, 1], "M8[ns]"),
    "durations": np.array([0, 1], "m8[ns]"),
    "durations in a list": [np.timedelta64(1, "ns"), np.timedelta64(2, "ns")],
    "times in a list": [np.datetime64(1, "ns"), np.datetime64(2, "ns")],
    "times in an array": np.array([np.datetime64(1, "ns"), 2], object),
    "dates": [TODAY, TODAY + datetime.timedelta(1)],
    "bytes": [b"a", b"b"],
    "longdouble": np.array([0, 1], np.longdouble),
    "enumerations": [Colour.RED, 2],
    "tuples": [(1, 2), (1, 3)],
    "rows": np.zeros((2, 3)),
    "records": np.zeros(2, "i4, i4"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_labels_of_other_kinds_are_refused(name):
    with pytest.raises(ValueError, match=r"labels\[\d\]: expected a str, int, float"):
        HDCClassifier().fit(X[:2], REFUSED[name])


@pytest.mark.parametrize("labels", [[1, True, 2], [0, 1, False], ["1", 1, 2]])
def test_labels_of_two_kinds_are_refused_not_merged(labels):
    with pytest.raises(ValueError, match="labels: expected all text, all numbers or"):
        HDCClassifier().fit(X, labels * 4)
    numbers = HDCClassifier().fit(X, [1, 2, 3] * 4)
    for learn in (numbers.partial_fit, numbers.recalibrate):
        with pytest.raises(ValueError, match=r"labels: expected all .* beside"):
            learn(X[:2], [True, True])


# Memory ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "readout", "matrices"),
    [
        (HDCClassifier, "ridge", 4),
        (HDCRegressor, "ridge", 4),
        (HDCClassifier, "lda", 2),
        (HDCClassifier, "kernel", 3),
    ],
)
def test_more_frames_than_memory_holds_are_refused(
    kind, readout, matrices, monkeypatch
):
    monkeypatch.setattr("hdc.readouts.arithmetic.MOST_FRAMES", 11)
    message = (
        f"^{readout}: expected at most 11 frames, found 12, which need {matrices} m"
    )
    with pytest.raises(ValueError, match=message):
        kind(readout=readout).fit(X, Y)
    kind(readout="neighbours").fit(X, Y)


@pytest.mark.parametrize("k", [1, 2, 11, 20])
def test_neighbours_are_left_out_alike_however_many_are_compared(k, monkeypatch):
    values = np.arange(12.0) ** 2
    whole = HDCRegressor(readout=NeighbourValues(k)).fit(X, values).residuals_
    monkeypatch.setattr("hdc.readouts.values._ROWS", 5)
    parts = HDCRegressor(readout=NeighbourValues(k)).fit(X, values).residuals_
    assert (whole == parts).all()


# Files that name code ----------------------------------------------------------------------------


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A module of a user's own that says when it is imported."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "mine.py").write_text(
        "import sys\nsys.imported_mine = True\n"
        "from hdc.encoders import Median\nfrom hdc.readouts import Majority\n"
        "class Bits(Median): pass\nclass Votes(Majority): pass\n"
    )
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(sys, "imported_mine", False, raising=False)
    yield
    sys.modules.pop("mine", None)


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        ({"encoder": "mine.Bits"}, "mine.Bits"),
        ({"readout": "mine.Votes"}, "mine.Votes"),
        ({"encoder": Reference("mine.Bits")}, "mine.Bits"),
    ],
)
def test_only_a_trusted_module_is_imported(parameters, name, module, tmp_path):
    model = HDCClassifier(**parameters).fit(X, Y)
    model.save(tmp_path / "m")
    del sys.modules["mine"]
    sys.imported_mine = False
    for trusted in ((), ["mine"], ["mine.Other"]):
        with pytest.raises(ValueError, match=r"m: .*trusted=\['mine\.") as caught:
            HDCClassifier.load(tmp_path / "m", trusted=trusted)
        assert "\n" not in str(caught.value)
    assert not sys.imported_mine
    loaded = HDCClassifier.load(tmp_path / "m", trusted=[name])
    assert (loaded.predict(X) == model.predict(X)).all()
    assert sys.imported_mine


# Names -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "meant"),
    [
        ({"encoder": "medain"}, "median"),
        ({"readout": "majorty"}, "majority"),
        ({"readout": Majority("zeros")}, "zero"),
        ({"encoder": Median("spraed")}, "spread"),
        ({"backend": "compield"}, "compiled"),
    ],
)
def test_a_name_that_is_much_like_another_is_answered_with_it(parameters, meant):
    with pytest.raises(ValueError, match=f"Did you mean '{meant}'\\?$"):
        HDCClassifier(**parameters).fit(X, Y)
    with pytest.raises(ValueError, match=r"expected one of .*, found 'xyz'$"):
        HDCClassifier("xyz").fit(X, Y)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("enocder", "encoder"),
        ("readout__clas_weight", "readout__class_weight"),
        ("encoder__base__tise", "encoder__base__ties"),
    ],
)
def test_a_parameter_that_is_much_like_another_is_answered_with_it(name, meant):
    with pytest.raises(ValueError, match=f"found '{name}'. Did you mean '{meant}'"):
        HDCClassifier(Reference()).set_params(**{name: 1})


# Edges -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.int64])
def test_classes_of_one_byte_are_counted_in_their_own_cell(kind):
    classes = np.array([0, 19, 19], kind)
    counts = accuracy.confusion(classes, classes, 20)
    assert (counts.sum(), counts[0, 0], counts[19, 19]) == (3, 1, 2)


@pytest.mark.parametrize("y", [{"a", "b"}, frozenset("ab"), {"a": 0, "b": 1}], ids=type)
def test_labels_and_targets_without_an_order_are_refused(y):
    message = f"expected a list or an array, found a {type(y).__name__}"
    with pytest.raises(ValueError, match=f"^labels: {message}"):
        HDCClassifier().fit(X[:2], y)
    with pytest.raises(ValueError, match=f"^targets: {message}"):
        HDCRegressor().fit(X[:2], y)


def test_times_are_no_numbers_to_predict():
    for kind in ("M8[s]", "m8[s]"):
        with pytest.raises(ValueError, match=r"^targets: expected numbers, found "):
            HDCRegressor().fit(X, np.arange(12).astype(kind))


@pytest.mark.parametrize("period", [None, 180])
def test_a_period_that_is_set_after_training_is_refused(period):
    model = HDCRegressor(period=360).fit(X, np.arange(12.0))
    model.set_params(period=period)
    for call in (model.predict, lambda x: model.recalibrate(x, np.arange(12.0))):
        with pytest.raises(ValueError, match=r"^period: changed after training; call"):
            call(X)
    assert model.fit(X, np.arange(12.0)).predict(X).shape == (12,)


def test_a_period_of_numpy_is_saved(tmp_path):
    model = HDCRegressor(period=np.float32(360)).fit(X, np.arange(12.0))
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    assert (loaded.predict(X) == model.predict(X)).all()


def test_an_untrained_model_does_not_take_over_another_encoder():
    trained = HDCClassifier().fit(X, Y)
    with pytest.raises(ValueError, match=r"merge: expected the encoder Levels\(.*Medi"):
        HDCClassifier("levels").merge(trained)


def test_frames_of_a_class_without_any_are_not_lost_by_replacing_bits():
    model = HDCClassifier().partial_fit(X[:8], Y[:8], classes=[0, 1, 2])
    before = model.predict(X)
    with pytest.raises(ValueError, match=r"^recalibrate: expected classes with tr"):
        model.recalibrate(X[8:], [0, 1, 2, 2])
    assert (model.predict(X) == before).all()
    model.recalibrate(X[8:], [0, 1, 2, 2], method="merge")
    assert (model.predict(X[10:]) == 2).all()


def test_integer_prototypes_are_recalibrated_by_votes_unless_told_otherwise():
    models = [HDCClassifier(readout="counts").fit(X[:8], Y[:8]) for _ in range(2)]
    models[0].recalibrate(X[8:], Y[8:])
    models[1].recalibrate(X[8:], Y[8:], method="merge")
    scores = [model.decision_function(X) for model in models]
    assert (scores[0] == scores[1]).all()


@pytest.mark.parametrize("readout", ["lda", "kernel"])
def test_new_frames_of_one_class_do_not_take_the_place_of_all(readout):
    model = HDCClassifier(readout=readout).fit(X, [0, 1, 2] * 4)
    before = model.predict(X)
    with (
        pytest.warns(UserWarning, match="no new frames of 0, 2"),
        pytest.raises(ValueError, match=r"^p: expected a share below 1 with new fra"),
    ):
        model.recalibrate(X[1::3], [1] * 4, p=1)
    assert (model.predict(X) == before).all()


@pytest.mark.parametrize("encoder", [Levels(3, lit=0.5), "reference", "deviation"])
@pytest.mark.parametrize("kind", ["bfloat16", "grad", "uint16"])
def test_frames_of_any_tensor_are_learnt(encoder, kind):
    frames = torch.from_numpy(X)
    plain = HDCClassifier(encoder).fit(frames.float(), Y)
    if kind == "grad":
        frames = frames.float().requires_grad_()
    else:
        frames = frames.to(getattr(torch, kind))
    model = HDCClassifier(encoder).fit(frames, Y)
    assert (model.predict(frames) == plain.predict(X.astype("f4"))).all()


# Files that say another thing than the model -----------------------------------------------------


class Above(Encoder):
    """Pixels above a number, or those of a frame."""

    def __init__(self, frame=100):
        self.frame = frame

    def encode(self, frames):
        limits = torch.as_tensor(0 if self.frame is None else self.frame)
        return bits.pack(frames.flatten(1) > limits.flatten())


@pytest.mark.parametrize("frame", [X[0], {"a": 1}, [1, None]], ids=["array", "a", "b"])
def test_a_parameter_that_no_file_keeps_is_refused_not_lost(frame, tmp_path):
    model = HDCClassifier(Above()).fit(X, Y)
    model.encoder_.frame = frame
    with pytest.raises(ValueError, match=r"^Above\.frame: expected .* a file keeps"):
        model.save(tmp_path / "m")
    assert not (tmp_path / "m").exists()


def test_a_class_of_a_script_is_refused_not_saved(monkeypatch, tmp_path):
    """Another process has another ``__main__``."""
    monkeypatch.setattr(Above, "__module__", "__main__")
    monkeypatch.setattr(sys.modules["__main__"], "Above", Above, raising=False)
    model = HDCClassifier(Above()).fit(X, Y)
    with pytest.raises(ValueError, match=r"m: .*module to import.*'__main__\.Above'"):
        model.save(tmp_path / "m")
    assert not (tmp_path / "m").exists()


def test_a_name_that_is_trusted_stands_for_itself_alone(module, tmp_path):
    HDCClassifier("mine.Bits").fit(X, Y).save(tmp_path / "m")
    with pytest.raises(ValueError, match=r"trusted=\['mine\.Bits'\]"):
        HDCClassifier.load(tmp_path / "m", trusted="yours.or.mine.Bits")
    loaded = HDCClassifier.load(tmp_path / "m", trusted="mine.Bits")
    assert (loaded.predict(X) == HDCClassifier().fit(X, Y).predict(X)).all()


@pytest.mark.parametrize("readout", ["ridge", "lda", "kernel", "trained"])
def test_a_model_of_one_frame_of_each_class_comes_back(readout, tmp_path):
    with warnings.catch_warnings(action="ignore"):  # so few frames say little
        model = HDCClassifier(readout=readout).fit(X[:2], ["a", "b"])
        model.save(tmp_path / "m")
        loaded = HDCClassifier.load(tmp_path / "m")
        sets = [asked.predict_set(X, 0.6) for asked in (model, loaded)]
    assert (loaded.predict(X) == model.predict(X)).all()
    assert [s.tolist() for s in sets[0]] == [s.tolist() for s in sets[1]]


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize("dtype", ["uint8", "float32"])
def test_no_frames_have_no_answers(encoder, dtype):
    model = HDCClassifier(encoder).fit(X.astype(dtype), Y)
    none = X[:0].astype(dtype)
    assert model.predict(none).shape == (0,)
    assert model.predict_set(none) == []
    assert model.is_known(none).shape == (0,)
    assert model.predict_proba(none).shape == (0, 2)


def test_a_score_of_labels_of_another_kind_is_refused():
    """0.0 would say that every answer is wrong."""
    model = HDCClassifier().fit(X, Y)
    with pytest.raises(ValueError, match="labels: expected all text, all numbers"):
        model.score(X, [str(label) for label in Y])
    assert HDCClassifier().fit(X, Y).score(X, [5] * 12) == 0.0


FOREIGN = {
    "a meta tensor": torch.empty(12, 8, 8, device="meta"),
    "a sparse tensor": torch.from_numpy(X).float().to_sparse(),
    "a quantised tensor": torch.quantize_per_tensor(
        torch.from_numpy(X).float(), 1.0, 0, torch.quint8
    ),
    "dtype (float128|longdouble)": X.astype(np.longdouble),
    "a loader of batches": torch.utils.data.DataLoader(torch.from_numpy(X)),
}


@pytest.mark.parametrize("found", FOREIGN)
def test_frames_of_foreign_kinds_are_named(found):
    if found.startswith("dtype") and np.dtype(np.longdouble).itemsize == 8:
        pytest.skip("long doubles are doubles here")
    with pytest.raises(TypeError, match=f"frames: expected .*, found {found}"):
        HDCClassifier().fit(FOREIGN[found], Y)


@pytest.mark.parametrize("kind", [HDCClassifier, HDCRegressor])
def test_labels_and_numbers_of_foreign_tensors(kind):
    expected = kind().fit(X, Y).predict(X)
    bfloat16 = kind().fit(X, torch.tensor(Y).bfloat16()).predict(X)
    assert (bfloat16 == expected).all()
    for foreign in (torch.empty(12, device="meta"), torch.tensor(Y).to_sparse()):
        with pytest.raises(TypeError, match="expected plain numbers, found a"):
            kind().fit(X, foreign)
