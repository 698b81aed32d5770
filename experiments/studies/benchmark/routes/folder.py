"""Folder: files of images to a saved model, as ``hdc train`` does it once it has started.

The compiled kernels are loaded here, so they are used; the command loads them for some thousand
frames and more.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from experiments.studies.benchmark.cases import Case, packed_bytes
from experiments.studies.benchmark.names import DECODED, OURS
from experiments.studies.benchmark.route import Job, route
from hdc import HDCClassifier, readers
from hdc.readers.files import usable_cores


@route("folder", OURS, module="cv2")
def hdc(case: Case) -> Job:
    from hdc.command import work

    folder = _Folder(case)
    model = Path(folder.name, "model.safetensors")

    def call() -> Path:
        stream = readers.open_stream(folder.name)
        work.train(stream, readers.Window(), model, None, case.seed)
        return model

    def form(path: Path) -> np.ndarray:
        return packed_bytes(HDCClassifier.load(path).prototypes_, case.d)

    return call, form


@route("folder", DECODED, module="cv2")
def opencv(case: Case) -> Job:
    """The limit of whatever reads these files by OpenCV: decoding alone, and nothing is kept."""
    import cv2

    folder = _Folder(case)

    def decode(file: Path) -> Any:
        data = np.frombuffer(file.read_bytes(), np.uint8)
        return cv2.imdecode(data, cv2.IMREAD_UNCHANGED) is None

    def call() -> list[Any]:
        files = sorted(Path(folder.name).rglob("*.png"))
        with ThreadPoolExecutor(usable_cores()) as executor:
            return list(executor.map(decode, files))

    return call, lambda _: None


class _Folder(tempfile.TemporaryDirectory[str]):
    """The frames of a case as PNGs, square if that is possible; it goes with the object."""

    def __init__(self, case: Case) -> None:
        import cv2

        super().__init__()
        side = round(case.d**0.5)
        shape = (side, side) if side * side == case.d else (1, case.d)
        for i, (frame, label) in enumerate(zip(case.frames.numpy(), case.labels, strict=True)):
            file = Path(self.name, str(label), f"{i}.png")
            file.parent.mkdir(exist_ok=True)
            cv2.imwrite(str(file), frame.reshape(shape))
