"""Figures of a results folder as data URIs, with what they show and what makes them again."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path

REPORT = "python -m experiments.report"
_PICTURES = "python -m scenes.sensor.pictures"
_RUN = "python -m experiments.run experiment="
_LARGEST = 300_000  # bytes of a PNG that goes into the page as it is
_WIDTH = 1400  # px of one that does not


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes:
        name: of its file, without the ending.
        caption: what it shows.
        source: a data URI.
        command: what makes it again.
    """

    name: str
    caption: str
    source: str
    command: str


# (what it shows, what makes what it is drawn from), in the order of the page.
_KNOWN: dict[str, tuple[str, str]] = {
    "error_vs_time": ("Test error against training time, simulated touch frames (Table I).",
                      f"{_RUN}table1"),
    "accuracy_vs_n": ("Test accuracy against the number of training samples (Fig. 5(b)).",
                      f"{_RUN}accuracy_vs_n"),
    "accuracy_vs_d": ("Test accuracy against the number of pixels seen, which is the dimension of "
                      "a hypervector.", f"{_RUN}accuracy_vs_d"),
    "work_precision": ("Test error against the time a prediction takes.", f"{_RUN}work_precision"),
    "sensor_precision": ("Error of the simulated sensor's approximations against their run time.",
                         "python -m scenes.sensor.check"),
    **{f"sensor_{scene}": (
        f"Simulated frames of the scene “{scene}”: whole, enlarged, as hypervector, and the change "
        "that the touch makes.", _PICTURES)
       for scene in ("touch", "finger", "spatial", "drift", "tactile")},
}  # fmt: skip


def collect(folder: Path) -> list[Figure]:
    """Every SVG and PNG of a folder, known ones first; an SVG stands for a PNG of its name."""
    files = {
        path.stem: path for kind in ("png", "svg") for path in sorted(folder.glob(f"*.{kind}"))
    }
    known = [name for name in _KNOWN if name in files]
    return [_figure(files[name]) for name in [*known, *sorted(files.keys() - known)]]


def _figure(path: Path) -> Figure:
    caption, command = _KNOWN.get(path.stem, (path.stem.replace("_", " ") + ".", ""))
    words = [
        command,
        REPORT if path.suffix == ".svg" and not path.stem.startswith("sensor") else "",
    ]
    return Figure(path.stem, caption, data_uri(path), " && ".join(filter(None, words)))


def data_uri(path: Path) -> str:
    """The file itself, or a smaller WebP of a large PNG."""
    data = path.read_bytes()
    kind = {".svg": "svg+xml", ".png": "png"}[path.suffix]
    if kind == "png" and len(data) > _LARGEST:
        kind, data = "webp", _smaller(data)
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _smaller(data: bytes) -> bytes:
    from PIL import Image

    picture = Image.open(io.BytesIO(data)).convert("RGB")
    picture.thumbnail((_WIDTH, 10 * _WIDTH))
    out = io.BytesIO()
    picture.save(out, "WEBP", quality=75)
    return out.getvalue()
