"""Figures of a results folder as data URIs, with what they show and what makes them again."""

from __future__ import annotations

import base64
import functools
import io
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from experiments.record import ROOT

REPORT = "python -m experiments.report"
_RUN = "python -m experiments.run experiment="
_CHECKOUT = ROOT / "results" / "figures"
_LARGEST = 300_000  # bytes of a PNG that goes into the page as it is
_WIDTH = 1400  # px of one that does not


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes:
        name: of its file, without the ending.
        caption: what it shows.
        command: what makes it again.
        source: a data URI; empty if there is no such file.
    """

    name: str
    caption: str
    command: str
    source: str = ""

    @property
    def of_sensor(self) -> bool:
        """Whether it shows the simulated sensor and no result of a model."""
        return self.name.startswith("sensor_")


# What a figure shows, and the experiment that makes what it is drawn from, in the page's order;
# none where several do.
_DRAWN = {
    "error_vs_time": ("Test error against training time (Table I).", ""),
    "fig4_images": ("Speckle, hypervector and prototype of each class (Fig. 4(a)).", "correlation"),
    "fig4_correlations": ("Correlations within and between classes (Fig. 4(b) to (e)).",
                          "correlation"),
    "fig5_confusion": ("Confusion matrix of the touch scene (Fig. 5(a)).", ""),
    "accuracy_vs_n": ("Test accuracy against the number of training samples (Fig. 5(b)).", ""),
    "fig6_confusion": ("Confusion matrix of the finger scene (Fig. 6(b)).", "scenes"),
    "fig7_spatial": ("51 positions: correlations and confusion (Fig. 7).", "spatial_correlation"),
    "fig8_drift": ("Accuracy after recalibration with N_new samples (Fig. 8(b)).", "drift"),
    "fig9_confusion": ("Confusion matrix of the tactile scene (Fig. 9(d)).", "scenes"),
    "accuracy_vs_d": ("Test accuracy against the number of pixels seen: the dimension of a "
                      "hypervector.", "accuracy_vs_d"),
    "work_precision": ("Test error against the time a prediction takes.", ""),
    "numerics": ("Error against CPU time of phases, mean correlations and the elastic layer.",
                 "numerics"),
    "stiffness_limit": ("Highest loss against the learning rate in units of the predicted limit.",
                        "stiffness"),
    "stiffness_spectrum": ("Eigenvalues of the Hessian of softmax regression.", "stiffness"),
    "softmax_methods": ("Loss gap and test error of methods for softmax regression against "
                        "training time.", "softmax_methods"),
    "robustness": ("Test accuracy on disturbed frames and with flipped bits in the stored model.",
                   "robustness"),
}  # fmt: skip
_KNOWN = {
    **{name: (text, f"{_RUN}{experiment} && {REPORT}" if experiment else "make reproduce")
       for name, (text, experiment) in _DRAWN.items()},
    "sensor_precision": ("Error of the simulated sensor's approximations against their run time.",
                         "python -m scenes.sensor.check"),
    **{f"sensor_{scene}": (
        f"Simulated frames of the scene “{scene}”: whole, enlarged, as hypervector, and the change "
        "that the touch makes.", "python -m scenes.sensor.pictures")
       for scene in ("touch", "finger", "spatial", "drift", "tactile")},
}  # fmt: skip


def collect(folder: Path) -> list[Figure]:
    """Known figures, missing ones too, then every other SVG and PNG; an SVG stands for its PNG.

    Args:
        folder: the ``figures`` of a results folder. Those of the sensor may be in the checkout's,
            where its scripts write.
    """
    files = {
        path.stem: path
        for place, pattern in ((_CHECKOUT, "sensor_*"), (folder, "*"))
        for kind in ("png", "svg")
        for path in sorted(place.glob(f"{pattern}.{kind}"))
    }
    found = []
    for name in [*_KNOWN, *sorted(files.keys() - _KNOWN.keys())]:
        caption, command = _KNOWN.get(name, (name.replace("_", " ") + ".", ""))
        path = files.get(name)
        source = _data_uri(path, path.stat().st_mtime_ns) if path else ""
        found.append(Figure(name, caption, command, source))
    return found


@functools.cache
def _data_uri(path: Path, changed: int) -> str:
    """The file itself, or a smaller WebP of a large PNG."""
    data = path.read_bytes()
    kind = {".svg": "svg+xml", ".png": "png"}[path.suffix]
    if kind == "png" and len(data) > _LARGEST:
        kind, data = "webp", _smaller(data)
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _smaller(data: bytes) -> bytes:
    picture = Image.open(io.BytesIO(data)).convert("RGB")
    picture.thumbnail((_WIDTH, 10 * _WIDTH))
    out = io.BytesIO()
    picture.save(out, "WEBP", quality=75)
    return out.getvalue()
