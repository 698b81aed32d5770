"""The table of claims is that which an independent script computes from the records."""

import csv
import subprocess
import sys

import numpy as np
import pytest

from experiments.records import configs
from experiments.records.files import REFERENCE, ROOT
from experiments.records.results import Results
from experiments.records.rows import pack_labels
from experiments.studies.claims import frozen, view

RULES = frozen.rules()


def recompute(folder):
    """Exit status of the script and what it says."""
    words = [sys.executable, "-m", "tests.experiments.recompute_claims", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert not done.stderr
    return done.returncode, done.stdout


def test_the_committed_table_is_that_of_the_committed_records():
    with (REFERENCE / "tables" / "claims.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if "digest" not in rows[0]:
        pytest.skip("the committed table is of an earlier version of the rules")
    status, said = recompute(REFERENCE)
    assert status == 0, said


def test_the_script_shares_nothing_with_the_harness():
    for path in (ROOT / "tests" / "experiments").glob("recompute_*.py"):
        lines = path.read_text(encoding="utf-8").splitlines()
        imports = [x for x in lines if x.startswith(("import ", "from "))]
        assert not any(
            "import experiments" in x or "from experiments" in x for x in imports
        )
        assert not any("hdc" in x or "scipy" in x for x in imports)


# Own records --------------------------------------------------------------------------------------


def recording_rows(rng, models, seeds, draws, packed):
    """Rows of models of different accuracy, which predict or are counted."""
    sizes, n_test = [1, 5, 20, 50], 80
    rows = []
    for seed in range(seeds):
        for draw in range(draws):
            truth = rng.integers(0, 4, n_test)
            for k, (model, accuracy) in enumerate(models.items()):
                rights = [
                    rng.random(n_test) < accuracy - 0.2 / n + rng.normal(0, 0.03)
                    for n in sizes
                ]
                row = {"split": "counts", "seed": seed, "draw": draw, "model": model,
                       "n_test": n_test, "n": sizes}  # fmt: skip
                if packed:
                    texts = [
                        pack_labels(np.where(right, truth, (truth + 1) % 4))
                        for right in rights
                    ]
                    row["predicted"] = texts
                    if k == 0:
                        row["labels"] = pack_labels(truth)
                else:
                    row["right"] = [int(right.sum()) for right in rights]
                rows.append(row)
    return rows


@pytest.fixture
def every_study(write_measurement, write_run, predicting):
    """Records of every study that a claim rests on, but with invented numbers."""
    rng = np.random.default_rng(35)

    def write(name, rows, scene, **config):
        config["scene"] = configs.part("scene", scene)["scene"]
        write_measurement(name, rows, config=config, scene=scene)

    levels = {"hdc": 0.6, "hdc_levels_lda": 0.75, **dict.fromkeys(RULES.rivals, 0.7)}
    for k, (scene, recording) in enumerate(RULES.recordings.items()):
        models = {m: level - 0.05 * (k % 3) for m, level in levels.items()}
        computed = recording.frames == "computed"
        rows = recording_rows(
            rng, models, 6 if computed else 1, 1 if computed else 5, packed=k % 2
        )
        split = configs.part("scene", scene)["split"]
        write("recordings", rows, scene, splits={"counts": split})
    for scene in ("drift", "fibres_exchanged"):
        rows = []
        for seed in range(4):
            of = {"origin": "x", "seed": seed, "model": "hdc",
                  "n_test_new": 100, "n_test_old": 90, "n_old": 400, "right_old": 80}  # fmt: skip
            ways = [("stored", None, 0), ("replace", 0.75, 50), ("replace", 0.5, 50),
                    ("replace", 0.75, 20), ("new", None, 50)]  # fmt: skip
            for method, p, n_new in ways:
                right = 30 if method == "stored" else int(rng.integers(45, 80))
                row = of | {
                    "method": method,
                    "p": p,
                    "n_new": n_new,
                    "right_new": right,
                }
                rows.append(predicting(row))
        write("drift", rows, scene)
    for scene in ("touch", "fibre"):
        rows = [
            {"origin": "x", "model": model, "seed": seed, "disturbance": kind, "level": level,
             "n_test": 120, "right": int(rng.integers(90, 110)), "n_classes": 4, "model_bytes": 9}
            for seed in range(5) for model in ("hdc", "softmax_dual")
            for kind, level in (("none", 0.0), ("bit_flips", 0.01), ("bit_flips", 0.1))
        ]  # fmt: skip
        write("robustness", rows, scene)
        rows = [
            {"origin": "x", "seed": seed, "kind": kind, "samples": samples, "class_i": i,
             "class_j": j, "value": float(rng.random() + gain * (i == j)), "n": 80}
            for seed in range(5) for samples in ("held-out", "all")
            for kind, gain in (("speckle", 1), ("hypervector", 2), ("prototype", 3))
            for i in "ABC" for j in "ABC"
        ]  # fmt: skip
        write("correlation", rows, scene)
    rows = [
        {"origin": "x", "seed": seed, "way": way, "turn": seed, "model": model,
         "seconds": None if model == "cnn3" else float(rng.uniform(4, 12)), "hdc_seconds": 0.5,
         "train_accuracy": 1.0, "test_accuracy": 1.0}
        for way in ("libraries", "tuned")
        for model in ("hdc", "softmax", "softmax_dual", "cnn1", "cnn3")
        for seed in range(1 if model == "cnn3" else 9)
    ]  # fmt: skip
    for seed in range(7):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.4 + 0.01 * seed}])
        beside = {"hdc": 0.5} if seed % 2 else {}
        for model in ("softmax", "softmax_dual", "cnn1", "cnn3")[
            : 4 if seed < 3 else 2
        ]:
            learnt = {"loss": 1.0} if model != "softmax_dual" else {}
            curve = [{"training_s": float(rng.uniform(1, 9)), **learnt}]
            write_run(model, seed=seed, curve=curve, beside_s=beside)
    write_measurement("times_grid", rows, scene="touch")


