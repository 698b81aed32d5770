"""What a rank's time becomes as ranks are added.

Every rank counts its part of the same noise frames with one thread, then all add their counts, by
gloo on this machine. A row is a rank of a number of ranks: medians and quartiles over the repeats.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.distributed as dist
from torch import Tensor, multiprocessing

from experiments.protocol import ranks as distributed
from experiments.records.measurement import Row, measure
from hdc import HDCClassifier


def run(
    ranks: Sequence[int],
    n: int,
    shape: Sequence[int],
    classes: int,
    repeats: int,
    seed: int,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/distributed/``.

    Args:
        ranks: numbers of ranks; more of them than cores share cores.
        n: number of frames, of all ranks together.
        shape: rows and columns of a frame, [H, W].
        classes: L.
        repeats: number of repeats, after one that does not count.
        seed: seed of the noise.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``rank`` of so many ``ranks`` and its ``frames``;
        quartiles and medians of its times to ``count`` them and to ``add`` the counts, waiting
        included, and the median of both, ``seconds``; ``bytes`` that it gave to the sum;
        ``prototypes_sha256``, equal where the prototypes are.
    """
    config = {
        "_target_": f"{__name__}.run",
        "ranks": ranks,
        "n": n,
        "shape": shape,
        "classes": classes,
        "repeats": repeats,
        "seed": seed,
    }
    return measure("distributed", config, lambda: _rows(config), force=force)


def _rows(config: dict[str, Any]) -> Iterator[Row]:
    for k in config["ranks"]:
        with tempfile.TemporaryDirectory() as folder:
            multiprocessing.spawn(_rank, (k, config, folder), nprocs=k)
            yield from (json.loads(Path(folder, str(rank)).read_text()) for rank in range(k))


def _rank(rank: int, ranks: int, config: dict[str, Any], folder: str) -> None:
    """One of the ranks, in a process of its own; leaves its row in the folder."""
    torch.set_num_threads(1)
    store = dist.FileStore(f"{folder}/store", ranks)
    dist.init_process_group("gloo", store=store, rank=rank, world_size=ranks)
    part = range(config["n"])[distributed.shard(config["n"], ranks, rank)]
    frames = _noise(part, config)
    labels = np.array(part) % config["classes"]
    shape = tuple(config["shape"])
    counting, adding = [], []
    for _ in range(1 + config["repeats"]):
        dist.barrier()
        start = time.perf_counter()
        own = distributed.count(HDCClassifier(), frames, labels)
        counted = time.perf_counter()
        model, sent = distributed.add(HDCClassifier(), own, shape)
        counting.append(counted - start)
        adding.append(time.perf_counter() - counted)
    row: Row = {"ranks": ranks, "rank": rank, "frames": len(part)}
    # From the start, which is common, a rank's time for the sum is its own work and its waiting.
    for name, times in (("count", counting[1:]), ("add", adding[1:])):
        low, median, high = np.quantile(times, [0.25, 0.5, 0.75])
        row |= {f"{name}_q25_s": low, f"{name}_median_s": median, f"{name}_q75_s": high}
    row["seconds"] = float(np.median(np.add(counting, adding)[1:]))
    row["bytes"] = sent
    row["prototypes_sha256"] = hashlib.sha256(model.prototypes_.numpy().tobytes()).hexdigest()[:12]
    Path(folder, str(rank)).write_text(json.dumps(row))
    dist.destroy_process_group()


def _noise(part: Sequence[int], config: dict[str, Any]) -> Tensor:
    """Frames uint8 [n, H, W], each of which is the same in whatever part it comes."""
    frames = torch.empty(len(part), *config["shape"], dtype=torch.uint8)
    for frame, i in zip(frames.numpy(), part, strict=True):
        rng = np.random.default_rng([config["seed"], i])
        frame[:] = rng.integers(0, 256, frame.shape, np.uint8)
    return frames
