"""Rules 3: bits against grey values, from records that are made up."""

import subprocess

import numpy as np
import pytest
from omegaconf import OmegaConf
from scipy import stats

from experiments.records import configs
from experiments.records.files import ROOT
from experiments.records.results import Results
from experiments.records.rows import pack_labels
from experiments.studies.claims import contest, view
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import FROZEN as FROZEN_YAML
from experiments.studies.claims.frozen import digest
from experiments.studies.claims.frozen import rules as rules_2

FROZEN = contest.rules()
OBJECTS = 10  # test objects of a draw; each has ten frames


def rows_of(wrong_bits, wrong_greys, draws=4, n=50):
    """Frames of objects, of which so many of each are wrong; an object is a class and a group."""
    labels = np.repeat(np.arange(OBJECTS), 10)
    rows = []
    for draw in range(draws):
        for model, wrong in ((FROZEN.bits, wrong_bits), (FROZEN.greys, wrong_greys)):
            counts = np.broadcast_to(wrong, OBJECTS)
            predicted = labels.copy()
            for k, count in enumerate(counts):
                predicted[10 * k : 10 * k + count] = (k + 1) % OBJECTS
            row = {"seed": 0, "split": "counts", "draw": draw, "model": model}
            row |= {
                "n_test": len(labels),
                "n": [n],
                "predicted": [pack_labels(predicted)],
            }
            row |= {"n_classes": OBJECTS}
            if model == FROZEN.bits:
                row |= {
                    "labels": pack_labels(labels),
                    "groups": pack_labels(labels * 0 + draw),
                }
            rows.append(row)
    return rows


@pytest.fixture
def frame(tmp_path, write_measurement):
    """frame(scene=(wrong of bits, wrong of greys), …)"""

    def write(**scenes):
        for scene, wrong in scenes.items():
            part = configs.part("scene", scene)
            config = {"scene": part["scene"], "splits": {"counts": part["split"]}}
            rows = rows_of(*wrong)
            write_measurement(FROZEN.experiment, rows, config=config, scene=scene)
        return Results(tmp_path).frame(FROZEN.experiment)

    return write


def test_the_rules_before_stand_as_they_were_frozen():
    assert (rules_2().version, FROZEN.version) == (2, 3)
    status = {name: each.status for name, each in FROZEN.recordings.items()}
    assert [name for name in status if status[name] == "confirmatory"] == [
        "visuotactile"
    ]
    assert set(status) - set(rules_2().recordings) == {"visuotactile"}
    for name, each in FROZEN.recordings.items():
        wanted = configs.part("scene", name)["split"]
        assert all(wanted.get(key) == value for key, value in each.split.items())
    for name in (FROZEN.bits, FROZEN.greys):
        model = configs.part("model", name)["model"]
        assert (model["fixed"], model["margin"], model["folds"]) == (
            FROZEN.fixed,
            1.0,
            5,
        )


def test_the_commit_that_is_named_holds_the_rules():
    """A change of the file is a new version: its digest is that of the commit that froze it."""
    written = OmegaConf.load(FROZEN_YAML).rules_3
    assert digest(contest.RULES_3) == written.digest
    place = contest.RULES_3.relative_to(ROOT).as_posix()
    words = ["git", "-C", str(ROOT), "show", f"{written.commit}:{place}"]
    shown = subprocess.run(words, capture_output=True, check=False)
    if shown.returncode:
        pytest.skip("no checkout with its whole history")
    assert shown.stdout == contest.RULES_3.read_bytes()


def test_a_laboratory_counts_once_by_equal_weights(frame):
    """Differences by hand: +10, +10 and 0 (one laboratory), −10 points."""
    data = frame(gelsight=(1, 2), tactip=(1, 2), tactip_edge=(1, 1), diffuser=(2, 1))
    found = contest.measured(Evidence(data))
    values = {name: round(one.value, 9) for name, one in found.items()}
    assert values == {
        "gelsight": 0.1,
        "tactip": 0.1,
        "tactip_edge": 0,
        "diffuser": -0.1,
    }
    whole = contest.verdict(found)
    units = np.array([0.1, 0.05, -0.1])
    half = stats.t.ppf(0.975, 2) * units.std(ddof=1) / np.sqrt(3)
    assert whole.equal == pytest.approx(
        (units.mean(), units.mean() - half, units.mean() + half)
    )
    assert (whole.word, whole.units) == ("undecided", 3)


