"""Write a scene to disk: ``python -m scenes.export scene=touch out=FOLDER [key=value …]``.

Frames become FOLDER/CLASS/00000.png, lossless 8- or 16-bit PNG, numbered as in the scene.
FOLDER/manifest.csv has the label, class index and properties (``order``, ``session`` …) of each
file, with every digit. ``scene=recorded scene.path=FOLDER`` reads the same scene back. The other
arguments are those of ``experiments.run``.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from scenes.frames import Scene
from scenes.validate import require


def export(scene: Scene, folder: Path) -> Path:
    """Write all frames of a scene into a new or empty folder; returns the path of the manifest."""
    import cv2

    if folder.is_dir() and any(folder.iterdir()):
        raise FileExistsError(f"out: expected a new or an empty folder, found {folder}")
    for name in scene.classes:
        require(name == Path(name).name, "scene.classes", name, "names of folders")
        (folder / name).mkdir(parents=True, exist_ok=True)
    names = [f"{scene.classes[c]}/{i:05d}.png" for i, c in enumerate(scene.labels)]
    for i, name in enumerate(names):
        # Speckle hardly compresses: the fastest level.
        speed = [cv2.IMWRITE_PNG_COMPRESSION, 1]
        if not cv2.imwrite(str(folder / name), scene.frames([i])[0].numpy(), speed):
            raise OSError(f"{folder / name}: could not be written")
    manifest = folder / "manifest.csv"
    with manifest.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "label", "class_index", *scene.samples])
        for k, (name, c) in enumerate(zip(names, scene.labels, strict=True)):
            properties = [values[k].item() for values in scene.samples.values()]
            writer.writerow([name, scene.classes[c], int(c), *properties])
    return manifest


def compose(overrides: Sequence[str]) -> Any:
    """The scene that these overrides of configs/config.yaml describe."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.utils import instantiate

    with initialize_config_module("configs", version_base="1.3"):
        config = hydra_compose("config", overrides=list(overrides))
    torch.set_num_threads(config.threads or torch.get_num_threads())
    return instantiate(config.scene, _convert_="all")


def main(arguments: Sequence[str] | None = None) -> None:
    given = list(sys.argv[1:] if arguments is None else arguments)
    out = [a.removeprefix("out=") for a in given if a.startswith("out=")]
    if len(out) != 1 or not out[0] or {"-h", "--help"} & set(given):
        sys.exit(f"{__doc__}\nout: expected one folder, out=FOLDER, found {len(out)}")
    scene = compose([a for a in given if not a.startswith("out=")])
    manifest = export(scene, Path(out[0]).expanduser())
    print(f"{len(scene)} frames of {len(scene.classes)} classes, {manifest}")


if __name__ == "__main__":
    main()
