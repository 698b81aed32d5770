"""What ``hdc compare`` prints, advises and draws, of results made by hand."""

import copy
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from hdc import selection
from hdc.command.compare import advice, curve, show


def printed(name):
    """What is to be printed, from a file: its lines are as long as a terminal is wide."""
    path = Path(__file__).parent / "printed" / f"{name}.txt"
    return path.read_text("utf-8").removesuffix("\n")


def gain(middle, low, high):
    return {"gain": middle, "low": low, "high": high}


def cost(train_s, predict_ms, size, training, prediction):
    return {
        "train_s": train_s,
        "predict_ms": predict_ms,
        "bytes": size,
        "front_train_s": training,
        "front_predict_ms": prediction,
    }


def test_a_line_marks_what_was_given_up():
    first, second = selection.combinations(["median"], ["majority", "lda"], False)
    scores = selection.Scores({first: 0.25, second: 0.5}, given_up=[second.name])
    assert show.row(first.name, scores, False) == f"{first.name}: accuracy 75.0%"
    assert show.row(second.name, scores, False) == f"{second.name}: accuracy 50.0%*"
    found = show.row(first.name, scores, True)
    assert found == f"{first.name}: 0.25 of a guess's error"
    assert show.row("ridge", scores, True) == "ridge: left out"


COSTS = (
    cost(0.0123, 0.05, 768, True, True),
    cost(1.25, 0.123, 21_100, True, False),
    cost(75.4, 12.5, 3_000_000, False, False),
    cost(0.5, 0.0025, 4_500_000_000, False, True),
)


def with_costs(methods):
    for own, costs in zip(methods.values(), COSTS, strict=False):
        own |= costs
    return methods


def share(accuracy, low, high):
    return {"accuracy": accuracy, "low": low, "high": high}


def of_classes():
    """Two tests of four classes, in which the choice wins and a rival is not clearly better."""
    methods = {
        "median, majority": share(0.5, 0.25, 0.75),
        "levels, lda": share(0.8125, 0.625, 0.9375),
        "1-NN, raw greys": share(0.75, 0.5, 0.875),
        "ridge, raw greys": share(0.25, 0.125, 0.375),
    }
    later = copy.deepcopy(methods)
    later["median, majority"] = share(0.4, 0.3, 0.5)
    later["levels, lda"] = share(0.6, 0.5, 0.7)
    later["1-NN, raw greys"] = share(0.65, 0.55, 0.75)
    with_costs(later)
    return {
        "frames": 120,
        "shape": [16, 20],
        "classes": ["a", "b", "c", "d"],
        "chosen_by": "cross-validation on 64 training frames, 5 folds at random",
        "published": "median, majority",
        "chosen": "levels, lda",
        "rival": "1-NN, raw greys",
        "command": "hdc train own --encoder levels --readout lda -o model.safetensors",
        "cross_validation": {
            "median, majority": 0.5,
            "levels, majority": 0.125,
            "levels, lda": 0.875,
            "1-NN, raw greys": 0.8,
            "ridge, raw greys": 0.3,
        },
        "given_up": ["levels, majority", "ridge, raw greys"],
        "not_tried": ["3-NN, raw greys", "mean image, raw greys"],
        "dither": {"before": 0.6, "after": 0.25, "seed": 0, "warns": True},
        "left_out": {"median, lda": "too few frames", "softmax": "no span"},
        "tests": [
            {
                "name": "at random",
                "learnt": 64,
                "tested": 16,
                "guess": 0.3125,
                "guessed": "tab\there",
                "methods": methods,
                "gain": gain(0.3125, 0.1, 0.5),
                "rival_gain": gain(-0.0625, -0.2, -0.01),
            },
            {
                "name": "the last sessions",
                "learnt": 80,
                "tested": 40,
                "guess": 0.35,
                "guessed": "tab\there",
                "methods": later,
                "gain": gain(0.2, 0.05, 0.35),
                "rival_gain": gain(0.05, -0.1, 0.2),
            },
        ],
        "curve": {
            "median, majority": [
                {"frames": 1, **share(0.3, 0.2, 0.4)},
                {"frames": 12.5, **share(0.4, 0.3, 0.5)},
            ],
            "levels, lda": [
                {"frames": 1, **share(0.25, 0.15, 0.35)},
                {"frames": 12.5, **share(0.6, 0.5, 0.7)},
            ],
            "1-NN, raw greys": [
                {"frames": 1, **share(0.35, 0.25, 0.45)},
                {"frames": 12.5, **share(0.65, 0.55, 0.75)},
            ],
        },
    }


def errors(depth, force):
    return {"errors": {"depth": depth, "tab\there": force}}


