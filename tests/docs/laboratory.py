"""The files that docs/api.md reads: one recording of two touches in two sessions, in every
format, and one that was made later."""

import cv2
import h5py
import numpy as np
import scipy.io
import tifffile

NAMES = np.array(["left", "right"])


def make(folder):
    """Write all of them into a folder."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 150, (2, 48, 64))
    labels = np.arange(60) // 5 % 2
    session = np.arange(60) // 30 + 1
    noise = rng.integers(0, 90, (80, 48, 64))
    frames = (base[labels] + noise[:60]).astype(np.uint8)
    names = NAMES[labels]
    force = np.round(1 + labels + np.arange(60) / 100, 2)
    cube = np.moveaxis(frames, 0, -1)
    about = {"touch": names.astype(object), "force": force, "session": session}
    scipy.io.savemat(folder / "press.mat", {"cube": cube, **about})
    with h5py.File(folder / "scan.h5", "w") as file:
        file["run1/frames"], file["run1/labels"] = frames, names.tolist()
        file["run1/session"] = session
    tifffile.imwrite(folder / "stack.tif", frames.astype(np.uint16) * 16, imagej=True)
    np.save(folder / "cube.npy", cube)
    rows = [f"{name},{s}" for name, s in zip(names, session, strict=True)]
    for name in ("stack.csv", "cube.csv"):
        (folder / name).write_text("\n".join(["label,session", *rows]))
    images = [cv2.imencode(".png", frame)[1].tobytes() for frame in frames]
    # Five frames of each touch after the other, at 10 Hz; and three films of ten of each.
    _film(folder / "film.mp4", "mp4v", frames)
    rows = [f"{k / 2},{k / 2 + 0.5},{NAMES[k % 2]}" for k in range(12)]
    (folder / "film.csv").write_text("\n".join(["start_s,end_s,label", *rows]))
    (folder / "films").mkdir()
    for label, name in enumerate(NAMES):
        for k, some in enumerate(np.split(frames[labels == label], 3), start=1):
            _film(folder / "films" / f"{name}_{k}.avi", "MJPG", some)
    for k, name in enumerate(names):
        path = folder / "touches" / f"day{session[k]}" / name / f"{k}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(images[k])
    later = np.arange(20) % 2
    frames = (base[later] + noise[60:]).astype(np.uint8)
    np.savez(folder / "later.npz", frames=frames, labels=NAMES[later])


def _film(path, code, frames):
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (64, 48))
    for frame in frames:
        film.write(np.dstack([frame] * 3))
    film.release()
