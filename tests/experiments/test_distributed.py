"""Training on several ranks: the prototypes of one, bit for bit, whoever has which frames."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import torch.distributed as dist

from baselines.softmax import SoftmaxRegression
from experiments import distributed, record
from hdc import HDCClassifier

CHECKOUT = Path(__file__).resolve().parents[2]
SHAPE = (5, 13)  # 65 pixels: one word and a bit


def frames_and_labels(n=600):
    rng = np.random.default_rng(1)
    names = np.array(["left", "right", "µ"])
    # 600 frames: a count above 255 does not fit into the bytes that smaller ones travel in.
    labels = names[np.sort(rng.choice(3, n, p=[0.5, 0.3, 0.2]))]
    return rng.integers(0, 256, (n, *SHAPE), dtype=np.uint8), labels


# Uneven parts; sorted labels, so that ranks lack classes; a rank without any frame.
CUTS = {
    "one": [0, 600],
    "two": [0, 299, 600],
    "uneven": [0, 10, 580, 600],
    "empty": [0, 600, 600],
    "few": [200, 205, 400, 420],
}


def a_rank(rank, cuts, address, parameters, out):
    """One of the ranks, in its own process: fits its part and saves what it has."""
    torch.set_num_threads(1)
    store = dist.FileStore(address, len(cuts) - 1)
    dist.init_process_group("gloo", store=store, rank=rank, world_size=len(cuts) - 1)
    frames, labels = frames_and_labels()
    part = slice(cuts[rank], cuts[rank + 1])
    for k, given in enumerate(parameters):
        model, sent = distributed.fit(HDCClassifier(**given), frames[part], labels[part], SHAPE)
        model.save(f"{out}/{rank}-{k}")
        Path(f"{out}/{rank}-{k}-sent").write_text(str(sent))
    dist.destroy_process_group()


PARAMETERS = [{}, {"ties": "random", "seed": 3}, {"ties": "one"}, {"prototype": "integer"}]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """trained[name] → folder with what every rank has; the ranks of all cases run at once."""
    context = torch.multiprocessing.get_context("fork")
    folders, processes = {}, []
    for name, cuts in CUTS.items():
        folders[name] = tmp_path_factory.mktemp(name)
        for rank in range(len(cuts) - 1):
            arguments = (rank, cuts, f"{folders[name]}/store", PARAMETERS, str(folders[name]))
            processes.append(context.Process(target=a_rank, args=arguments, daemon=True))
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [process.exitcode for process in processes] == [0] * len(processes)
    return folders


@pytest.mark.parametrize("name", CUTS)
def test_every_rank_has_the_model_of_all_frames(trained, name):
    cuts = CUTS[name]
    frames, labels = (part[cuts[0] : cuts[-1]] for part in frames_and_labels())
    for k, parameters in enumerate(PARAMETERS):
        whole = HDCClassifier(**parameters).fit(frames, labels)
        for rank in range(len(cuts) - 1):
            model = HDCClassifier.load(trained[name] / f"{rank}-{k}")
            assert model.classes_.tolist() == whole.classes_.tolist()
            assert model.counts_.tolist() == whole.counts_.tolist()
            assert torch.equal(model.counters_.planes, whole.counters_.planes)
            assert torch.equal(model.prototypes_, whole.prototypes_)
            assert model.get_params() == whole.get_params()
            # It can learn on like any other.
            model.partial_fit(frames[:7], labels[:7])
            again = HDCClassifier(**parameters).fit(frames, labels).partial_fit(
                frames[:7], labels[:7]
            )
            assert torch.equal(model.prototypes_, again.prototypes_)


def test_what_travels_is_an_integer_a_pixel_and_class_as_small_as_may_be(trained):
    pixels = SHAPE[0] * SHAPE[1]
    for name, classes, width in (("one", 3, 4), ("uneven", 3, 4), ("few", 2, 1)):
        assert int((trained[name] / "0-0-sent").read_text()) == classes * pixels * width


@pytest.mark.parametrize(("n", "ranks"), [(10, 3), (2, 3), (0, 2), (7, 1), (400, 7)])
def test_shards_are_a_partition_into_nearly_equal_parts(n, ranks):
    parts = [range(n)[distributed.shard(n, ranks, rank)] for rank in range(ranks)]
    assert [i for part in parts for i in part] == list(range(n))
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_a_model_that_is_no_sum_of_counts_is_refused():
    with pytest.raises(ValueError, match="sum of counts under torchrun .*SoftmaxRegression"):
        distributed.Sharded(SoftmaxRegression(), 2)


def test_without_torchrun_nothing_is_distributed(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "4")  # some schedulers set it
    assert not distributed.launched()
    assert distributed.local_ranks() == 1


def test_torchrun_makes_one_record_with_the_predictions_of_one_process(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    frames, labels = frames_and_labels(100)
    np.savez(tmp_path / "frames.npz", frames=frames, labels=labels)
    command = ["-m", "experiments.run", "scene=recorded", f"scene.path={tmp_path}/frames.npz"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    for start in ([], ["-m", "torch.distributed.run", "--nproc-per-node=2"]):
        done = subprocess.run(
            [sys.executable, *start, *command, "threads=1"],
            capture_output=True, text=True, timeout=100, env=environment, cwd=tmp_path,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    found = [record.read_record(path) for path in (tmp_path / "results" / "runs").iterdir()]
    one, two = sorted(found, key=lambda entry: len(entry["config"]["model"]), reverse=True)
    assert two["config"]["model"]["ranks"] == 2
    assert two["config"]["model"]["model"] == one["config"]["model"]
    assert two["command"].startswith("torchrun --nproc-per-node=2 -m experiments.run")
    assert "experiments/distributed.py" in two["environment"]["sources"]
    assert "experiments/distributed.py" not in one["environment"]["sources"]
    assert {two["status"], one["status"]} == {"finished"}
    for key in ("predicted", "data_sha256", "n_train", "confusion", "test_accuracy_final"):
        assert two[key] == one[key]