def of_values():
    """Two tests of two values, one without a unit."""
    gains = {"depth": gain(0.75, 0.5, 1.0), "tab\there": gain(0.0, -0.125, 0.25)}
    over = {"depth": gain(-0.25, -0.5, -0.125), "tab\there": gain(0.25, 0.125, 0.5)}
    none = {"depth": gain(0.0, 0.0, 0.0), "tab\there": gain(0.0, 0.0, 0.0)}
    return {
        "frames": 60,
        "shape": [256],
        "values": ["depth", "tab\there"],
        "units": {"depth": "mm", "tab\there": ""},
        "chosen_by": "cross-validation on 32 training frames, 2 folds by session",
        "published": "median, ridge",
        "chosen": "levels, neighbours",
        "rival": "SVR (C = 10), raw greys",
        "command": "hdc train moves.npz --encoder levels --readout neighbours",
        "cross_validation": {
            "median, ridge": 0.25,
            "levels, neighbours": 0.1234,
            "SVR (C = 10), raw greys": 0.2,
        },
        "given_up": [],
        "not_tried": [],
        "dither": {"before": 0.5, "after": 0.5125, "seed": 0, "warns": False},
        "left_out": {},
        "tests": [
            {
                "name": "at random",
                "learnt": 32,
                "tested": 8,
                "methods": {
                    "median, ridge": errors(1.0, 2.0),
                    "levels, neighbours": errors(3.0, 4.0),
                    "SVR (C = 10), raw greys": errors(5.0, 6.0),
                },
                "gain": none,
                "rival_gain": none,
            },
            {
                "name": "the last frames",
                "learnt": 40,
                "tested": 20,
                "methods": with_costs(
                    {
                        "median, ridge": errors(1.25, 0.5),
                        "levels, neighbours": errors(0.5, 0.5),
                        "SVR (C = 10), raw greys": errors(0.75, 0.25),
                    }
                ),
                "gain": gains,
                "rival_gain": over,
            },
        ],
        "curve": {
            "median, ridge": [
                {"frames": 5, "error": 0.75},
                {"frames": 40, "error": 0.3456},
            ],
            "levels, neighbours": [
                {"frames": 5, "error": 1.25},
                {"frames": 40, "error": 0.125},
            ],
            "SVR (C = 10), raw greys": [
                {"frames": 5, "error": 0.5},
                {"frames": 40, "error": 0.25},
            ],
        },
    }


def all_of(result):
    return f"{show.head(result)}\n\n{show.text(result)}"


# Text --------------------------------------------------------------------------------------------


def test_all_that_is_printed_of_classes():
    assert all_of(of_classes()) == printed("classes")


def test_all_that_is_printed_of_values():
    assert all_of(of_values()) == printed("values")


def test_all_that_is_printed_where_nothing_could_be_chosen_by():
    result = of_classes() | {
        "chosen_by": "",
        "rival": "",
        "cross_validation": {},
        "given_up": [],
        "not_tried": [],
        "dither": {},
        "left_out": {},
    }
    result["chosen"] = result["published"]
    for test in result["tests"]:
        for other in list(test["methods"])[1:]:
            del test["methods"][other]
    for other in list(result["curve"])[1:]:
        del result["curve"][other]
    assert all_of(result) == printed("classes_without_folds")


def test_advice_where_an_interval_ends_at_zero_is_of_no_clear_difference():
    for low, high in ((0.0, 0.3), (-0.3, 0.0)):
        result = of_classes()
        edge = {"gain": gain(0.0, low, high), "rival_gain": gain(0.0, low, high)}
        result["tests"][-1] |= edge
        clear, rival = advice.sentences(result)[2:]
        assert clear == "That is no clear gain: the interval holds zero."
        assert "is not clearly better or worse: 1-NN, raw greys has 65.0%" in rival


def test_advice_says_what_is_a_loss():
    result = of_classes()
    result["tests"][-1] |= {
        "gain": gain(-0.1, -0.2, -0.01),
        "rival_gain": gain(0.1, 0.01, 0.2),
    }
    assert advice.sentences(result)[2:] == [
        "That is a loss: the choice does not carry over to these frames.",
        "A baseline outside the library is better: 1-NN, raw greys has 65.0%, "
        "+10.0 points (95 % interval +1.0 to +20.0).",
    ]


# Figure ------------------------------------------------------------------------------------------


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """The axes and the legend of a result's figure, as it is when saved."""

    def draw(result):
        kept = []
        monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: kept.append(self))
        curve.draw(result, tmp_path / "curve.svg")
        (figure,) = kept
        (axes,), (legend,) = figure.axes, figure.legends
        return axes, [text.get_text() for text in legend.get_texts()]

    return draw


def points(line):
    return np.column_stack(line.get_data()).tolist()


def test_the_figure_of_classes_has_every_curve_with_its_interval(drawn):
    axes, legend = drawn(of_classes())
    assert axes.get_title() == "Tested on the last sessions"
    assert axes.get_ylabel() == "accuracy (%)"
    assert legend == [
        "median, majority (published)",
        "levels, lda (chosen)",
        "1-NN, raw greys",
        "guess of the largest class",
    ]
    *curves, guess = axes.lines
    assert [points(line) for line in curves] == [
        [[1, 30], [12.5, 40]],
        [[1, 25], [12.5, 60]],
        [[1, 35], [12.5, 65]],
    ]
    assert guess.get_ydata() == [35, 35]
    corners = axes.collections[0].get_paths()[0].vertices.round(9).tolist()
    assert {tuple(c) for c in corners} == {(1, 20), (1, 40), (12.5, 30), (12.5, 50)}


def test_the_figure_of_values_has_errors_as_shares_of_a_guess(drawn):
    axes, legend = drawn(of_values())
    assert axes.get_ylabel() == "mean error / that of a guess"
    assert legend[-1] == "guess of the middle value"
    *curves, guess = axes.lines
    assert points(curves[1]) == [[5, 1.25], [40, 0.125]]
    assert guess.get_ydata() == [1, 1]
    assert len(axes.collections) == 0


def test_a_figure_is_a_file_in_a_folder(tmp_path):
    curve.check_figure(tmp_path / "curve.PDF")
    (tmp_path / "folder.svg").mkdir()
    with pytest.raises(ValueError, match=r"-o: expected a regular file .*folder\.svg"):
        curve.check_figure(tmp_path / "folder.svg")
    with pytest.raises(ValueError, match=r"\.svg, \.pdf, \.png, found .*curve\.gif"):
        curve.check_figure(tmp_path / "curve.gif")
    with pytest.raises(FileNotFoundError, match=r"a folder to save curve\.svg in"):
        curve.check_figure(tmp_path / "no" / "curve.svg")