def table_of(folder):
    table = next(t for t in view.STUDY.tables_of(Results(folder)) if t.name == "claims")
    (folder / "tables").mkdir(exist_ok=True)
    path = folder / "tables" / "claims.csv"
    path.write_text(table.csv(), encoding="utf-8")
    return path


def test_the_script_and_the_table_agree_on_every_claim(tmp_path, every_study):
    path = table_of(tmp_path)
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["claim"] for row in rows} == set(RULES.claims)
    assert {row["rival"] for row in rows if row["claim"] == "accuracy"} == set(
        RULES.rivals
    )
    status, said = recompute(tmp_path)
    assert status == 0, said


# Each in the first row of its claim.
CHANGES = [
    ("accuracy", "mean", "1.5"),
    ("accuracy_mended", "status", "confirmatory"),
    ("few_samples", "predicted_low", "-1"),
    ("few_samples_mended", "digest", "0" * 12),
    ("objects", "mean_high", ""),
    ("softmax", "word", "maybe"),
    ("contrast", "word", "undecided"),
    ("contrast", "by_scene", "Touch: 1 [0.5, 1.5]; Fibre 1: 2 [1, 3]"),
    ("recalibration", "frames", "simulated"),
    ("faults", "by", "this repository"),
]


def test_a_changed_cell_and_a_missing_row_are_named(tmp_path, every_study):
    path = table_of(tmp_path)
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    expected = ["faults against unflipped at 10 %: missing"]
    for claim, key, value in CHANGES:
        row = next(row for row in rows if row["claim"] == claim)
        assert row[key] != value
        row[key] = value
        expected.append(f"{claim} against {row['rival']}, {key}: ")
    kept = [row for row in rows if row["rival"] != "unflipped at 10 %"]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(kept)
    status, said = recompute(tmp_path)
    assert status == 1
    assert len(said.splitlines()) == len(expected)
    for beginning in expected:
        assert beginning in said
