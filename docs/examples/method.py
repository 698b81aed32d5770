"""Draw docs/method.webp: the published form of HDC in four pictures.

    PYTHONPATH=. python docs/examples/method.py

Frames are computed from the measured transmission matrices of fibre 1 (scene ``fibre``), so
``MEASURED_DATA`` has to hold that data set: ``python -m scenes.measured`` says how to get it. Of
each frame the middle of one polarisation is shown and learnt: all around it is dark. Every fifth
frame of a class is left out of training, and the frame shown is the first of these.
"""

from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure
from torch.nn.functional import interpolate

from hdc import HDCClassifier, bits
from scenes.fibre import FibreScene

SHOWN = 3  # class of the frame that is shown: pressed by 40 to 60 µm
SIDE = 123  # pixels a side of each polarisation, between those of the frames
MIDDLE = slice(33, 90)  # of them
FILE = Path(__file__).resolve().parents[1] / "method.webp"


def pictures(scene):
    """The frame, its bits, and the majority of its class, each [H, W]; and the share of bits
    that differ between the frame and the prototype of each class [L]."""
    frames = scene.frames(range(len(scene.labels))).float()[:, None]
    frames = interpolate(frames, (SIDE, 2 * SIDE), mode="bicubic")[:, 0, MIDDLE, MIDDLE]
    left_out = np.arange(len(frames)) // len(scene.classes) % 5 == 4
    model = HDCClassifier().fit(frames[~left_out], scene.labels[~left_out])
    frame = frames[left_out & (scene.labels == SHOWN)][:1]
    words = torch.stack([model.encode(frame).packed[0], model.prototypes_[SHOWN]])
    ones = bits.unpack(words, frame[0].numel()).view(2, *frame[0].shape)
    return (frame[0], *ones), model.distances(frame)[0] / frame[0].numel()


def draw(scene):
    """Three pictures and the five distances."""
    images, distances = pictures(scene)
    titles = (
        f"1  Frame: a fibre\n    pressed by {scene.classes[SHOWN]}",
        "2  Bits: brighter than\n    the frame's median",
        "3  Prototype: majority\n    of its class's bits",
    )
    figure = Figure(figsize=(8, 2.3), layout="constrained")
    *panels, last = figure.subplots(1, 4)
    for axes, image, title in zip(panels, images, titles, strict=True):
        axes.imshow(image.numpy(), "gray", interpolation="nearest")
        axes.set_axis_off()
        axes.set_title(title, fontsize=9, loc="left")
    colours = ["#D55E00" if k == SHOWN else "0.7" for k in range(len(distances))]
    last.barh(scene.classes, 100 * distances, color=colours)
    last.invert_yaxis()
    last.spines[["top", "right"]].set_visible(False)
    last.tick_params(labelsize=9)
    last.set_xlabel("bits that differ (%)", fontsize=9)
    last.set_title("4  Answer: the nearest\n    prototype", fontsize=9, loc="left")
    return figure


if __name__ == "__main__":
    draw(FibreScene()).savefig(FILE, dpi=200, pil_kwargs={"quality": 60})
