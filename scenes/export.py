"""Write a scene to disk: ``python -m scenes.export scene=touch out=FOLDER [key=value …]``.

Frames become FOLDER/CLASS/00000.png, lossless 8- or 16-bit PNG, numbered as in the scene.
FOLDER/manifest.csv has the label, class index and properties (``order``, ``session`` …) of each
file, with every digit. ``scene=recorded scene.path=FOLDER`` reads the same scene back. The other
arguments are overrides of ``experiments.run``.
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
    """Write all frames of a scene into a new or empty folder; returns the path of the manifest.

    Raises:
        FileExistsError: the folder has files.
        ValueError: the name of a class cannot be the name of a folder.
        OSError: a file cannot be written.
    """
    import cv2

    if folder.is_dir() and any(folder.iterdir()):
        raise FileExistsError(f"out: expected a new or an empty folder, found {folder}")
    for name in scene.classes:
        require(name == Path(name).name, "scene.classes", name, "names of folders")
        (folder / name).mkdir(parents=True, exist_ok=True)
    # Speckle hardly compresses: the fastest level.
    speed = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    names = []
    for i, label in enumerate(scene.labels):
        names.append(f"{scene.classes[label]}/{i:05d}.png")
        frame = scene.frames([i])[0].numpy()
        path = folder / names[i]
        if not cv2.imwrite(str(path), frame, speed):
            raise OSError(f"{path}: could not be written")
    manifest = folder / "manifest.csv"
    with manifest.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "label", "class_index", *scene.samples])
        for i, label in enumerate(scene.labels):
            properties = [values[i].item() for values in scene.samples.values()]
            row = [names[i], scene.classes[label], int(label), *properties]
            writer.writerow(row)
    return manifest


def config_of(overrides: Sequence[str]) -> Any:
    """The config that is configs/config.yaml with these overrides."""
    from hydra import compose, initialize_config_module

    with initialize_config_module("configs", version_base="1.3"):
        return compose("config", overrides=list(overrides))


def scene_of(overrides: Sequence[str]) -> Any:
    """The scene of configs/config.yaml with these overrides."""
    from hydra.utils import instantiate

    config = config_of(overrides)
    torch.set_num_threads(config.threads or torch.get_num_threads())
    return instantiate(config.scene, _convert_="all")


def main(arguments: Sequence[str] | None = None) -> None:
    given = sys.argv[1:] if arguments is None else arguments
    out, overrides = [], []
    for word in given:
        if word.startswith("out="):
            out.append(word.removeprefix("out="))
        else:
            overrides.append(word)
    asks_for_help = "-h" in given or "--help" in given
    if asks_for_help or len(out) != 1 or not out[0]:
        sys.exit(f"{__doc__}\nout: expected one folder, out=FOLDER, found {len(out)}")
    from hydra.errors import HydraException, InstantiationException

    try:
        scene = scene_of(overrides)
        manifest = export(scene, Path(out[0]).expanduser())
    except InstantiationException as error:
        sys.exit(f"error: {error.__cause__}")
    except (HydraException, ValueError, OSError) as error:
        sys.exit(f"error: {error}")
    print(f"{len(scene)} frames of {len(scene.classes)} classes, {manifest}")


if __name__ == "__main__":
    main()
