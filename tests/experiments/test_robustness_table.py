"""The table and figure of the robustness measurement pool what was measured and say so."""

from __future__ import annotations

import pytest

from experiments import evaluate, figures, measurement, record, robustness_table, table_text
from experiments.robustness_table import COLUMNS, figure, markdown, rows


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """A measurement of two models: two seeds of 10 test frames, two draws of flipped bits."""
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    cases = [("none", 0.0), ("power", 0.2), ("dead_pixels", 0.05), ("shift", 1),
             ("bit_flips", 1e-4), ("bit_flips", 0.5), ("bit_flips_int8", 0.0),
             ("bit_flips_int8", 0.5)]  # fmt: skip

    def compute():
        for model in ("hdc", "softmax"):
            for seed in (0, 1):
                for name, level in cases if model == "softmax" else cases[:-2]:
                    for draw in range(2 if name == "bit_flips" else 1):
                        lost = {"none": 0, "bit_flips": 8 if model == "softmax" and draw else 1}
                        right = 10 - lost.get(name, 2) - seed
                        yield {"scene": "touch", "origin": "simulated", "model": model,
                               "seed": seed, "disturbance": name, "level": level, "draw": draw,
                               "n_test": 10, "right": right, "accuracy": right / 10,
                               "chance": 0.2, "model_bits": 8000}  # fmt: skip

    measurement.measure("robustness", {"_target_": "experiments.robustness.run"}, compute)
    return tmp_path


def of(found, model, name, level):
    key = (model, name, level)
    (row,) = (r for r in found if (r["model"], r["disturbance"], r["level"]) == key)
    return row


def test_seeds_and_draws_are_pooled(measured):
    found = rows(measured)
    assert len(found) == 6 + 8
    clean = of(found, "hdc", "none", 0)
    assert (clean["n_test"], clean["seeds"], clean["draws"]) == (20, 2, 2)
    assert clean["test_accuracy_final"] == 0.95
    assert (clean["test_ci_low"], clean["test_ci_high"]) == evaluate.wilson(19, 20)
    flipped = of(found, "softmax", "bit_flips", 1e-4)
    assert (flipped["n_test"], flipped["seeds"], flipped["draws"]) == (40, 2, 4)
    assert flipped["test_accuracy_final"] == pytest.approx((0.9 + 0.2 + 0.8 + 0.1) / 4)
    assert (flipped["lowest"], flipped["highest"]) == (0.1, 0.9)
    assert {row["code"] for row in found} == {"current"}
    assert set(COLUMNS) == set(found[0])
    assert table_text.to_csv(found, COLUMNS).count("\n") == 15


def test_markdown_says_what_is_shown(measured):
    text = markdown(rows(measured))
    assert "simulated frames" in text
    assert "| stored model |  | 1.00 kB | 1.00 kB |" in text
    assert "| laser power ± | 20 % | 75 [53.1, 88.8] |" in text
    assert "| bit error rate | 1e-04 | 85 (80…90) | 50 (10…90) |" in text
    assert "| bit error rate, 8-bit numbers | 0.5 | – | 75 (70…80) |" in text
    assert "seeds: 2" in text
    assert "of 4 draws" in text
    assert "Made by other code" not in text


def test_other_code_is_named(measured, monkeypatch):
    monkeypatch.setattr("experiments.sources._now", lambda name: "other")
    assert "experiments/robustness.py" in markdown(rows(measured))


@pytest.mark.filterwarnings("error")
def test_figure_fits_and_says_what_it_is(measured):
    drawn = figure(rows(measured))
    drawn.draw_without_rendering()
    box = drawn.get_tightbbox(drawn.canvas.get_renderer())
    assert drawn.get_figwidth() == figures.WIDTH
    assert (box.x0 >= 0, box.y0 >= 0) == (True, True)
    assert box.x1 <= drawn.get_figwidth()
    assert box.y1 <= drawn.get_figheight()
    words = figures.save(drawn, "svg").decode()
    for expected in ("simulated frames, 2 seeds", "bit error rate", "dead pixels (%)",
                     "camera shifted (px)", "chance", "8 bits for each float32"):  # fmt: skip
        assert expected in words
    figures.plt.close(drawn)


def test_nothing_measured_is_no_rows_and_no_figure(tmp_path, measured):
    assert rows(tmp_path / "elsewhere") == []
    assert figure([]) is None
    folder = measured / "measured" / "robustness"
    record.write_record(folder, {**record.read_record(folder), "status": "failed"})
    assert rows(measured) == []


def test_every_disturbance_has_a_name():
    from experiments.disturbances import OF_FRAMES

    assert set(robustness_table._LEVELS) == {"none", *robustness_table._FLIPS, *OF_FRAMES}
