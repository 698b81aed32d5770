"""Frames of the simulated sensor to look at: ``experiment=sensor_pictures``.

For some classes the whole frame, a part of it enlarged, the same part of its hypervector, and what
the touch alone changes there: the noiseless intensity minus that of the same moment without the
touch, in units of the mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from rich.console import Console

from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, folder_of, measure
from experiments.studies.correlation.measure import check_crop
from experiments.studies.sensor.kinds import LARGEST, REDUCED
from hdc import bits
from hdc.encode import encode
from scenes.sensor.scene import SpeckleScene


def run(
    scene: Mapping[str, Mapping[str, Any]],
    seed: int,
    crop: Sequence[int],
    force: bool = False,
) -> Path:
    """Make them, and write ``measured/sensor_pictures/``: rows.csv and NAME.npz for every scene.

    Args:
        scene: configurations of simulated scenes by name.
        seed: seed of all of them.
        crop: top, left and edge in pixels of the enlarged part.
        force: make them again.

    Returns:
        Path: the folder. Row k of a scene tells ``scene``, ``class``, ``session`` and ``sample`` of
        place k of its arrays: ``frame`` uint8 [K, H, W], averaged over :data:`REDUCED` pixels;
        ``part`` uint8, ``ones`` bool and ``change`` int8, in 1/127 of :data:`LARGEST`, all
        [K, edge, edge].
    """
    config = {"_target_": f"{__name__}.run", "scene": scene, "seed": seed, "crop": crop}
    folder, console = folder_of("sensor_pictures", config), Console(highlight=False)

    def compute() -> Iterator[Row]:
        for name, of_scene in scene.items():
            made: Any = scene_at(of_scene, seed, False, console)
            chosen = examples(made)
            arrays: dict[str, Any] = pieces(made, chosen, crop)
            np.savez_compressed(folder / f"{name}.npz", **arrays)
            for index in chosen:
                yield {
                    "scene": name,
                    "class": made.classes[made.labels[index]],
                    "session": int(made.samples["session"][index]),
                    "sample": index,
                }

    return measure("sensor_pictures", config, compute, force=force, console=console)


def examples(made: SpeckleScene) -> list[int]:
    """The first sample of a class in each session: of every class, of every second where there are
    two sessions, of every tenth of many."""
    step = 10 if len(made.classes) > 10 else len(made.sessions)
    return [
        int(np.flatnonzero((made.labels == label) & (made.samples["session"] == session))[0])
        for session in range(len(made.sessions))
        for label in range(0, len(made.classes), step)
    ]


def pieces(made: SpeckleScene, chosen: Sequence[int], crop: Sequence[int]) -> dict[str, np.ndarray]:
    """The arrays of :func:`run` for these samples."""
    top, left, edge = check_crop(crop, made.shape)
    part = (slice(None), slice(top, top + edge), slice(left, left + edge))
    frames = made.frames(chosen)
    ones = bits.unpack(encode(frames), frames[0].numel()).view(frames.shape)
    size = (made.shape[1] // REDUCED, made.shape[0] // REDUCED)
    changed = torch.stack([change(made, index) for index in chosen]).numpy()
    return {
        "frame": np.stack([
            cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in frames.numpy()
        ]),
        "part": frames.numpy()[part],
        "ones": ones.numpy()[part],
        "change": np.clip(changed[part] * 127 / LARGEST, -127, 127).round().astype(np.int8),
    }  # fmt: skip


def change(made: SpeckleScene, index: int) -> torch.Tensor:
    """Intensity with minus without the touch at the same temperature, float32 [H, W], mean 1."""
    sensor = made.sensor
    touched = made.phases(index)
    alone = sensor.phase + sensor.sensitivity * float(made.samples["temperature"][index])
    with_touch, without = (sensor.mounted.intensity(phases[None])[0] for phases in (touched, alone))
    return (with_touch - without).cpu()
