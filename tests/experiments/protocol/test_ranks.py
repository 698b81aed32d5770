"""Training on several ranks: the prototypes of one, bit for bit, whoever has which frames."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import torch.distributed as dist

from baselines.softmax import SoftmaxRegression
from experiments.protocol import ranks as distributed
from experiments.records import record
from experiments.records.files import results_dir
from hdc import HDCClassifier

CHECKOUT = Path(__file__).resolve().parents[3]
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
            again = (
                HDCClassifier(**parameters).fit(frames, labels).partial_fit(frames[:7], labels[:7])
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
    with pytest.raises(ValueError, match=r"sum of counts under torchrun .*SoftmaxRegression"):
        distributed.Sharded(SoftmaxRegression(), 2)


def test_without_torchrun_nothing_is_distributed(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "4")  # some schedulers set it
    assert not distributed.launched()
    assert distributed.local_ranks() == 1


@pytest.fixture
def archive(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    frames, labels = frames_and_labels(100)
    np.savez(tmp_path / "frames.npz", frames=frames, labels=labels)
    return tmp_path / "frames.npz"


def assert_one_record_each_with_equal_predictions(ranks):
    runs = results_dir() / "runs"
    found = [record.read_record(path) for path in runs.iterdir()]
    sharded, one = sorted(found, key=lambda entry: len(entry.config["model"]))
    assert sharded.config["model"]["ranks"] == ranks
    assert sharded.config["model"]["model"] == one.config["model"]
    assert f"torchrun --nproc-per-node={ranks} -m experiments.run" in sharded.command
    assert "experiments/protocol/ranks.py" in sharded.environment.sources
    assert "experiments/protocol/ranks.py" not in one.environment.sources
    assert {sharded.status, one.status} == {"finished"}
    for key in ("predicted", "data_sha256", "n_train", "test_accuracy_final"):
        assert getattr(sharded, key) == getattr(one, key)
    files = [path.name for path in runs.rglob("*") if path.is_file()]
    assert sorted(files) == [".lock"] * 2 + ["curve.csv"] * 2 + ["record.json"] * 2


def as_of_torchrun(rank, ranks, port):
    """What torchrun puts into the environment of a rank."""
    values = {
        "RANK": rank, "LOCAL_RANK": rank, "WORLD_SIZE": ranks, "LOCAL_WORLD_SIZE": ranks,
        "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "TORCHELASTIC_RUN_ID": "a-test",
    }  # fmt: skip
    return {key: str(value) for key, value in values.items()}


@pytest.fixture
def port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def test_ranks_make_one_record_with_the_predictions_of_one_process(archive, start, port):
    overrides = ("scene=recorded", f"scene.path={archive}")
    one = start(*overrides)
    one.join(60)
    for twice in ("training", "finished before"):
        ranks = [start(*overrides, environment=as_of_torchrun(r, 3, port)) for r in range(3)]
        for process in ranks:
            process.join(60)
        assert [process.exitcode for process in ranks] == [0, 0, 0], ranks[0].out.read_text()
        assert twice in ranks[0].out.read_text()
        assert ranks[1].out.read_text() == ranks[2].out.read_text() == ""
    assert_one_record_each_with_equal_predictions(3)


def test_another_model_ends_in_one_line(archive, start, port):
    process = start(
        "scene=recorded", f"scene.path={archive}", "model=correlation",
        environment=as_of_torchrun(0, 1, port),
    )  # fmt: skip
    process.join(60)
    assert process.exitcode == 1
    (line,) = process.out.read_text().splitlines()
    assert line.startswith("error: model: expected a model whose training is a sum of counts")
    assert not (results_dir() / "runs").exists()


@pytest.mark.slow
def test_torchrun_itself(archive):
    command = ["-m", "experiments.run", "scene=recorded", f"scene.path={archive}", "threads=1"]
    for before in ([], ["-m", "torch.distributed.run", "--nproc-per-node=2"]):
        subprocess.run(
            [sys.executable, *before, *command],
            check=True, timeout=100, env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        )  # fmt: skip
    assert_one_record_each_with_equal_predictions(2)
