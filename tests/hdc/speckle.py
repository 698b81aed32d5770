"""For tests: frames of speckle, of noise, and how often sets hold the right label."""

import numpy as np

D = 2048


class Speckle:
    """Speckle of correlated classes: |field of the class + a share of a fresh field|².

    The fields have 36 % of their intensity in common. The share of the fresh field differs from
    frame to frame, so that the distances of a class spread far more than independent bits would.
    """

    def __init__(self, seed, classes=5):
        self.rng, self.classes = np.random.default_rng(seed), classes
        self.common = self.field(1)
        self.fields = self.of_new_classes()

    def field(self, n):
        return self.rng.standard_normal((n, D)) + 1j * self.rng.standard_normal((n, D))

    def of_new_classes(self):
        return 0.6 * self.common + 0.8 * self.field(self.classes)

    def frames(self, n, fields=None):
        labels = np.arange(n) % self.classes
        share = 0.5 * np.exp(0.2 * self.rng.standard_normal((n, 1)))
        fields = self.fields if fields is None else fields
        intensity = np.abs(fields[labels] + share * self.field(n)) ** 2
        return np.clip(30 * intensity, 0, 255).astype(np.uint8), labels


def junk(seed=0):
    noise = np.random.default_rng(seed).integers(0, 256, (50, D))
    return np.concatenate([noise, np.zeros((1, D)), np.full((1, D), 255)]).astype(
        np.uint8
    )


def share_of_right(sets, labels):
    return float(np.mean([y in one for y, one in zip(labels, sets, strict=True)]))
