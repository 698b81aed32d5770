"""The competitors: every other classifier that the optical hyperdimensional one is compared with.

All have scikit-learn's conventions: ``fit``, ``predict``, ``score``, ``clone``
(:class:`baselines.base.Classifier`). Frames are uint8 or uint16 arrays or tensors [N, H, W].

Import a model from its own module (``from baselines.softmax import SoftmaxRegression``), so that a
run loads only what it uses.
"""
