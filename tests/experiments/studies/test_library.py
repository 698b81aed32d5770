"""The library's read-outs give the answers of other implementations."""

from rich.console import Console

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.library.measure import library


def test_library_harness_and_plain_numpy_agree(recording):
    scene = configs.part("scene", "recorded")["scene"] | {"path": str(recording(90, 3))}
    run = Run(console=Console(quiet=True), force=True, cache=False)
    split = {"kind": "random", "test_fraction": 0.3}
    rows = list(library.rows(run, scene, split, n_per_class=7, repeats=1))
    assert [(row["readout"], row["peer"]) for row in rows] == [
        ("majority", "NumPy"), ("ridge", "harness"), ("ridge", "scikit-learn"),
        ("neighbours", "harness"), ("neighbours", "scikit-learn"),
    ]  # fmt: skip
    for row in rows:
        assert row["same"] >= row["n_test"] - (row["readout"] != "majority"), row
        assert row["fit_s"] > 0
        assert row["peer_predict_s"] > 0