@pytest.mark.parametrize(
    ("intervals", "word"),
    [
        ([(0.0, -0.02, 0.02), (0.0, -0.029, 0.03)], "yes"),
        ([(0.0, -0.02, 0.02), (0.0, -0.031, 0.03)], "undecided"),  # both are needed
        ([(-0.1, -0.2, -0.04), (-0.1, -0.15, -0.031)], "no"),
        ([(-0.1, -0.2, -0.04), (-0.1, -0.15, -0.029)], "undecided"),
        ([(0.0, float("nan"), float("nan")), (0.0, -0.01, 0.01)], "undecided"),
    ],
)
def test_a_word_needs_both_intervals(intervals, word):
    assert contest.word_of(*(contest.Estimate(*each) for each in intervals)) == word


def test_another_split_and_an_unlisted_recording_enter_nothing(
    tmp_path, write_measurement
):
    for scene in ("gelsight", "spr"):
        config = {
            "scene": configs.part("scene", scene)["scene"],
            "splits": {"counts": {"kind": "random", "test_fraction": 0.5}},
        }
        write_measurement(FROZEN.experiment, rows_of(1, 2), config=config, scene=scene)
    data = Results(tmp_path).frame(FROZEN.experiment)
    assert contest.measured(Evidence(data)) == {}


def test_the_confirmatory_interval_resamples_objects_not_frames(frame):
    """Two of ten objects lost by six frames of ten each: wide over objects, narrow over frames."""
    bits = [6, 6, 0, 0, 0, 0, 0, 0, 0, 1]
    greys = [0, 0, 0, 0, 0, 0, 0, 0, 0, 1]
    ((scene, found),) = contest.confirmed(
        Evidence(frame(visuotactile=(bits, greys)))
    ).items()
    assert scene == "visuotactile"
    assert found.value == pytest.approx(-0.12)
    # 40 objects (ten classes, four groups), eight of which lose 0.6
    share = stats.binom.ppf([0.025, 0.975], 40, 0.2) / 40
    assert (found.low, found.high) == pytest.approx(
        tuple(-0.6 * share[::-1]), abs=0.016
    )


def shown(tmp_path):
    """The cells of the table by model and recordings; None where there is no table."""
    results = Results(tmp_path)
    tables = [each for each in view.STUDY.tables_of(results) if each.name == "contest"]
    if not tables:
        return None
    (table,) = tables
    return {(row[0], row[1]): row[2:] for row in table.cells()}


def test_the_table_has_every_row_before_it_is_measured(
    tmp_path, write_measurement, frame
):
    assert shown(tmp_path) is None
    row = {"seed": 0, "split": "counts", "draw": 0, "model": "hdc", "n_test": 10}
    row |= {"n": [5], "right": [5]}
    write_measurement("recordings", [row], scene="gelsight")
    cells = shown(tmp_path)
    assert {value for row in cells.values() for value in row[:2]} == {
        contest.NOT_MEASURED
    }
    frame(gelsight=(1, 2), diffuser=(2, 1), visuotactile=(1, 2))
    found = shown(tmp_path)
    assert set(found) == set(cells)
    bits = "Bits, chosen"
    assert found[bits, "all laboratories"][0].startswith("+3.3 [")
    assert found[bits, "all laboratories"][2:] == [
        "3",
        "–",
    ]  # seven recordings are missing
    assert found[bits, "without Exhor"][0].startswith("0 [")
    assert found[bits, "Yc1007942 alone"][0] == "+10.0"
    assert found[bits, "visuotactile, by test objects"] == [
        "+10.0 [+10.0, +10.0]",
        "–",
        "–",
        "yes",
    ]
    assert found["HDC", "all laboratories"][0] == contest.NOT_MEASURED


def test_what_was_measured_and_ranks_nothing_is_not_called_unmeasured(tmp_path, frame):
    """Both families have every frame of the diffusers right."""
    frame(gelsight=(1, 2), diffuser=(0, 0))
    found = shown(tmp_path)
    for what in ("zcshinee alone", "without zcshinee"):
        assert found["Bits, chosen", what][0] == contest.NO_EVIDENCE
    assert found["Bits, chosen", "Exhor alone"][0] == contest.NOT_MEASURED
    assert found["Bits, chosen", "all laboratories"][0] == "+10.0"


def test_a_verdict_needs_every_recording_of_the_rules(tmp_path, frame):
    frame(**dict.fromkeys(contest.rules().recordings, (1, 2)))
    found = shown(tmp_path)["Bits, chosen", "all laboratories"]
    assert found[0].startswith("+10.0 [")
    assert found[2:] == ["7", "yes"]
