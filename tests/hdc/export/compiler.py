"""For tests: models, and programs of C that include their headers."""

import subprocess

import numpy as np

from hdc import HDCClassifier
from hdc.encoders import Deviation, Levels, Median, Quantile

STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow"]

ENCODERS = [
    Median(),
    Quantile("9/10"),
    Levels(3),
    Levels(2, lit=0.9),
    Deviation(),
    Deviation([-0.7, "1/3"]),
]


def run(gcc, folder, source, *options, given=b""):
    """What a program prints that includes the header of a folder."""
    (folder / "main.c").write_text(source)
    command = [gcc, "-std=c99", "-O1", *STRICT, *options, "-o", "main", "main.c"]
    subprocess.run(command, cwd=folder, check=True)
    command = [folder / "main"]
    return subprocess.run(command, input=given, capture_output=True, check=True).stdout


def trained_on(d, encoder="median", readout="majority", dtype="uint8", classes=4):
    """A model of frames [N, D] of classes that differ."""
    rng = np.random.default_rng(d)
    labels = np.arange(8 * classes) % classes
    scale = 1 if dtype == "uint8" else 200
    base = rng.integers(0, 150 * scale, (classes, d))
    frames = base[labels] + rng.integers(0, 90 * scale, (len(labels), d))
    frames = frames.astype(dtype)
    return HDCClassifier(encoder, readout).fit(frames, labels), frames
