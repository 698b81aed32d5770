"""The baselines: every other classifier that the optical hyperdimensional one is compared with.

Import a model from its own module (``from baselines.softmax import SoftmaxRegression``), so that a
run loads only what it uses. :class:`baselines.base.Classifier` says what all have in common.
"""
