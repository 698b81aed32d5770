"""A picture a scene: ``python -m scenes.sensor.pictures`` makes results/figures/sensor_*.png.

For every class (every tenth position of ``spatial``) the frame, a part of it enlarged, the same
part of its hypervector, and the change that the touch alone makes there: the noiseless intensity
minus that of the same moment without the touch, in units of the mean.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenes.sensor import statistics as st
from scenes.sensor.calibrate import RESULTS
from scenes.sensor.configured import scene
from scenes.sensor.scene import SpeckleScene

SCENES = ("touch", "finger", "spatial", "drift", "tactile")
ZOOM = slice(200, 280)


def chosen(made: SpeckleScene) -> list[tuple[str, int]]:
    """(title, sample index) of one sample a class, and a session where there are two."""
    step = 10 if len(made.classes) > 10 else 1
    found = []
    for session in range(len(made.sessions)):
        for label, name in enumerate(made.classes[::step]):
            mine = (made.labels == label * step) & (made.samples["session"] == session)
            title = f"{name}, day {1 + 16 * session}" if len(made.sessions) > 1 else name
            found.append((title, int(np.flatnonzero(mine)[0])))
    return found


def change(made: SpeckleScene, index: int) -> np.ndarray:
    """Intensity with minus without the touch at the same temperature, mean 1."""
    sensor = made.sensor
    with_touch = made.phases(index)
    without = sensor.phase + sensor.sensitivity * float(made.samples["temperature"][index])
    both = [sensor.mounted.intensity(phases[None])[0] for phases in (with_touch, without)]
    return (both[0] - both[1]).cpu().numpy()


def picture(name: str, path: Path) -> None:
    """Draw one scene."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    made = scene(name)
    samples = chosen(made)
    fig, axes = plt.subplots(
        4,
        len(samples),
        figsize=(1.55 * len(samples) + 1.1, 6.6),
        layout="compressed",
        squeeze=False,
    )
    rows = ("frame,\n500 × 500", "enlarged,\n80 × 80", "hypervector", "change by\nthe touch")
    for column, (title, index) in zip(axes.T, samples, strict=True):
        frame = made.frames([index])[0].numpy()
        bits = np.unpackbits(st.hypervectors(frame.reshape(1, -1)))[: frame.size]
        column[0].imshow(frame, cmap="gray", vmin=0, vmax=160)
        column[0].set_title(title, fontsize=10)
        column[1].imshow(frame[ZOOM, ZOOM], cmap="gray", vmin=0, vmax=160)
        column[2].imshow(
            bits.reshape(frame.shape)[ZOOM, ZOOM], cmap="gray", interpolation="nearest"
        )
        last = column[3].imshow(change(made, index)[ZOOM, ZOOM], cmap="RdBu_r", vmin=-2, vmax=2)
    for axis in axes.flat:
        axis.set_xticks([])
        axis.set_yticks([])
    for axis, label in zip(axes[:, 0], rows, strict=True):
        axis.set_ylabel(label, fontsize=9)
    bar = fig.colorbar(last, ax=list(axes[3]), shrink=0.9, pad=0.01)
    bar.set_label("of the mean", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=100)
    plt.close(fig)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("scenes", nargs="*", default=list(SCENES), help="which scenes; default all")
    parser.add_argument("--out", type=Path, default=RESULTS / "figures", help="a folder")
    wanted = parser.parse_args(arguments)
    for name in wanted.scenes:
        path = wanted.out / f"sensor_{name}.png"
        picture(name, path)
        print(path)


if __name__ == "__main__":
    main()
