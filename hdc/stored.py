"""What the file of a model says, checked in every part before it is believed."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from math import isfinite, prod
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, planes
from hdc.prototypes import Counters
from hdc.rejection import Calibration

FORMAT = "hdc-classifier-2"
_FIRST = "hdc-classifier-1"  # without kind, recalibrated, calibration and metadata


@dataclass
class Stored:
    """A model as it lies in a file.

    Attributes:
        kind: name of the model's class.
        parameters: constructor parameters.
        classes: labels in the order of the counters.
        frame_shape: (H, W) or (D,).
        counters: L classes.
        prototypes: int64 [L, W].
        recalibrated: whether the prototypes are more than the counters' majority.
        calibration: what the model knows of distances (:mod:`hdc.rejection`), if it does.
        metadata: the user's own.
    """

    kind: str
    parameters: dict[str, Any]
    classes: np.ndarray
    frame_shape: tuple[int, ...]
    counters: Counters
    prototypes: Tensor
    recalibrated: bool
    calibration: Calibration | None
    metadata: dict[str, Any]

    def header(self) -> dict[str, Any]:
        """All but the tensors, as JSON has it.

        Raises:
            TypeError: for labels or metadata that JSON has not.
        """
        classes = inputs.values(self.classes)
        for label in classes:
            if not isinstance(label, str | int | float | bool):
                raise TypeError(f"expected labels of type str, int, float or bool, found {label!r}")
        try:
            json.dumps(self.metadata, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise TypeError(f"metadata: expected values that JSON has, found: {error}") from error
        return {
            "format": FORMAT,
            "kind": self.kind,
            "parameters": self.parameters,
            "classes": classes,
            "frame_shape": self.frame_shape,
            "recalibrated": self.recalibrated,
            "calibration": vars(self.calibration) if self.calibration else None,
            "metadata": self.metadata,
        }

    def tensors(self) -> dict[str, Tensor]:
        """The tensors by name."""
        return {
            "planes": self.counters.planes,
            "n": self.counters.n,
            "prototypes": self.prototypes,
        }


def checked(kind: str, header: dict[str, Any], tensors: dict[str, Tensor]) -> Stored:
    """The model of a file.

    Args:
        kind: name of the class that is expected.
        header: the header that :func:`hdc.files.read` gives.
        tensors: the tensors that it gives.

    Raises:
        ValueError: for whatever does not fit; says what was found.
        KeyError, TypeError, AttributeError: for a header that is no model's at all.
    """
    if header.get("format") not in (FORMAT, _FIRST):
        raise ValueError(f"no header of format {FORMAT!r} or {_FIRST!r}")
    if header.get("kind", kind) != kind:
        raise ValueError(f"a saved {header['kind']}; load it with {header['kind']}.load")
    expected = {"planes", "n", "prototypes"}
    if set(tensors) != expected:
        raise ValueError(f"expected tensors {sorted(expected)}, found {sorted(tensors)}")
    shape = header["frame_shape"]
    if not (
        isinstance(shape, list)
        and 1 <= len(shape) <= 2
        and all(isinstance(s, int) and s > 0 for s in shape)
    ):
        raise ValueError(f"frame shape {shape!r}")
    classes, dimension = header["classes"], prod(shape)
    if len(set(classes)) != len(classes) or len(classes) < 2:
        raise ValueError(f"classes {classes!r}")
    _check_tensors(tensors, len(classes), dimension)
    counters = Counters(len(classes), dimension)
    counters.planes, counters.n = tensors["planes"], tensors["n"]
    recalibrated, metadata = header.get("recalibrated"), header.get("metadata", {})
    if recalibrated not in (None, False, True) or not isinstance(metadata, dict):
        raise ValueError(f"recalibrated {recalibrated!r}, metadata {metadata!r}")
    return Stored(
        kind=kind,
        parameters=header["parameters"],
        classes=inputs.label_array(classes, len(classes)),
        frame_shape=tuple(shape),
        counters=counters,
        prototypes=tensors["prototypes"],
        recalibrated=bool(recalibrated),
        calibration=_calibration(header.get("calibration"), len(classes)),
        metadata=metadata,
    )


def _check_tensors(tensors: dict[str, Tensor], n_classes: int, dimension: int) -> None:
    counts, n, prototypes = tensors["planes"], tensors["n"], tensors["prototypes"]
    width = bits.words_for(dimension)
    for name, tensor, wanted in (
        ("planes", counts, (n_classes, max((1, *counts.shape[1:2])), width)),
        ("n", n, (n_classes,)),
        ("prototypes", prototypes, (n_classes, width)),
    ):
        if tensor.dtype != torch.int64 or tuple(tensor.shape) != wanted:
            raise ValueError(
                f"{name}: {tensor.dtype} {tuple(tensor.shape)} instead of torch.int64 {wanted}"
            )
    inside = bits.pack(torch.ones(dimension, dtype=torch.bool))
    if ((counts & ~inside) != 0).any() or ((prototypes & ~inside) != 0).any():
        raise ValueError("bits beyond the last pixel")
    if (n < 0).any() or not n.any():
        raise ValueError(f"sample counts {n.tolist()}")
    if any(planes.greater(c, m).any() for c, m in zip(counts, n.tolist(), strict=True)):
        raise ValueError("a bit set in more samples than the class has")


def _calibration(found: Any, n_classes: int) -> Calibration | None:
    if found is None:
        return None
    if set(found) != {field.name for field in fields(Calibration)}:
        raise ValueError(f"calibration of {sorted(found)}")
    means, numbers = found["means"], found["numbers"]
    positive = [found["spread"], found["temperature"], found["freedom"], *means]
    if (
        not len(means) == len(numbers) == n_classes
        or not all(isinstance(x, int | float) and isfinite(x) and x >= 0 for x in positive)
        or not all(isinstance(x, int) and x >= 0 for x in [found["freedom"], *numbers])
        or not (found["temperature"] > 0 and found["freedom"] > 0)
    ):
        raise ValueError(f"calibration {found!r}")
    return Calibration(
        tuple(means), tuple(numbers), found["spread"], found["freedom"], found["temperature"]
    )
