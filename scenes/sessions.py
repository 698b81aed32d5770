"""Scenes of two sessions, made of other scenes: the two parts in time of one, or several scenes.

They make studies of drift of public data sets: train on the first cycles and recalibrate with
later ones; train on one fibre and use another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from scenes.frames import Indices, Scene
from scenes.validate import require


class Halves:
    """One scene as two sessions: the first half in time of the frames of each class, and the rest.

    Args:
        scene: the scene; its ``samples["order"]`` is the time.
    """

    cacheable = False

    def __init__(self, scene: Scene):
        self._scene = scene
        self.classes = scene.classes
        self.labels = scene.labels
        self.shape = scene.shape
        self.origin = scene.origin
        session = np.zeros(len(self.labels), np.int64)
        for c in range(len(self.classes)):
            members = np.flatnonzero(self.labels == c)
            times = scene.samples["order"][members]
            in_time = members[np.argsort(times, kind="stable")]
            first_later = round(0.5 * len(members))
            session[in_time[first_later:]] = 1
        self.samples: Mapping[str, np.ndarray] = {**scene.samples, "session": session}

    def frames(self, indices: Indices) -> Tensor:
        """Frames of the recording."""
        return self._scene.frames(indices)

    def fingerprint(self) -> str:
        """SHA-256 of the recording's digest and the share of the first session."""
        text = f"{self._scene.fingerprint()} 0.5"
        return hashlib.sha256(text.encode()).hexdigest()


class Joined:
    """Several scenes with the same number of classes and pixels, one per session, in order.

    Args:
        scenes: a mapping of two or more; classes are matched by order, and have the names of the
            first scene.

    Raises:
        ValueError: if the scenes differ in the number of classes or the shape of frames.
    """

    cacheable = False

    def __init__(self, scenes: Mapping[str, Scene]):
        self._scenes = list(scenes.values())
        first = self._scenes[0]
        wanted = len(first.classes), first.shape
        expected = f"{len(first.classes)} classes of frames {first.shape}"
        for other in self._scenes[1:]:
            found = len(other.classes), other.shape
            require(found == wanted, "scene.scenes", found, expected)
        self.classes = first.classes
        self.shape = first.shape
        self.origin = first.origin
        self.labels = np.concatenate([scene.labels for scene in self._scenes])
        sizes = [len(scene.labels) for scene in self._scenes]
        self._starts = np.cumsum([0, *sizes])
        starts = zip(self._scenes, self._starts, strict=False)
        orders = [scene.samples["order"] + start for scene, start in starts]
        self.samples: Mapping[str, np.ndarray] = {
            "order": np.concatenate(orders),
            "session": np.repeat(np.arange(len(sizes)), sizes),
        }

    def frames(self, indices: Indices) -> Tensor:
        """Frames of the scenes that the indices fall into."""
        frames = []
        for index in np.asarray(indices, np.int64).reshape(-1):
            part = int(np.searchsorted(self._starts, index, side="right")) - 1
            frames.append(self._scenes[part].frames([index - self._starts[part]]))
        return torch.cat(frames) if frames else self._scenes[0].frames([])

    def fingerprint(self) -> str:
        """SHA-256 of the scenes' digests."""
        digests = " ".join(scene.fingerprint() for scene in self._scenes)
        return hashlib.sha256(digests.encode()).hexdigest()
