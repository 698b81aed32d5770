"""A scene of the simulated sensor: labels, sessions, samples, and frames made when asked for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from hdc.parameters import check_integer
from scenes.frames import Indices, row_numbers
from scenes.sensor.contact import BoundContact, Press, Touch
from scenes.sensor.environment import Room
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor
from scenes.validate import require

CPU_BATCH = 1  # a frame's arrays fill a core's cache
DEVICE_BATCH = 64  # a GPU wants many


class SpeckleScene:
    """N labelled frames of one sensor.

    Args:
        sensor: the sensor.
        classes: class name → what differs between classes (``position`` at least), or ``None`` for
            a class in which nobody touches.
        contact: called with a class's mapping to make its contact (a ``_partial_`` in the
            configuration).
        samples_per_class: in every session.
        sessions: one ``Room`` each, in order of time.
        seed: seed of everything that differs between samples.

    Sample ``s·n + m`` is the m-th of n in session s. Its label, touch, temperature and noise depend
    on (seed, session, m) alone, so that the first of two sessions is the same as an only one.
    """

    origin = "simulated"
    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the frames it makes."""

    def __init__(
        self,
        sensor: Sensor,
        classes: Mapping[str, Mapping[str, Any] | None],
        contact: Callable[..., Press] | None = None,
        samples_per_class: int = 100,
        sessions: Sequence[Room] = (Room(),),
        seed: int = 0,
    ) -> None:
        check_integer("seed.samples", seed, 0)
        self.sensor = sensor
        self.sessions = tuple(sessions)
        self.seed = seed
        check_integer("scene.samples_per_class", samples_per_class, 1)
        self.classes = tuple(map(str, classes))
        self._per_class = samples_per_class
        self.contacts: list[Press | None] = []
        for name, difference in classes.items():
            if difference is None:
                self.contacts.append(None)
                continue
            if contact is None:
                raise ValueError(
                    f"scene.contact: expected one for class {name!r}, found None"
                )
            made = contact(**difference)
            sensor.paths.require_inside(f"scene.classes.{name}.position", made.position)
            self.contacts.append(made)
        self.shape = (sensor.camera.crop, sensor.camera.crop)
        self.labels, self.samples = self._plan()
        self._bound: dict[int, BoundContact] = {}

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Indices) -> Tensor:
        """uint8 [n, H, W] on the CPU; each sample is the same in any batch."""
        wanted = row_numbers(indices, len(self))
        frames = torch.empty((len(wanted), *self.shape), dtype=torch.uint8)
        batch = CPU_BATCH if self.sensor.place.type == "cpu" else DEVICE_BATCH
        camera = self.sensor.mounted
        for start in range(0, len(wanted), batch):
            part = wanted[start : start + batch].tolist()
            phases = torch.stack([self.phases(index) for index in part])
            noise = [self._stream("noise", index) for index in part]
            exposed = camera.expose(camera.intensity(phases), noise)
            frames[start : start + batch] = exposed.cpu()
        return frames

    def phases(self, index: int) -> Tensor:
        """φ float64 [P] in rad of one sample, not reduced."""
        sensor = self.sensor
        temperature = float(self.samples["temperature"][index])
        phases = sensor.phase + sensor.sensitivity * temperature
        label = int(self.labels[index])
        contact = self.contacts[label]
        if contact is None:
            return phases
        if label not in self._bound:
            self._bound[label] = contact.bind(sensor)
        touch = Touch(
            depth=float(self.samples["depth"][index]),
            x=float(self.samples["x"][index]),
            y=float(self.samples["y"][index]),
            random=self._stream("texture", index),
        )
        phases += self._bound[label](touch)
        return phases

    def fingerprint(self) -> str:
        """SHA-256 over parameters and seeds; not over the code that draws from them."""
        contacts = []
        for contact in self.contacts:
            described = contact and [type(contact).__name__, asdict(contact)]
            contacts.append(described)
        parts = {
            "sensor": asdict(self.sensor),
            "contacts": contacts,
            "classes": self.classes,
            "counts": [self._per_class] * len(self.classes),
            # A key without a meaning, on which the digests of all records stand.
            "sessions": [asdict(room) | {"creep": None} for room in self.sessions],
            "seed": self.seed,
        }
        text = json.dumps(parts, sort_keys=True, default=repr)
        return hashlib.sha256(text.encode()).hexdigest()

    def _plan(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Labels in random order within each session, and what each sample will be."""
        plans = []
        for session, room in enumerate(self.sessions):
            plans.append(self._plan_session(session, room))
        samples = {}
        for name in plans[0]:
            samples[name] = np.concatenate([plan[name] for plan in plans])
        deepest = float(samples["depth"].max(initial=0.0))
        thickness = self.sensor.layer.thickness
        limit = f"less than the layer's thickness, {thickness:g} m, in every touch"
        require(deepest < thickness, "scene.contact.depth", deepest, limit)
        return samples.pop("label"), samples

    def _plan_session(self, session: int, room: Room) -> dict[str, np.ndarray]:
        """Labels and properties of the samples of one session."""
        ordered = np.repeat(np.arange(len(self.classes)), self._per_class)
        labels = stream(self.seed, "labels", session).permutation(ordered)
        n = len(labels)
        touches = stream(self.seed, "touches", session)
        normals = touches.standard_normal((n, 3))
        weather = stream(self.seed, "room", session)
        temperature = room.temperatures(n, weather)
        sample = {
            "label": labels,
            "order": np.arange(n),
            "session": np.full(n, session),
            "temperature": temperature,
            "depth": np.zeros(n),
            "x": np.full(n, np.nan),
            "y": np.full(n, np.nan),
        }
        for label, contact in enumerate(self.contacts):
            if contact is None:
                continue
            mine = np.flatnonzero(labels == label)
            for name, values in contact.draw(normals[mine]).items():
                sample[name][mine] = values
        # A contact that is not glued to the layer presses it and never pulls.
        np.maximum(sample["depth"], 0, out=sample["depth"])
        return sample

    def _stream(self, purpose: str, index: int) -> np.random.Generator:
        session = self.samples["session"][index]
        order = self.samples["order"][index]
        return stream(self.seed, purpose, session, order)
