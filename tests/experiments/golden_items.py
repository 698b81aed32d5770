"""Numbers that :mod:`.golden_numbers` keeps: of words, models, splits, scenes and experiments.

Words and scores of bits are compared exactly, by a digest. Labels of models of floats are of frames
between two classes, and only those that a little more of the one or the other class does not
change: processors round differently.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.evaluate import train_until
from experiments.protocol.model import instantiate
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, named
from experiments.records import configs
from experiments.records.rows import unpack_labels
from scenes.frames import Frames
from tests.experiments.composed import composed, made, part

FRAMES = 300  # more than a chunk of 256
SIDES = {
    65: (5, 13),
    4097: (17, 241),
}  # rows and columns of D pixels: neither fills its words
OF_BITS = (
    "hdc",
    "hdc_integer",
    "hdc_levels",
    "hdc_reference",
    "hdc_trained",
)  # models without a floating-point number that a processor may round otherwise
DTYPES = {"uint8": torch.uint8, "uint16": torch.uint16, "float32": torch.float32}
SHORT = StopRule(least_steps=1, most_steps=12, loss=1e-9)
TOLERANCE = 1e-3  # of floating-point numbers, of their size or of one
# Of sums over an experiment in small: processors round some grey values and some labels otherwise.
OF_STUDIES = 0.02
SMALL_CAMERA = (
    "+scene.sensor.camera={_target_: scenes.sensor.camera.Camera, "
    "grid: 64, crop: 32, pupil: 24}"
)
SMALL_SENSOR = ("scene.samples_per_class=10", SMALL_CAMERA)
# Experiments in small: words of the command line beside `experiment=`.
EXPERIMENTS = {
    "correlation": ("task.seeds=[0]", *SMALL_SENSOR),
    "drift": ("task.seeds=[0]", "task.n_test=20", "task.n_new=[5]", "task.p=[0.5]",
              "task.n_alone=[5]", "task.n_zero=[10]", "task.n_one_class=[5]", *SMALL_SENSOR),
    "coverage": ("scene=touch", "task.n_per_class=[2,5]", "task.draws=1", *SMALL_SENSOR),
    "recordings": ("scene=touch", "task.n_per_class=[1,3]", "task.draws=1", *SMALL_SENSOR),
    "stability": (),
}  # fmt: skip
_TIMES = ("seconds", "_s", "bytes")  # ends of columns that are measured


@dataclass(frozen=True)
class Item:
    """A number, or several.

    Attributes:
        config: what takes part, by ``_target_``.
        make: computes it: texts and integers that are equal anywhere, numbers within a tolerance,
            and None where it says nothing.
        tolerance: of floating-point numbers.
    """

    config: Any
    make: Callable[[], Any]
    tolerance: float = TOLERANCE


# Frames -------------------------------------------------------------------------------------------


def frames_of(dimension: int, dtype: str) -> torch.Tensor:
    """[300, H, W] of few grey values, so that many pixels tie."""
    rng = np.random.default_rng(dimension)
    pixels = rng.integers(0, 40, (FRAMES, *SIDES[dimension]))
    return torch.from_numpy(pixels.astype(dtype))


def digest(values: Any) -> str:
    """Of an array of integers or bits, whatever its type."""
    array = np.ascontiguousarray(np.asarray(values, np.int64))
    return hashlib.sha256(repr(array.shape).encode() + array.tobytes()).hexdigest()[:16]


def classes_of_frames(side: int = 24, n: int = 60) -> Frames:
    """Frames of three classes that noise does not hide."""
    rng = np.random.default_rng(7)
    labels = np.arange(n) % 3
    base = rng.integers(0, 150, (3, side, side))
    pixels = (base[labels] + rng.integers(0, 60, (n, side, side))).astype(np.uint8)
    return Frames(
        torch.from_numpy(pixels), labels, tuple("abc"), {}, origin="simulated"
    )


def between_classes(scene: Frames) -> torch.Tensor:
    """Frames [3 · 21, H, W] from one class to the next in steps of a twentieth."""
    pixels = scene.images.numpy().astype(float)
    means = [pixels[scene.labels == label].mean(0) for label in range(3)]
    noise = np.random.default_rng(8).integers(0, 60, pixels.shape[1:]) - 30
    frames = []
    for label in range(3):
        for share in np.linspace(0, 1, 21):
            mixed = (1 - share) * means[label] + share * means[(label + 1) % 3]
            frames.append(np.clip(mixed + noise, 0, 255).astype(np.uint8))
    return torch.from_numpy(np.stack(frames))


def clear_labels(labels: np.ndarray) -> list[int | None]:
    """Labels of :func:`between_classes`, None beside a change: there a rounding may decide."""
    found: list[int | None] = []
    for path in np.asarray(labels).reshape(3, 21):
        for k, label in enumerate(path):
            around = path[max(0, k - 1) : k + 2]
            found.append(int(label) if (around == label).all() else None)
    return found


# What there is ------------------------------------------------------------------------------------


def items() -> dict[str, Item]:
    """Every item by name."""
    return dict(
        [*of_words(), *of_models(), *of_the_protocol(), *of_scenes(), *of_studies()]
    )


def of_words() -> Iterator[tuple[str, Item]]:
    """Hypervectors and integer distances of HDC, exactly."""
    backends = ["numpy", "compiled"] if find_spec("numba") else ["numpy"]
    for name in OF_BITS:
        model = part("model", name)["model"]
        for dimension in SIDES:
            for dtype in DTYPES:
                for backend in backends:
                    config = {**model, "backend": backend}
                    make = functools.partial(hdc_numbers, config, dimension, dtype)
                    yield (
                        f"{name}, {backend}, D = {dimension}, {dtype}",
                        Item(config, make),
                    )


def hdc_numbers(
    config: Mapping[str, Any], dimension: int, dtype: str
) -> dict[str, Any]:
    """Digests of labels, distances and words of a model trained on the frames themselves."""
    frames, labels = frames_of(dimension, dtype), np.arange(FRAMES) % 5
    model = instantiate(OmegaConf.create(dict(config)), "model").fit(frames, labels)
    found = {
        "labels": digest(model.predict(frames)),
        "words": digest(model.encode(frames).packed),
    }
    if hasattr(model, "distances"):
        found["distances"] = digest(model.distances(frames[:40]))
    return found


def of_models() -> Iterator[tuple[str, Item]]:
    """Labels of every model of ``configs/model/`` after a few steps."""
    for path in sorted((configs.CONFIGS / "model").glob("*.yaml")):
        model = part("model", path.stem)["model"]
        make = functools.partial(labels_of, model)
        yield f"model {path.stem}", Item(model, make)


def labels_of(config: Mapping[str, Any]) -> list[int | None]:
    """Labels of frames between classes, where they are clear."""
    scene = classes_of_frames()
    torch.manual_seed(0)
    model = instantiate(OmegaConf.create(dict(config)), "model")
    train_until(model, SHORT, scene.frames(np.arange(len(scene.labels))), scene.labels)
    return clear_labels(model.predict(between_classes(scene)))


def of_the_protocol() -> Iterator[tuple[str, Item]]:
    """Splits, draws and reasons to stop."""
    config = {"_target_": "scenes.frames.Frames"}
    for kind in ("random", "ordered", "grouped", "session"):
        yield f"split {kind}", Item(config, functools.partial(split_numbers, kind))
    yield "pixels", Item(config, pixel_numbers)
    yield "stops", Item({}, stop_numbers)


def split_numbers(kind: str) -> dict[str, str]:
    """Digests of training and test indices, at several sizes and seeds."""
    labels = np.repeat(np.arange(4), [20, 24, 28, 32])
    labels = np.random.default_rng(3).permutation(np.tile(labels, 2))
    n = len(labels)
    samples = {"session": np.repeat([0, 1], n // 2), "depth": np.arange(n) % 26}
    scene = Frames(
        torch.zeros(n, 2, 3, dtype=torch.uint8), labels, tuple("abcd"), samples
    )
    found = {}
    for seed in (0, 1):
        for size in (None, 4, 17):
            split = {
                "kind": kind,
                "group": "depth",
                "test_fraction": 0.3,
                "n_train": size,
            }
            train, test = choose(scene, Split(**split), seed)
            found[f"seed {seed}, {size}"] = f"{digest(train)} {digest(test)}"
    return found


def pixel_numbers() -> list[str]:
    """Digests of frames of which some pixels are seen."""
    scene = classes_of_frames(side=9, n=6)
    seen = [
        data.pixel_subset(scene, pixels, 1).frames([0, 5]) for pixels in (2, 40, 81)
    ]
    return [digest(frames) for frames in seen]


def stop_numbers() -> list[list[str | None]]:
    """Reasons to stop, of training time, steps, loss and accuracy around every limit."""
    rules = [
        StopRule(),
        StopRule(reached_after_s=20.0, budget_s=600.0),
        StopRule(
            reached_after_s=0.0, target=0.5, least_steps=0, most_steps=300, loss=0.1
        ),
    ]
    found = []
    for rule in rules:
        for seconds in (0.0, 20.0, 600.0, 1800.0):
            for steps in (0, 199, 200, 300, 2000):
                for loss in (None, 0.0, 0.01, 0.1, 1.0, float("nan")):
                    reasons = [
                        rule.check(seconds, steps, loss, a) for a in (0.5, 0.9, 0.91)
                    ]
                    found.append(reasons)
    return found


def of_scenes() -> Iterator[tuple[str, Item]]:
    """Simulated scenes in small."""
    for path in sorted((configs.CONFIGS / "scene").glob("*.yaml")):
        if "scenes.sensor.scene." in path.read_text():
            config = composed(f"scene={path.stem}", *SMALL_SENSOR)["scene"]
            yield (
                f"scene {path.stem}",
                Item(config, functools.partial(scene_numbers, config)),
            )


def scene_numbers(config: Mapping[str, Any]) -> dict[str, Any]:
    """Mean grey values of blocks of a few frames."""
    scene = instantiate(OmegaConf.create(dict(config)), "scene")
    chosen = np.linspace(0, len(scene.labels) - 1, 4).astype(int)
    frames = scene.frames(chosen).numpy().astype(float)
    blocks = frames.reshape(len(chosen), 4, 8, 4, 8).mean((2, 4))
    return {
        "labels": digest(scene.labels),
        "grey": np.round(blocks.ravel(), 2).tolist(),
    }


def of_studies() -> Iterator[tuple[str, Item]]:
    """Every experiment that is more than a run and measures more than times, in small."""
    for name, words in EXPERIMENTS.items():
        task = composed(f"experiment={name}", *words)["task"]
        make = functools.partial(study_numbers, task)
        yield f"experiment {name}", Item(task, make, OF_STUDIES)


def study_numbers(task: Mapping[str, Any]) -> dict[str, Any]:
    """Number of rows, and the sum of each column of numbers that are not times."""
    context = Context("golden", force=True, console=Console(quiet=True))
    config = configs.without(("display",), dict(task))
    rows = list(made(named(task), **config).rows(context))
    sums: dict[str, float] = {}
    for row in rows:
        for key, value in row.items():
            if not key.endswith(_TIMES):
                sums[key] = sums.get(key, 0.0) + total_of(value)
    return {"rows": len(rows), "sums": sums}


def total_of(value: Any) -> float:
    """Sum of a number, a list of numbers or packed labels; 0 of what is none of these."""
    if isinstance(value, str) and value[:3] in ("u1:", "u2:", "i4:"):
        value = unpack_labels(value)
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return 0.0
    return float(np.nansum(np.where(np.isfinite(numbers), numbers, 0.0)))
