"""Models by scene: measured ones first, differences seed by seed."""

import pytest

from experiments.records.results import Results
from experiments.studies.models.view import STUDY

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def runs(write_run, write_scene):
    """Two seeds of some models; on the measured scene HDC is behind ridge in both."""
    for seed in (0, 1):
        write_scene("fibre_grouped", {0: 1, 1: 2}, seed=seed)
        write_scene("fibre_grouped", dict([(0, 1)][seed:]), seed=seed, model="ridge")
        write_scene("fibre_grouped", {0: 1, 1: 2, 2: 3}, seed=seed, model="linear_bits")
        write_scene("finger", {3: 4}, seed=seed)
        write_run("hdc", seed=seed)
        curve = [{"training_s": 2.0, "loss": 0.1, "train_accuracy": 0.7}]
        write_run("softmax", seed=seed, wrong=range(3), curve=curve)
    write_scene("finger", {}, model="ridge", seed=1)
    write_scene("finger", {1: 2}, model="ridge", seed=7)  # a seed that HDC has not


def test_measured_optics_stand_first(tmp_path, runs):
    (table,) = STUDY.tables(Results(tmp_path))
    cells = table.cells()
    assert [row[0] for row in cells] == [
        *["fibre, other positions (measured)"] * 3,
        *["touch (simulated)"] * 2,
        *["finger (simulated)"] * 2,
    ]
    hdc, bits, ridge = (dict(zip(table.heads, row, strict=True)) for row in cells[:3])
    assert (hdc["Model"], ridge["Model"]) == ("HDC", "Ridge read-out")
    assert hdc["Test error, % [95 %]"].startswith("20 [")
    assert ridge["− HDC, points [95 %]"].startswith("+15.0 [")
    assert ridge["Seeds above, below HDC"] == "2, 0"
    assert bits["Seeds above, below HDC"] == "0, 2"
    assert "Not run: fibre, tactile, spatial." in table.note


def test_the_figure_has_a_panel_a_scene(runs, drawn):
    words = drawn(STUDY)["all_scenes"]
    for expected in ("fibre, other positions measured", "touch simulated", "finger simulated",
                     "training time (s)", "test error (%)", "Ridge, HDC's bits",
                     "frames of measured matrices and simulated frames"):  # fmt: skip
        assert expected in words
